"""Options of what surfaces look like, and pictures of an atlas as video: AV1, and H.264, which more devices play.

In: pictures in their order. Out: the payloads of chunks of kind PICTURES and COMPATIBLE.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Literal, get_args

import numpy as np
from jaxtyping import UInt8

from ...coding.appearance.pictures import CRF, VideoEncoder, encode_pictures, to_i420
from ...container.writer import Companion
from ...errors import InputError
from ...format.layout import LAYER_PICTURES, ChunkKind, VideoCodec
from ...geometry.atlas import Layout
from ...geometry.threads import ahead

TextureSize = Literal[128, 256, 512, 1024, 2048]  # texels
TEXTURE_SIZES: tuple[int, ...] = get_args(TextureSize)
MOST_SPLATS = 1 << 20  # of a chain (guess)


@dataclass(frozen=True, slots=True)
class TextureOptions:
    """Options of textures, which need the extra `color`."""

    size: int | None = None  # width of a texture, and its height at most, texels; None: as the pictures have detail
    crf: int = CRF  # SVT's constant rate factor, 1 to 63; larger is coarser
    always: bool = False  # also where frames have colours of their vertices only
    compatible: bool = False  # also as H.264, for devices that cannot play AV1

    def __post_init__(self) -> None:
        if self.size is not None and self.size not in TEXTURE_SIZES:
            raise InputError(f"texture {self.size}: give {', '.join(map(str, TEXTURE_SIZES))} texels")


@dataclass(frozen=True, slots=True)
class AppearanceOptions:
    """Options of what surfaces look like; a sequence without colours has none."""

    color_step: float = 0.0909  # quantiser step of the colours of vertices, in units of the whole range
    texture: TextureOptions | None = TextureOptions()  # None: no textures
    splats: int | None = None  # on each moving body, which need the extra `splats`; None: no splats

    def __post_init__(self) -> None:
        if self.splats is not None and not 1 <= self.splats <= MOST_SPLATS:
            raise InputError(f"{self.splats} splats: give 1 to {MOST_SPLATS}")


class Videos:
    """One video of pictures in each coding that the file is to have."""

    def __init__(self, layout: Layout, options: TextureOptions) -> None:
        """Open the encoders. Raises InputError where PyAV or one of its encoders is missing."""
        self._codecs = {ChunkKind.PICTURES: VideoCodec.AV1}
        if options.compatible:
            self._codecs[ChunkKind.COMPATIBLE] = VideoCodec.H264
        size = layout.width, layout.height
        self._encoders = {kind: VideoEncoder(*size, options.crf, codec) for kind, codec in self._codecs.items()}
        self._packets = {kind: list[bytes]() for kind in self._codecs}

    def add(self, pixels: UInt8[np.ndarray, "H W 3"]) -> None:
        """Encode the next picture, in sRGB."""
        planes = to_i420(pixels)
        for kind, encoder in self._encoders.items():
            self._packets[kind] += encoder.add(planes)

    def finish(self, counts: Sequence[int], interval: int = 1) -> list[list[Companion]]:
        """End the videos; return what belongs to each of the groups with so many pictures, as they follow."""
        found: list[list[Companion]] = [[] for _ in counts]
        for kind, encoder in self._encoders.items():
            packets = iter(self._packets[kind] + encoder.finish())
            for own, count in zip(found, counts, strict=True):
                some = [next(packets) for _ in range(count)]
                own.append(Companion(kind, encode_pictures(some, self._codecs[kind], interval)))
        return found


def layered_pictures(
    layout: Layout, frames: range, picture_of: Callable[[int], UInt8[np.ndarray, "H W 3"]], options: TextureOptions
) -> list[Companion]:
    """Return the pictures of a background in some frames, each shown until the next; a layer is a video of its own."""
    layers = list[list[Companion]]()
    for start in range(0, len(frames), LAYER_PICTURES):
        some, videos = frames[start : start + LAYER_PICTURES], Videos(layout, options)
        for pixels in ahead(picture_of, some):
            videos.add(pixels)
        layers += videos.finish([len(some)], frames.step)
    found = list[Companion]()
    for same in zip(*layers, strict=True):
        payload = b"".join(companion.read() for companion in same)
        found.append(Companion(same[0].kind, payload, tuple(accumulate(map(len, same)))))
    return found
