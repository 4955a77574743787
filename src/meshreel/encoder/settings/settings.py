"""Settings: the choices of a user, with their checks, and the options of the encoder that follow from them.

`meshreel.encode` takes them as keywords, and `meshreel encode` as flags. In -> out: Settings -> EncoderOptions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from numbers import Integral, Real
from typing import Literal, get_args

from ...errors import InputError
from ..appearance.videos import TextureSize
from .options import QUALITY, EncoderOptions, appearance_options, layers_options, paper_options, scene_options

MOST_CENTERS = 100_000  # fifty times the paper's: tracking takes more than a minute a frame (guess)
Preset = Literal["best", "paper", "paper-literal"]
Effort = Literal["fast", "normal", "thorough"]
Color = Literal["auto", "texture", "vertices", "none"]
PRESETS, EFFORTS, COLORS = get_args(Preset), get_args(Effort), get_args(Color)


@dataclass(frozen=True, slots=True)
class Settings:
    """Choices of a user for an encode; raises InputError for values out of range, or that exclude each other."""

    preset: Preset = "best"
    """`best` needs the fewest bits for its quality; `paper` is section 3 of the TSMC paper, for comparisons with it;
    `paper-literal` leaves out what is better than the paper's words."""
    quality: float | None = None
    """0 (small) to 100 (fine); 50 if not given. Raise it where errors are seen, lower it where bytes are dear."""
    effort: Effort = "normal"
    """`fast` encodes in half the time, at a rate within a few per cent; `thorough` tries more templates, for the
    least rate at equal errors. Preset `best` only."""
    basis_size: int | None = None
    """Number of KLT components per group, which also excludes per-frame Draco, as studies of eq. 8 need it; chosen by
    rate and distortion if not given. Preset `paper` only."""
    centers: int | None = None
    """Number of volume centers to track, the paper's K (2000): more for many bodies or thin limbs. Preset `paper`
    only."""
    group_size: int | None = None
    """Largest number of frames in a group, the paper's GoF (16; `paper`: 10). Smaller groups decode sooner after a
    seek and take more bytes."""
    key_interval: float | None = None
    """Longest time between frames that decode without earlier ones, s (4). Shorten it for viewers who join late or
    seek often. Preset `best` only."""

    color: Color = "auto"
    """`auto` codes colours of vertices, and textures where frames have textures or colour cameras; `texture` makes
    textures of colours of vertices, too; `vertices` and `none` leave textures, or all colours, out."""
    color_quality: float | None = None
    """Quality of colours, 0 to 100; the quality of the geometry if not given. Lower it where shape matters more."""
    texture: TextureSize | None = None
    """Width of a body's texture, texels; as the pictures have detail, at most 1024, if not given."""
    compatible: bool = False
    """Store textures also as H.264, for devices that cannot play AV1; it takes 1.3 to 2 times AV1's bytes."""
    splats: int | None = None
    """Number of Gaussian splats on each moving body, as 8000, where hair and cloth should look soft: they move with
    it, and take some 7 bytes each in every key interval. Fitted to colour cameras or coloured meshes (extra `splats`:
    torch)."""

    dynamic_only: bool = False
    """Look for no background: everything may move and is coded in every frame. For scenes whose still surface flies or
    is there for a while only."""
    background_refresh: float | None = None
    """Seconds between copies of a scene's background in the file, for viewers who join late. One copy for all frames if
    not given."""
    close_planes: bool = False
    """Let planes go on through holes of a scene's background that no depth camera saw into, such as the floor under a
    person who never moves. That surface is a guess: the file says how much of it there is. Openings stay open."""

    def __post_init__(self) -> None:
        for name, kind in self.__annotations__.items():
            value = getattr(self, name)
            if value is not None and kind.startswith(("int", "TextureSize")) and not isinstance(value, Integral):
                raise InputError(f"{name.replace('_', ' ')} {value!r}: give a whole number")
            if value is not None and kind.startswith("float") and not isinstance(value, Real):
                raise InputError(f"{name.replace('_', ' ')} {value!r}: give a number")
        for name, value, known in (
            ("preset", self.preset, PRESETS),
            ("effort", self.effort, EFFORTS),
            ("color", self.color, COLORS),
        ):
            if value not in known:
                raise InputError(f"no {name} is called {value!r}; known: {', '.join(known)}")
        for name, percent in (("quality", self.quality), ("color quality", self.color_quality)):
            if percent is not None and not 0 <= percent <= 100:
                raise InputError(f"{name} must be in 0 to 100, got {percent:g}")
        if self.centers is not None and self.centers > MOST_CENTERS:
            raise InputError(f"centers {self.centers}: give at most {MOST_CENTERS}")
        if self.background_refresh is not None and not 0 < self.background_refresh < math.inf:
            raise InputError(f"background refresh {self.background_refresh:g}: give seconds above 0")
        if self.dynamic_only and self.background_refresh is not None:
            raise InputError("dynamic only looks for no background: leave background refresh out")
        if self.dynamic_only and self.close_planes:
            raise InputError("dynamic only looks for no background: leave close planes out")
        self._check_preset()
        self._check_color()
        self.resolved()  # refuses what no option can have

    def _check_preset(self) -> None:
        """Raise InputError for what the preset does not have."""
        if self.preset == "best":
            if self.basis_size is not None:
                raise InputError(
                    f"basis size {self.basis_size}: preset `best` chooses the components; use preset `paper`"
                )
            if self.centers is not None:
                raise InputError(f"centers {self.centers}: preset `best` tracks none; use preset `paper`")
            return
        if self.effort != "normal":
            raise InputError(f"effort {self.effort}: preset `{self.preset}` has one effort; use preset `best`")
        if self.key_interval is not None:
            text = f"key interval {self.key_interval:g}: groups of preset `{self.preset}` all decode on their own"
            raise InputError(text)

    def _check_color(self) -> None:
        """Raise InputError for textures or splats of colours that are left out."""
        if (self.texture is not None or self.compatible) and self.color in ("vertices", "none"):
            given = f"texture {self.texture}" if self.texture is not None else "compatible"
            raise InputError(f"{given} and color {self.color!r}: there are no textures; leave one of both out")
        if self.splats is not None and self.color == "none":
            text = f"{self.splats} splats and color 'none': splats are fitted to colours"
            raise InputError(f"{text}; leave one of both out")

    def resolved(self) -> EncoderOptions:
        """Return the options of the encoder that follow from these choices."""
        quality = float(QUALITY if self.quality is None else self.quality)
        method = (
            layers_options(quality, self.effort)
            if self.preset == "best"
            else paper_options(quality, self.centers, self.basis_size, self.preset == "paper-literal")
        )
        if self.group_size is not None:
            method = replace(method, group_size=self.group_size)
        drawn = float(quality if self.color_quality is None else self.color_quality)
        appearance = appearance_options(drawn, self.color, self.texture, self.compatible, self.splats)
        scene = scene_options(quality)
        scene = replace(scene, refresh=self.background_refresh, close_planes=self.close_planes)
        options = EncoderOptions(method, None if self.dynamic_only else scene, appearance, quality=quality)
        return options if self.key_interval is None else replace(options, key_interval=self.key_interval)
