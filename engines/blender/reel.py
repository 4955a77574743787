"""What Blender needs of a .reel file: arrays of one frame, in its axes. Knows nothing of Blender."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

import meshreel

# From the recording's axes to Blender's, where z points up: rows of x, y and z of Blender.
AXES = {
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
}
OPEN = 8  # files that stay open
CLOSE = 1e-5  # s: times in files are whole microseconds


@dataclass(frozen=True)
class Arrays:
    """A mesh as flat arrays, as `foreach_set` takes them."""

    places: np.ndarray  # 3 V float32, m, z up
    corners: np.ndarray  # 3 F int32, numbers of vertices
    starts: np.ndarray  # F int32, the first corner of each face
    colors: np.ndarray | None  # 4 V float32, sRGB with opacity, 0 to 1


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


def arrays_of(video: Any, number: int) -> Arrays:
    """Return a frame: bodies and background together."""
    mesh = video[number]
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
    )
