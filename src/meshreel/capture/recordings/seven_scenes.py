"""Folders of the 7-scenes data set, and others in its form: a picture of depth, one in colour and a pose a frame.

`frame-000000.depth.png` (mm, 65535: none), `.color.png` or `.jpg`, `.pose.txt` (camera to world, m), and the depth
camera's numbers in `camera-intrinsics.txt`, K as 3 x 3. Colour is taken to lie on depth, a frame to be 1/30 s:
https://www.microsoft.com/en-us/research/project/rgb-d-dataset-7-scenes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float64

from ...errors import InputError
from ...geometry.cameras import Camera
from ...io.files import read_input
from ...io.pictures import last_number, read_depth
from .takes import Poses, Sensor, Stream, Take, lens_of, reading, stream_of

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
    numbers = _matrix(path / NUMBERS, 3) if (path / NUMBERS).is_file() else None
    seen = _stream(deep, numbers, True)
    beside = _stream(color, None if seen.lens is None else seen.lens, False) if color else None
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


def _stream(files: dict[int, Path], numbers: Camera | Float64[np.ndarray, "3 3"] | None, deep: bool) -> Stream:
    def lens(width: int, height: int) -> Camera | None:
        if numbers is None or isinstance(numbers, Camera):
            return numbers and numbers.resized(width, height)
        return lens_of(width, height, (numbers[0, 0], numbers[1, 1]), (numbers[0, 2], numbers[1, 2]))

    return stream_of([(number / RATE, file) for number, file in files.items()], lens, _depth if deep else read_input)


def _depth(path: Path) -> np.ndarray:
    depth = read_depth(path)
    return np.where(depth == NONE, 0, depth)
