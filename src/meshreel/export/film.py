"""Export of a .reel file to a film of pictures, as the player shows it: MP4, WebM or GIF; or to one picture, PNG.

In: a reader, frames, a view. Out: a file, in which each picture is drawn by `geometry.picture`.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..container.reader import ReelReader
from ..decoder.tracks import moving_of_frame
from ..decoder.video import Video
from ..errors import InputError
from ..format.view import View
from ..geometry.picture import Body, Standing, Viewpoint, draw_picture, finished
from ..shapes import UInt8
from ..types import Up
from .film_files import GIF_RATE, VIDEOS, Film, Written, write_film
from .frames import Part
from .shapes import check_output

Color = tuple[int, ...]  # red, green and blue, 0 to 255
BACKGROUND: Color = (20, 23, 28)  # the player's, where it is dark
SIZE, GIF_SIZE = (1280, 720), (640, 360)  # pixels (guess)
SIDES = (16, 8192)  # pixels, of a side: encoders and the rasteriser take these
MOST_PICTURES = 100_000  # an hour at 25/s (guess)
ROUNDED = 1e-6  # s: times of .reel files are whole microseconds


@dataclass(frozen=True, slots=True)
class FilmOptions:
    """Viewpoint, size and times of a film."""

    view: View | None = None  # in the unit of the vertices; None: the file's first view, or all of it
    turntable: bool = False  # the camera goes around once, from there
    size: tuple[int, int] | None = None  # pixels, width and height; None: `SIZE`, and of a GIF `GIF_SIZE`
    background: Color | None = BACKGROUND  # None: transparent
    seconds: float | None = None  # length: frames are repeated, or left out at the end; None: that of the frames
    rate: float | None = None  # pictures per second; None: one for each frame
    layers: int | None = None  # largest number of layers of each group beyond its first; None: all
    only: Part = "all"
    up: Up | None = None  # axis of the meshes that points up in the pictures; None: as the .reel file says

    def __post_init__(self) -> None:
        for side in self.size or ():
            if not SIDES[0] <= side <= SIDES[1]:
                raise InputError(f"a picture of {side} pixels: give {SIDES[0]} to {SIDES[1]} on each side")
        for name, value in (("seconds", self.seconds), ("pictures a second", self.rate)):
            if value is not None and not 0 < value < math.inf:
                raise InputError(f"{value:g} {name}: give a number above 0")
        if self.view is not None and not self.view.is_valid:
            text = f"view from {self.view.position} to {self.view.target}, {self.view.fov:g} degrees"
            raise InputError(f"{text}: both places are one or too far away, or no degrees from 0 to 180; give others")


def export_film(
    reader: ReelReader,
    path: Path,
    frames: range,
    options: FilmOptions = FilmOptions(),
    progress: Callable[[int, int], None] = lambda *_: None,
) -> Written:
    """Write frames to a .mp4, .webm or .gif file, or the first of them to a .png file.

    The file appears when it is complete. Raises InputError if the format cannot hold the pictures or the file cannot be
    written, and FormatError if a chunk is damaged.
    """
    check_output(path)
    video, kind = Video(reader, options.layers), path.suffix.lower()
    size = options.size or (GIF_SIZE if kind == ".gif" else SIZE)
    _check(path, kind, size, options)
    standing = Standing(video.box, options.up or video.up)
    given = options.view or reader.view
    view = Viewpoint(given.position, given.target, given.fov) if given else standing.fitted(*size)
    if options.view is None and given:
        view = standing.framed(view, *size)
    times, shown = _times(reader, frames[:1] if kind == ".png" else frames, options, kind)

    def bodies(frame: int) -> list[Body]:
        moving = [] if options.only == "background" else moving_of_frame(video.tracks, frame)
        still = [] if options.only == "moving" else [video.background(frame)]
        parts = [Body.of_track(mesh, number) for number, mesh in enumerate(moving)]
        for number, track in enumerate(video.tracks[: len(parts)]):
            if (splats := track.splats(frame)) is not None:
                parts[number] = replace(parts[number], splats=splats, patches=track.patches(frame))
        return [*parts, *map(Body.behind, still)]

    @lru_cache(maxsize=1)
    def drawn(frame: int, share: float) -> UInt8[np.ndarray, "H W C"]:
        is_bare = options.only == "background" or reader.static_of_frame(frame) is not None
        parts = bodies(frame)
        is_bare |= any(part.splats is not None for part in parts)  # splats cast no shadow, as in the player
        has_ground = not is_bare and not (kind == ".gif" and options.background is None)  # where nothing is half dark
        seen = view.turned(share, standing.up)
        return finished(draw_picture(parts, standing, seen, size, has_ground), options.background)

    def picture(number: int) -> UInt8[np.ndarray, "H W C"]:
        return drawn(shown[number], times[number] / times[-1] if options.turntable else 0.0)

    audio, start = video.audio if kind in VIDEOS else None, reader.timestamp(frames.start) - reader.timestamp(0)
    rate = options.rate or video.frame_rate
    return write_film(Film(picture, options.background is None, times, size, rate, audio, start), path, progress)


def _check(path: Path, kind: str, size: tuple[int, int], options: FilmOptions) -> None:
    width, height = size
    if kind in VIDEOS and (width % 2 or height % 2):
        text = f"{path}: a size of {width} x {height}, and videos have even ones"
        raise InputError(f"{text}; give {width + width % 2} x {height + height % 2}")
    if kind == ".mp4" and options.background is None:
        raise InputError(f"{path}: MP4 has no transparency; give a colour, or write .webm or .gif")
    if kind == ".gif" and (options.rate or 0) > GIF_RATE:
        raise InputError(f"{path}: {options.rate:g} pictures a second, and a GIF has {GIF_RATE} at most; give fewer")


def _times(reader: ReelReader, frames: range, options: FilmOptions, kind: str) -> tuple[list[float], list[int]]:
    """Return the times of the pictures, followed by that of the end, s, and the frame that each picture shows."""
    ends = [reader.timestamp(frame) for frame in range(reader.frame_count)]
    ends.append(ends[0] + reader.duration)
    stamps = [ends[frame] - ends[frames.start] for frame in frames]
    clip = ends[frames.stop] - ends[frames.start]
    length, rate = options.seconds or clip, options.rate
    if kind == ".gif" and len(stamps) > GIF_RATE * clip:
        rate = rate or GIF_RATE
    if (count := length * (rate or len(stamps) / clip)) > MOST_PICTURES:
        raise InputError(f"a film of {count:.0f} pictures: {MOST_PICTURES} at most; give fewer seconds or frames")
    if rate is None:
        times = [loop * clip + stamp for loop in range(math.ceil(length / clip)) for stamp in stamps]
        times = [time for time in times if time < length - ROUNDED]
    else:
        times = [number / rate for number in range(max(1, round(count)))]
    return [*times, length], [frames[bisect_right(stamps, (time + ROUNDED) % clip) - 1] for time in times]
