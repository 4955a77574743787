"""Options of what surfaces look like: colours of vertices, textures, splats."""

from __future__ import annotations

from dataclasses import dataclass

from ...coding.appearance.pictures import CRF
from ...errors import InputError

TEXTURE_SIZES = (128, 256, 512, 1024, 2048)
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
