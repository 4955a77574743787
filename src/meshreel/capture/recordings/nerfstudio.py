"""Folders of nerfstudio's form with depth, as Polycam's, Record3D's and Stray Scanner's recordings are converted to.

`transforms.json` has the lens (`fl_x fl_y cx cy w h k1 k2 p1 p2 k3`, of all, or alike in each), and for each frame
`file_path`, `depth_file_path` and `transform_matrix` (camera to world, x right, y up, z backward), at `time` s or one
after the other. Depth is in steps of `integer_depth_scale` (or `depth_unit_scale_factor`) m, 0.001 if neither is there:
https://docs.nerf.studio/quickstart/data_conventions.html.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from ...geometry.cameras import Camera
from ...io.files import read_file, read_input
from ...io.pictures import last_number, read_depth
from ...texts import json_of
from .takes import FLIP, Poses, Sensor, Take, lens_of, stream_of

KIND = "a nerfstudio folder with depth (transforms.json)"
ABOUT = "transforms.json"
LENS = ("fl_x", "fl_y", "cx", "cy", "w", "h")
BENDS = ("k1", "k2", "p1", "p2", "k3")
MODELS = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL")
SCALES = ("integer_depth_scale", "depth_unit_scale_factor")  # of instant-ngp, and of sdfstudio
RATE = 30.0  # 1/s, where frames have no times
SAME = 0.01  # share by which lenses of frames may differ: autofocus moves phones' by less (guess)


def fits(path: Path) -> bool:
    return (path / ABOUT).is_file()


def read(path: Path) -> Take:
    about = json_of(read_file(path / ABOUT))
    given = about.get("frames") if isinstance(about, dict) else None
    if not isinstance(given, list) or not all(isinstance(one, dict) for one in given):
        raise ValueError(f"{ABOUT} has no list `frames` of objects")
    frames = [one for one in given if "depth_file_path" in one]
    if not frames:
        raise ValueError(f"no frame of {ABOUT} has a depth_file_path; convert the recording with depth")
    for number, one in enumerate(frames):
        for name in ("file_path", "depth_file_path"):
            if not isinstance(one.get(name), str):
                raise ValueError(f"frame {number} of {ABOUT}: {name} is {one.get(name)!r:.40} and no text")
    model = about.get("camera_model", "OPENCV")
    if model not in MODELS:
        raise ValueError(f"{ABOUT} has the camera_model {model}; undistort the pictures, or give {', '.join(MODELS)}")
    rate = _number(about, "fps", RATE)
    if rate <= 0:
        raise ValueError(f"fps of {ABOUT} is {rate:g}: give a number above 0")
    frames.sort(key=_order)
    lenses = np.array([_numbers(about | one) for one in frames])
    apart = np.abs(lenses - lenses[0]) > SAME * np.maximum(np.abs(lenses[0]), 1)
    if apart.any():
        which, names = int(apart.any(axis=1).argmax()), (*LENS, *BENDS)
        name, was, now = next(
            (n, *v) for n, far, *v in zip(names, apart[which], lenses[0], lenses[which], strict=True) if far
        )
        text = f"{name} of {ABOUT} is {now:g} in {frames[which]['file_path']} and {was:g} in {frames[0]['file_path']}"
        raise ValueError(f"{text}, over {SAME:.0%} apart; convert those of each lens alone")
    times = [_number(one, "time", number / rate) for number, one in enumerate(frames)]
    poses = Poses(np.stack([_matrix(one) for one in frames]) @ FLIP, np.array(times))
    unit = next((_number(about, name, 0.0) for name in SCALES if name in about), 0.001)
    deep = [(time, path / one["depth_file_path"]) for time, one in zip(times, frames, strict=True)]
    color = [(time, path / one["file_path"]) for time, one in zip(times, frames, strict=True)]
    lens = partial(_lens, about | frames[len(frames) // 2])
    sensor = Sensor(
        "camera",
        stream_of(deep, lens, read_depth),
        unit,
        stream_of(color, lens, read_input) if any(file.is_file() for _, file in color) else None,
        np.eye(4),
        poses,
    )
    return Take(path, KIND, (sensor,), f"write fl_x fl_y cx cy w h into {path / ABOUT}")


def _order(frame: Mapping[str, Any]) -> tuple[float, int, str]:
    """Return a frame's time and the number in its name, by which frames are sorted."""
    name = str(frame["file_path"])
    return _number(frame, "time", 0.0), last_number(Path(name).stem) or 0, name


def _number(record: Mapping[str, Any], name: str, default: float) -> float:
    """Return a number of a record. Raises ValueError where it is none, or not finite."""
    value = record.get(name, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < 1e12:
        where = f" in {record['file_path']}" if "file_path" in record else ""
        raise ValueError(f"{name} of {ABOUT} is {value!r:.40}{where}; give a number")
    return float(value)


def _matrix(frame: Mapping[str, Any]) -> Float64[np.ndarray, "4 4"]:
    rows = frame.get("transform_matrix")
    with suppress(ValueError, TypeError, OverflowError):
        if (matrix := np.array(rows, np.float64)).shape == (4, 4):
            return matrix
    raise ValueError(f"transform_matrix of {frame['file_path']} is {rows!r:.40}; give 4 rows of 4 numbers")


def _numbers(about: Mapping[str, Any]) -> tuple[float, ...]:
    """Return focal lengths, center, size and distortion; none where the lens is not known."""
    if not all(name in about for name in LENS):
        return ()
    return (*(_number(about, name, 0.0) for name in LENS), *(_number(about, name, 0.0) for name in BENDS))


def _lens(about: Mapping[str, Any], width: int, height: int) -> Camera | None:
    if not (numbers := _numbers(about)):
        return None
    fx, fy, cx, cy, across, down = numbers[:6]
    if min(across, down) < 1:
        raise ValueError(f"{ABOUT} has pictures of {across:g} x {down:g}: give w and h in pixels")
    return lens_of(int(across), int(down), (fx, fy), (cx - 0.5, cy - 0.5), numbers[6:]).resized(width, height)
