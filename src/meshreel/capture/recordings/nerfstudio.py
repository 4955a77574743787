"""Folders of nerfstudio's form with depth, as Polycam's, Record3D's and Stray Scanner's recordings are converted to.

`transforms.json` has the lens (`fl_x fl_y cx cy w h k1 k2 p1 p2 k3`, of all frames or of each), and for each frame
`file_path`, `depth_file_path` and `transform_matrix` (camera to world, x right, y up, z backward), at `time` s or one
after the other. Depth is in steps of `integer_depth_scale` (or `depth_unit_scale_factor`) m, 0.001 if neither is there:
https://docs.nerf.studio/quickstart/data_conventions.html.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...geometry.cameras import Camera
from ...io.files import read_file, read_input
from ...io.pictures import last_number, read_depth
from ...texts import json_of
from .takes import Poses, Sensor, Stream, Take, lens_of, stream_of

KIND = "a nerfstudio folder with depth (transforms.json)"
ABOUT = "transforms.json"
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])  # from x right, y down, z forward to OpenGL's x right, y up, z backward
BENDS = ("k1", "k2", "p1", "p2", "k3")
MODELS = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL")
SCALES = ("integer_depth_scale", "depth_unit_scale_factor")
RATE = 30.0  # 1/s, where frames have no times


def fits(path: Path) -> bool:
    return (path / ABOUT).is_file()


def read(path: Path) -> Take:
    about = json_of(read_file(path / ABOUT))
    frames = sorted((one for one in about["frames"] if "depth_file_path" in one), key=_order)
    if not frames:
        raise ValueError(f"no frame of {ABOUT} has a depth_file_path; convert the recording with depth")
    model = about.get("camera_model", "OPENCV")
    if model not in MODELS:
        raise ValueError(f"{ABOUT} has the camera_model {model}; undistort the pictures, or give {', '.join(MODELS)}")
    if len({_numbers(about | one)[2:] for one in frames}) > 1:
        raise ValueError(f"frames of {ABOUT} have lenses of several sizes or distortions; convert them apart")
    times = [float(one.get("time", number / float(about.get("fps", RATE)))) for number, one in enumerate(frames)]
    matrices = np.array([one["transform_matrix"] for one in frames], np.float64).reshape(-1, 4, 4) @ FLIP
    unit = next((float(about[name]) for name in SCALES if name in about), 0.001)
    deep = [(time, path / one["depth_file_path"]) for time, one in zip(times, frames, strict=True)]
    color = [(time, path / one["file_path"]) for time, one in zip(times, frames, strict=True)]
    sensor = Sensor(
        "camera",
        _stream(deep, about | frames[0], True),
        unit,
        _stream(color, about | frames[0], False),
        np.eye(4),
        Poses(matrices, np.array(times)),
    )
    return Take(path, KIND, (sensor,), f"write fl_x fl_y cx cy w h into {path / ABOUT}")


def _order(frame: Mapping[str, Any]) -> tuple[float, int, str]:
    """Return a frame's time and the number in its name, by which frames are sorted."""
    name = str(frame["file_path"])
    return float(frame.get("time", 0.0)), last_number(Path(name).stem) or 0, name


def _numbers(about: Mapping[str, Any]) -> tuple[float, ...]:
    """Return focal lengths, center, size and distortion; none where the lens is not known."""
    names = ("fl_x", "fl_y", "cx", "cy", "w", "h")
    if not all(name in about for name in names):
        return ()
    return tuple(float(about[name]) for name in names) + tuple(float(about.get(name, 0.0)) for name in BENDS)


def _stream(files: list[tuple[float, Path]], about: Mapping[str, Any], deep: bool) -> Stream:
    def lens(width: int, height: int) -> Camera | None:
        if not (numbers := _numbers(about)):
            return None
        fx, fy, cx, cy, across, down = numbers[:6]
        given = lens_of(int(across), int(down), (fx, fy), (cx - 0.5, cy - 0.5), numbers[6:])
        return given.resized(width, height)

    return stream_of(files, lens, read_depth if deep else read_input)
