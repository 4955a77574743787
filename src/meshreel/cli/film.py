"""Films of `meshreel export`: their flags, and what is said of them."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..container.reader import ReelReader
from ..errors import InputError, needed
from ..export.animated_file import ExportOptions
from ..export.film import BACKGROUND, Color, FilmOptions, export_film
from ..export.film_files import Written
from ..format.view import View
from ..geometry.threads import cores, threads
from .console import Common

TRANSPARENT = "transparent"


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Filming:
    """Flags of films."""

    size: str | None = None
    """Size of the pictures, as 1280x720; a GIF has 640x360 by default."""
    background: str | None = None
    """Colour behind the recording, as #20242a or white, or transparent (WebM, GIF, PNG); by default the dark one of the
    player."""
    view: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None
    """x,y,z of the camera and x,y,z of what it looks at, in metres as frames have them, and perhaps ,DEGREES of its
    field of view (45); by default the file's first view, or all of it."""
    turntable: Annotated[bool, Parameter(negative="")] = False
    """Let the camera go around once, from there."""
    seconds: float | None = None
    """Length: frames are repeated, or left out at the end, until it is reached."""
    fps: float | None = None
    """Pictures per second; by default one for each frame."""

    @property
    def given(self) -> str:
        """The first flag that was given; empty if none was."""
        return next((f"--{field.name}" for field in fields(self) if getattr(self, field.name) != field.default), "")

    def options(self, exported: ExportOptions) -> FilmOptions:
        """Return the options of a film, with those of every export. Raises InputError for a flag without a meaning."""
        size = None if self.size is None else _size(self.size)
        view = None if self.view is None else _view(self.view)
        background = BACKGROUND if self.background is None else _color(self.background)
        layers, only, up = exported.layers, exported.only, exported.up
        return FilmOptions(view, self.turntable, size, background, self.seconds, self.fps, layers, only, up)


def film(reader: ReelReader, target: Path, frames: range, options: FilmOptions, common: Common) -> Written:
    """Write a film with all cores, and show how far it is."""
    with common.stages("pictures") as progress, threads(cores()):
        return export_film(reader, target, frames, options, lambda done, all: progress("export", done, all))


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,5})[x×](\d{1,5})", text)
    if found is None:
        raise InputError(f"--size {text}: give width and height in pixels, as 1280x720")
    return int(found[1]), int(found[2])


def _color(text: str) -> Color | None:
    if text == TRANSPARENT:
        return None
    with needed("a background needs the extra `color`: pip install 'meshreel[color]'"):
        from PIL import ImageColor
    try:
        return ImageColor.getrgb(text)[:3]
    except ValueError:
        raise InputError(f"--background {text}: is no colour; give one as #20242a or white, or {TRANSPARENT}") from None


def _view(text: str) -> View:
    x, y, z, *target = numbers_of_view(text)
    return View((x, y, z), tuple(target[:3]), *target[3:])


def numbers_of_view(view: str) -> list[float]:
    """Return the six or seven numbers of a flag --view. Raises InputError for anything else."""
    try:
        numbers = [float(number) for number in view.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (6, 7):
        raise InputError(f"--view {view!r}: give six numbers with commas, as 0,1.6,3,0,1,0; a seventh may be degrees")
    return numbers
