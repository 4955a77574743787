"""Films of `meshreel export`: their flags, and what is said of them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from ..container.reader import ReelReader
from ..errors import InputError, needed
from ..export.animated_file import ExportOptions
from ..export.film import BACKGROUND, Color, FilmOptions, export_film
from ..export.film_files import Written
from ..geometry.picture import TURNS, View
from ..geometry.threads import cores, threads
from ..types import Up
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
    camera: str | None = None
    """Where the camera is and what it looks at, six numbers with commas, as the player has and shares them; by default
    all is in view."""
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

    def options(self, reader: ReelReader, exported: ExportOptions) -> FilmOptions:
        """Return what was asked for. Raises InputError for what cannot be understood."""
        size = None if self.size is None else _size(self.size)
        view = None if self.camera is None else _view(self.camera, reader, exported.up or reader.up)
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


def _view(text: str, reader: ReelReader, up: Up) -> View:
    """Return the view of a player's camera, whose places are upright, relative to the file's origin."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 6 or not all(map(math.isfinite, numbers)) or numbers[:3] == numbers[3:]:
        raise InputError(f"--camera {text}: give two places, x,y,z,x,y,z: the camera's, and what it looks at")
    places: Sequence[Sequence[float]] = (
        np.array(numbers).reshape(2, 3) @ TURNS[up] + np.array(reader.header.origin)
    ).tolist()
    return View(tuple(places[0]), tuple(places[1]))
