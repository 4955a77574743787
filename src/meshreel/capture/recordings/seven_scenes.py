"""Folders of the 7-scenes data set, and others in its form: a picture of depth, one in colour and a pose a frame.

`frame-000000.depth.png` (mm, 65535: none), `.color.png` or `.jpg`, `.pose.txt` (camera to world, m), and the depth
camera's numbers in `camera-intrinsics.txt`, K as 3 x 3. Colour is taken to lie on depth, a frame to be 1/30 s:
https://www.microsoft.com/en-us/research/project/rgb-d-dataset-7-scenes.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from ...errors import InputError
from ...geometry.cameras import Camera
from ...io.files import read_input
from ...io.pictures import last_number, read_depth
from .takes import Poses, Sensor, Take, lens_of, reading, stream_of

KIND = "a folder of 7-scenes (frame-000000.depth.png, .color.png, .pose.txt)"
NUMBERS = "camera-intrinsics.txt"
NONE = 65535  # of a depth picture
RATE = 30.0  # 1/s, of a Kinect


def fits(path: Path) -> bool:
    return path.is_dir() and next(path.glob("frame-*.pose.txt"), None) is not None


def read(path: Path) -> Take:
    turns, deep, color = (_by_number(path, kind) for kind in ("pose.txt", "depth.png", "color.*"))
    if not deep:
        raise ValueError("it has no frame-000000.depth.png and so on")
    poses = Poses(np.stack([_matrix(file, 4) for file in turns.values()]), np.array(list(turns)) / RATE)
    seen = stream_of(_timed(deep), partial(_lens, path / NUMBERS), _depth)
    beside = None
    if color:
        beside = stream_of(_timed(color), lambda *size: seen.lens and seen.lens.resized(*size), read_input)
    sensor = Sensor("camera", seen, 0.001, beside, np.eye(4), poses)
    return Take(path, KIND, (sensor,), f"write K of the depth camera, 3 x 3 numbers, into {path / NUMBERS}")


def _by_number(path: Path, kind: str) -> dict[int, Path]:
    """Return the files of a kind by their frames, in order."""
    files = {last_number(file.name.split(".")[0]): file for file in sorted(path.glob(f"frame-*.{kind}"))}
    return {number: files[number] for number in sorted(number for number in files if number is not None)}


def _matrix(path: Path, side: int) -> Float64[np.ndarray, "N N"]:
    """Return the numbers in a file. Raises InputError for other than `side` rows of as many."""
    with reading(path):
        numbers = np.array(read_input(path).decode().split(), np.float64)
    if numbers.size != side * side:
        raise InputError(f"{path}: has {numbers.size} numbers; give {side} rows of {side}")
    return numbers.reshape(side, side)


def _timed(files: dict[int, Path]) -> list[tuple[float, Path]]:
    """Return files with the times of their frames, s."""
    return [(number / RATE, file) for number, file in files.items()]


def _lens(path: Path, width: int, height: int) -> Camera | None:
    """Return the lens that a file describes, None without the file."""
    if not path.is_file():
        return None
    numbers = _matrix(path, 3)
    return lens_of(width, height, (numbers[0, 0], numbers[1, 1]), (numbers[0, 2], numbers[1, 2]))


def _depth(path: Path) -> np.ndarray:
    depth = read_depth(path)
    return np.where(depth == NONE, 0, depth)
