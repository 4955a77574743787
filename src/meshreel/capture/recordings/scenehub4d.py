"""Folders of the data set SceneHub4D (the paper's Arena and Sitting): several cameras whose calibration is known.

`rgbd/cam0/rgb/<n>.png` and `rgbd/cam0/trans_depth/<n>_depth.png` (mm, as the colour camera sees them), cam1 and so on;
`camera_pose/extrinsics/*.npy` (4 x 4 a camera, world to camera), `intrinsics/*.json` (fx, fy, cx, cy and distortion).
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from ...errors import InputError
from ...geometry.cameras import Camera
from ...geometry.strict import inverses
from ...io.files import read_input, read_json
from ...io.pictures import last_number, read_depth
from .takes import Pictures, Poses, Sensor, Stream, Take, lens_of, picture_size

KIND = "a SceneHub4D folder (rgbd/cam0/trans_depth, camera_pose, intrinsics)"
RATE = 30.0  # 1/s, of all its scenes, where camera_config names none
DEPTH, COLOR = "trans_depth", "rgb"
FOCAL = ("fx", "fy", "cx", "cy")
BENDS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")  # OpenCV's order
Bends = tuple[float, ...]  # the distortion of a lens, as many of `BENDS` as there are


def fits(path: Path) -> bool:
    return any((path / "rgbd").glob(f"cam*/{DEPTH}"))


def read(path: Path) -> Take:
    folders = sorted((path / "rgbd").glob("cam*"), key=lambda folder: last_number(folder.name) or 0)
    folders = [folder for folder in folders if (folder / DEPTH).is_dir()]
    file, sensors = _only(path, "intrinsics", "*.json"), list[Sensor]()
    calibration = read_json(file, "copy it again")
    rate, lenses = _rate(calibration), _lenses(file, calibration, [folder.name for folder in folders])
    for folder, pose, (numbers, bends) in zip(folders, _poses(path, folders), lenses, strict=True):
        depth, color = _files(folder / DEPTH), _files(folder / COLOR)
        if not depth:
            raise InputError(f"{folder / DEPTH}: has no PNG whose name has a number; copy it again")
        width, height = picture_size(read_input(first := next(iter(depth.values()))), str(first))
        lens = lens_of(width, height, (numbers[0], numbers[1]), (numbers[2], numbers[3]), bends)
        seen = _stream(depth, lens, rate, deep=True)
        beside = _stream(color, lens, rate, deep=False) if color else None
        sensors.append(Sensor(folder.name, seen, color=beside, color_to_depth=np.eye(4), poses=Poses(pose[None])))
    return Take(path, KIND, tuple(sensors), f"write its intrinsics into {path / 'intrinsics'}")


def _only(path: Path, folder: str, pattern: str) -> Path:
    """Return the file of a scene's calibration, in its folder, or beside it, where the name tells the scene."""
    named = path.resolve().name.lower()
    for place in (path / folder, path.parent / folder):
        files = sorted(place.glob(pattern))
        own = [file for file in files if named in file.stem.lower()]
        if len(own) == 1 or (len(files) == 1 and place == path / folder):
            return (own or files)[0]
        if files:
            raise InputError(
                f"{place}: has {len(files)} files {pattern}, {len(own)} of {path.name}; leave one of it there"
            )
    raise InputError(f"{path / folder}: has no {pattern}, the calibration of its cameras; copy it there")


def _rate(calibration: dict[str, Any]) -> float:
    """Return the pictures a second that the cameras' settings name, or those of the data set."""
    settings = calibration.get("camera_config")
    rate = settings.get("fps") if isinstance(settings, dict) else None
    return float(rate) if isinstance(rate, int | float) and 0 < rate < 1000 else RATE


def _poses(path: Path, folders: Sequence[Path]) -> Float64[np.ndarray, "K 4 4"]:
    """Return the cameras' poses, camera to world, m."""
    file = _only(path, "camera_pose/extrinsics", "*.npy")
    try:
        given = np.asarray(np.lib.format.read_array(io.BytesIO(read_input(file)), allow_pickle=False), np.float64)
    except (ValueError, TypeError, EOFError, OSError) as error:
        raise InputError(f"{file}: cannot be read ({error}); copy it again") from None
    if given.shape != (len(folders), 4, 4):
        names = ", ".join(folder.name for folder in folders)
        text = f"is an array {given.shape}, and there are {len(folders)} cameras ({names}), each with a 4 x 4"
        raise InputError(f"{file}: {text}; copy the missing folders, or leave its rows out")
    poses = inverses(given)
    if not (np.isfinite(given).all() and np.isfinite(poses).all()):
        number = int(np.argmin(np.isfinite(given + poses).all(axis=(1, 2))))
        raise InputError(f"{file}: the matrix of {folders[number].name} is no pose; calibrate it again")
    return poses


def _lenses(file: Path, calibration: dict[str, Any], names: Sequence[str]) -> list[tuple[list[float], Bends]]:
    """Return fx, fy, cx, cy and the distortion of each camera's colours."""
    groups = list(_intrinsics(calibration, ""))
    groups = [each for each in groups if re.search("color|rgb", each[0])] or groups
    if len(groups) == 1:
        groups = groups * len(names)
    if len(groups) != len(names):
        text = f"has {len(groups)} cameras with {', '.join(FOCAL)}, and there are {len(names)} of pictures"
        raise InputError(f"{file}: {text}; give one for each of {', '.join(names)}, or one for all")
    of_names = [
        [each for each in groups if {name.lower(), str(last_number(name))} & {*each[0].split()}] for name in names
    ]
    if all(len(own) == 1 for own in of_names):  # else in their order
        groups = [own[0] for own in of_names]
    bends = [_checked(file, name, each[2]) for name, each in zip(names, groups, strict=True)]
    return [(each[1], own) for each, own in zip(groups, bends, strict=True)]


def _checked(file: Path, name: str, bends: Bends | None) -> Bends:
    """Return a distortion as `lens_of` takes it. Raises InputError for one of another length."""
    bends = () if bends is None or not any(bends) else bends
    while len(bends) > len(BENDS) and not bends[-1]:  # of thin prisms and tilts, which are none
        bends = bends[:-1]
    if len(bends) not in (0, 4, 5, 8):
        text = f"the distortion of {name} has {len(bends)} numbers"
        raise InputError(f"{file}: {text}; give 4, 5 or 8, as OpenCV has them: {', '.join(BENDS)}")
    return bends


def _intrinsics(tree: Any, name: str, around: Bends | None = None) -> Iterator[tuple[str, list[float], Bends | None]]:
    """Yield each group of intrinsics in a tree of JSON: the words above it, its numbers, and the nearest distortion."""
    tree = dict(enumerate(tree)) if isinstance(tree, list) else tree
    if not isinstance(tree, dict):
        return
    beside = (_bends(each) for key, each in tree.items() if "dist" in str(key).lower())
    own = [_bends(tree), *beside]
    bends = next((one for one in own if one is not None), around)
    if all(_is_number(tree.get(key)) for key in FOCAL):
        yield name.lower(), [float(tree[key]) for key in FOCAL], bends
        return
    for key, each in tree.items():
        yield from _intrinsics(each, f"{name} {key}", bends)


def _bends(tree: Any) -> Bends | None:
    """Return the distortion in a list of numbers, or in the values of k1, k2, p1 and so on; None where it has none."""
    if isinstance(tree, dict):
        tree = [tree.get(key, 0.0) for key in BENDS] if {"k1", "k2"} <= tree.keys() else []
    if isinstance(tree, list) and len(tree) == 1 and isinstance(tree[0], list):  # as OpenCV writes rows
        [tree] = tree
    is_list = isinstance(tree, list) and len(tree) > 0 and all(map(_is_number, tree))
    return tuple(map(float, tree)) if is_list else None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _files(folder: Path) -> dict[int, Path]:
    files = {number: file for file in folder.glob("*.png") if (number := last_number(file.stem)) is not None}
    return dict(sorted(files.items()))


def _stream(files: dict[int, Path], lens: Camera, rate: float, *, deep: bool) -> Stream:
    def pictures() -> Pictures:
        for number, file in files.items():
            yield number / rate, partial(read_depth if deep else read_input, file)

    seconds = (max(files) - min(files)) / rate
    return Stream(lens.width, lens.height, len(files), seconds, lens, pictures)
