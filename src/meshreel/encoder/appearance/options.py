"""Options of what surfaces look like: colours of vertices, textures, splats."""

from __future__ import annotations

from dataclasses import dataclass

from ...analysis.appearance.splat_fit import FitSplatsOptions
from ...coding.appearance.colors import ColorCodingOptions
from ...coding.appearance.pictures import VideoOptions
from ...coding.appearance.splats import SplatCodingOptions
from ...errors import InputError

TEXTURE_SIZES = (128, 256, 512, 1024, 2048)


@dataclass(frozen=True, slots=True)
class TextureOptions:
    """Options of textures, which need the extra `color`."""

    size: int | None = None  # width of a texture, and its height at most, texels; None: as the pictures have detail
    video: VideoOptions = VideoOptions()
    always: bool = False  # also where frames have colours of their vertices only
    compatible: bool = False  # also as H.264, for devices that cannot play AV1

    def __post_init__(self) -> None:
        if self.size is not None and self.size not in TEXTURE_SIZES:
            raise InputError(f"texture {self.size}: give {', '.join(map(str, TEXTURE_SIZES))} texels")


@dataclass(frozen=True, slots=True)
class SplatOptions:
    """Options of splats, which need the extra `splats`."""

    fit: FitSplatsOptions = FitSplatsOptions()
    coding: SplatCodingOptions = SplatCodingOptions()
    frames: int = 16  # of a chain, whose pictures are looked at, at most
    views: int = 6  # of each, where there are no colour cameras
    size: int = 256  # pixels, of the longer side of the body in a picture

    def __post_init__(self) -> None:
        if self.frames < 1 or self.views < 1 or not 16 <= self.size <= 4096:
            text = f"splats of {self.frames} frames, {self.views} views, {self.size} pixels"
            raise InputError(f"{text}: give at least 1, 1 and 16 to 4096")


@dataclass(frozen=True, slots=True)
class AppearanceOptions:
    """Options of what surfaces look like; a sequence without colours has none."""

    colors: ColorCodingOptions = ColorCodingOptions()  # of the vertices, which every coloured group has
    texture: TextureOptions | None = TextureOptions()  # None: no textures
    splats: SplatOptions | None = None  # None: no splats
