"""What Blender needs of a .reel file: arrays of one frame in its axes, and pictures and audio as files.

Knows nothing of Blender.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import meshreel
from meshreel.io.pictures import pack_picture
from meshreel.io.write import make_folder, write_file

# From the recording's axes to Blender's, where z points up: rows of x, y and z of Blender.
AXES = {
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
}
WHOLE = ""  # the name of all parts together
NOWHERE = -1.0  # the places of corners that no texture covers
ENDINGS = {"audio/ogg": "ogg", "audio/webm": "webm", "audio/mp4": "m4a", "audio/aac": "aac", "audio/mpeg": "mp3"}
OPEN = 8  # files that stay open
CLOSE = 1e-5  # s: times in files are whole microseconds


@dataclass(frozen=True)
class Arrays:
    """A mesh as flat arrays, as `foreach_set` takes them."""

    places: np.ndarray  # 3 V float32, m, z up
    corners: np.ndarray  # 3 F int32, numbers of vertices
    starts: np.ndarray  # F int32, the first corner of each face
    colors: np.ndarray | None  # 4 V float32, sRGB with opacity, 0 to 1
    uv: np.ndarray | None = None  # 6 F float32, right and up, of each corner; NOWHERE without a texture


@lru_cache(maxsize=OPEN)
def opened(path: str) -> Any:
    """Return the video of a file, which stays open. Raises meshreel.MeshreelError where it cannot be read."""
    return meshreel.open(path)


@lru_cache(maxsize=OPEN)
def times_of(video: Any) -> list[float]:
    """Return when each frame of a video is shown, s, counted from the first."""
    times: list[float] = video.timestamps
    return [time - times[0] for time in times]


def frame_of(video: Any, scene_frame: int, start: int, scene_rate: float) -> int:
    """Return the number of the video's frame that is shown in a frame of a scene, by time; the ends hold."""
    return max(bisect_right(times_of(video), (scene_frame - start) / scene_rate + CLOSE) - 1, 0)


def scene_frames(video: Any, scene_rate: float) -> int:
    """Return how many frames of a scene the whole video takes."""
    return max(1, round(video.duration * scene_rate))


def parts_of(video: Any) -> list[str]:
    """Return the names of the parts that are objects of their own: each may have a texture, or else there is one."""
    return [*video.parts(0)] if video.reader.has_textures else [WHOLE]


def write_textures(video: Any, part: str, folder: Path) -> list[Path]:
    """Write a PNG for each frame of a part's texture; none where it never has one. Frames without keep the last."""
    if all(video.parts(number)[part].texture is None for number in range(len(video))):
        return []
    make_folder(folder)
    written, shown, data = list[Path](), None, pack_picture(np.zeros((1, 1, 3), np.uint8))
    for number in range(len(video)):
        texture = video.parts(number)[part].texture
        if texture is not None and texture is not shown:
            shown, data = texture, pack_picture(texture.pixels)
        written.append(folder / f"{part.replace(' ', '_')}_{number:05}.png")
        write_file(written[-1], data)
    return written


def write_audio(video: Any, path: Path) -> tuple[Path, float] | None:
    """Write the audio file beside a video; return its path and when it begins, s after the first frame."""
    audio = video.audio
    if audio is None:
        return None
    written = path.with_name(f"{path.stem}_audio.{ENDINGS[audio.media_type]}")
    write_file(written, audio.data)
    return written, audio.start


def arrays_of(video: Any, number: int, part: str = WHOLE) -> Arrays:
    """Return a part of a frame, or bodies and background together."""
    mesh = video[number] if part == WHOLE else video.parts(number)[part]
    places = mesh.vertices @ np.array(AXES[video.up], np.float64).T
    colors = None
    if mesh.colors is not None:
        colors = np.ones((len(mesh.vertices), 4), np.float32)
        colors[:, :3] = mesh.colors / 255
    faces = np.ascontiguousarray(mesh.faces, np.int32)
    return Arrays(
        places.astype(np.float32).reshape(-1),
        faces.reshape(-1),
        np.arange(0, 3 * len(faces), 3, dtype=np.int32),
        None if colors is None else colors.reshape(-1),
        None if mesh.uv is None or part == WHOLE else np.nan_to_num(mesh.uv, nan=NOWHERE).reshape(-1),
    )
