"""`meshreel cut`, `concat`, `retime`, `transform` and `tag`: edits of .reel files without encoding again."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from .. import edit
from ..edit.edits import Edited
from ..errors import InputError
from ..io.files import Place, located
from ..texts import json_of
from ..types import Up
from .console import Common, Flag
from .film import numbers_of_view

File = Annotated[str, Parameter(help="The .reel file; it may be a URL (extra `remote`).")]
Output = Annotated[
    str, Parameter(name=["--output", "-o"], help="The .reel file to write, when it is complete; or a URL.")
]


def cut(file: File, /, *, output: Output, frames: str, keys: Flag = False, common: Common = Common()) -> None:
    """Write some frames of a .reel file; nothing is encoded again.

    Parameters
    ----------
    frames
        Frames to keep, as A:B with B excluded. Other frames of their groups stay in the file, hidden.
    keys
        Cut only where frames decode alone, at or before A and at or behind B, so that no frame is hidden.
    """
    done = edit.cut(file, _checked(output), frames, keys)
    if done.hidden:
        text = f"{done.hidden} hidden frames that the others are coded with are in it, too (--keys cuts without any)"
        common.warn([f"{output}: {text}"])
    _tell(_checked(output), done, common)


def concat(inputs: list[str], /, *, output: Output, common: Common = Common()) -> None:
    """Join .reel files one after the other; nothing is encoded again.

    Parameters
    ----------
    inputs
        The files in the order of their frames, encoded with one --survey and the same options, or cut from one file.
        They may be URLs (extra `remote`).
    """
    place = _checked(output)
    joined = edit.concat(inputs, place)
    if joined.missing:
        total = joined.frames + joined.missing
        common.warn((f"{place}: {joined.missing} of the sequence's {total} frames are in none of the files",))
    if joined.differing:
        text = "differ among the files; those of the first that has them are kept, and meshreel tag gives others"
        common.warn([f"{place}: tags {', '.join(joined.differing)} {text}"])
    row = {"output": str(place), "frames": joined.frames, "bytes": joined.size, "files": len(inputs)}
    common.result(row, f"{place}: {joined.frames} frames of {len(inputs)} files, {joined.size} bytes")


def retime(
    file: File, /, *, output: Output, fps: float | None = None, speed: float | None = None, common: Common = Common()
) -> None:
    """Write a .reel file that plays at another frame rate or speed, without audio; nothing is encoded again.

    Parameters
    ----------
    fps
        Frames per second, evenly.
    speed
        Factor of the speed: 0.5 plays half as fast.
    """
    done = edit.retime(file, _checked(output), fps, speed)
    if done.lost_audio:
        text = "its audio is left out, which would be out of step; meshreel tag --audio adds one of the new speed"
        common.warn([f"{output}: {text}"])
    _tell(_checked(output), done, common)


def transform(
    file: File,
    /,
    *,
    output: Output,
    scale: float = 1.0,
    rotate: tuple[float, float, float] = (0.0, 0.0, 0.0),
    translate: tuple[float, float, float] = (0.0, 0.0, 0.0),
    up: Annotated[Up | None, Parameter(allow_leading_hyphen=True)] = None,
    common: Common = Common(),
) -> None:
    """Write a .reel file in another place, size or orientation; nothing is encoded again.

    Parameters
    ----------
    scale
        Factor about the world's origin, as 0.001 for a file that was made from millimetres.
    rotate
        Degrees about x, then y, then z of the world. Players and readers before this version refuse the file.
    translate
        Metres along x, y and z, after that.
    up
        Axis that points up, for players and exports; it moves nothing.
    """
    turn = np.eye(3)
    for axis, angle in enumerate(np.radians(rotate)):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        step = np.eye(3)
        step[first, first] = step[second, second] = np.cos(angle)
        step[first, second], step[second, first] = -np.sin(angle), np.sin(angle)
        turn = step @ turn
    done = edit.transform(file, _checked(output), scale, turn if any(rotate) else None, translate, up)
    _tell(_checked(output), done, common)


def tag(
    file: File,
    values: Annotated[list[str] | None, Parameter(negative="")] = None,
    /,
    *,
    output: Output,
    audio: str | None = None,
    audio_start: float | None = None,
    no_audio: Annotated[bool, Parameter(negative="")] = False,
    view: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    common: Common = Common(),
) -> None:
    """Write a .reel file with other metadata, which `meshreel info` shows, other audio or another first view.

    Parameters
    ----------
    values
        NAME=VALUE, as title="A walk" or take=3 (numbers, true, false and JSON are taken as such); NAME= takes it away.
    audio
        An audio file that players play with the frames, in place of one that is there: Opus, AAC or MP3, kept as it is.
    audio_start
        Seconds from the first frame to the beginning of the audio, also of one that is there; below 0, that much of it
        is left out.
    no_audio
        Take the audio away.
    view
        View that players begin with: x,y,z of the camera and x,y,z of what it looks at, in metres as frames have them,
        and perhaps ,DEGREES of its field of view (45). The player's menu copies it.
    """
    if no_audio and (audio, audio_start) != (None, None):
        raise InputError("--no-audio takes away what --audio and --audio-start are for; give one of them")
    tags: dict[str, Any] = {}
    for value in values or []:
        name, sign, text = value.partition("=")
        if not sign:
            raise InputError(f"{value!r}: give NAME=VALUE, as title=Walk")
        try:
            tags[name] = json_of(text) if text else None
        except ValueError:
            tags[name] = text
    sound, numbers = b"" if no_audio else audio, None if view is None else numbers_of_view(view)
    done = edit.tag(file, _checked(output), tags, audio=sound, audio_start=audio_start, view=numbers)
    _tell(_checked(output), done, common)


def _checked(output: str) -> Place:
    place = located(output)
    if place.suffix != ".reel":
        raise InputError(f"{output}: the output must end in .reel")
    return place


def _tell(place: Place, done: Edited, common: Common) -> None:
    row = {"output": str(place), "frames": done.frames, "hidden": done.hidden, "bytes": done.size}
    common.result(row, f"{place}: {done.frames} frames, {done.size} bytes")
