"""Folders of the data set SceneHub4D (the paper's Arena and Sitting): several cameras whose calibration is known.

`rgbd/cam0/rgb/<n>.png` and `rgbd/cam0/trans_depth/<n>_depth.png` (mm, as the colour camera sees them), cam1 and so on;
`camera_pose/extrinsics/*.npy` (4 x 4 a camera, world to camera), `intrinsics/*.json` (fx, fy, cx, cy and distortion).
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
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
from .takes import Pictures, Sensor, Stream, Take, lens_of, picture_size

KIND = "a SceneHub4D folder (rgbd/cam0/trans_depth, camera_pose, intrinsics)"
RATE = 30.0  # 1/s, of all its scenes
DEPTH, COLOR = "trans_depth", "rgb"
FOCAL = ("fx", "fy", "cx", "cy")
BENDS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")  # OpenCV's order
Bends = tuple[float, ...]  # the distortion of a lens, as many of `BENDS` as there are


def fits(path: Path) -> bool:
    return any((path / "rgbd").glob(f"cam*/{DEPTH}"))


def read(path: Path) -> Take:
    folders = sorted((path / "rgbd").glob("cam*"), key=lambda folder: last_number(folder.name) or 0)
    folders = [folder for folder in folders if (folder / DEPTH).is_dir()]
    poses, sensors = _poses(path, len(folders)), list[Sensor]()
    lenses = _lenses(_only(path, "intrinsics", "*.json"), len(folders))
    for folder, pose, (numbers, bends) in zip(folders, poses, lenses, strict=True):
        depth, color = _files(folder / DEPTH), _files(folder / COLOR)
        if not depth:
            raise InputError(f"{folder / DEPTH}: has no PNG whose name has a number; copy it again")
        width, height = picture_size(read_input(first := next(iter(depth.values()))), str(first))
        lens = lens_of(width, height, (numbers[0], numbers[1]), (numbers[2], numbers[3]), bends)
        seen = _stream(depth, lens, deep=True)
        beside = _stream(color, lens, deep=False) if color else None
        sensors.append(Sensor(folder.name, seen, color=beside, color_to_depth=np.eye(4), poses=pose[None]))
    return Take(path, KIND, tuple(sensors), f"write its intrinsics into {path / 'intrinsics'}")


def _only(path: Path, folder: str, pattern: str) -> Path:
    """Return the one file of a scene's calibration, which lies in its folder or beside it, where names tell scenes."""
    for place in (path / folder, path.parent / folder):
        found = sorted(place.glob(pattern))
        named = [file for file in found if path.resolve().name.lower() in file.stem.lower()]
        if len(found) == 1 or len(named) == 1:
            return (named or found)[0]
        if found:
            raise InputError(f"{place}: has {len(found)} files {pattern}; leave that of {path.name} alone there")
    raise InputError(f"{path / folder}: has no {pattern}, the calibration of its cameras; copy it there")


def _poses(path: Path, count: int) -> Float64[np.ndarray, "K 4 4"]:
    """Return the cameras' poses, camera to world, m."""
    file = _only(path, "camera_pose/extrinsics", "*.npy")
    try:
        given = np.load(io.BytesIO(read_input(file)), allow_pickle=False).astype(np.float64)
    except (ValueError, EOFError) as error:
        raise InputError(f"{file}: cannot be read ({error}); copy it again") from None
    if given.shape != (count, 4, 4):
        raise InputError(f"{file}: is an array {given.shape}, and there are {count} cameras, each with a 4 x 4")
    return inverses(given)


def _lenses(file: Path, count: int) -> list[tuple[list[float], Bends]]:
    """Return fx, fy, cx, cy and the distortion of each camera's colours."""
    found = list(_intrinsics(read_json(file, "copy it again"), ""))
    colored = [each for each in found if re.search("color|rgb", each[0])]
    found = colored or found
    found = found * count if len(found) == 1 else found
    if len(found) != count:
        raise InputError(f"{file}: has {len(found)} cameras with {', '.join(FOCAL)}, and there are {count} of pictures")
    return [(numbers, bends) for _, numbers, bends in found]


def _intrinsics(tree: Any, name: str, around: Bends = ()) -> Iterator[tuple[str, list[float], Bends]]:
    """Yield each group of intrinsics in a tree of JSON: the words above it, its numbers, and the nearest distortion."""
    tree = dict(enumerate(tree)) if isinstance(tree, list) else tree
    if not isinstance(tree, dict):
        return
    beside = (_bends(each) for key, each in tree.items() if "dist" in str(key).lower())
    bends = _bends(tree) or next(filter(None, beside), around)
    if all(isinstance(tree.get(key), int | float) for key in FOCAL):
        yield name.lower(), [float(tree[key]) for key in FOCAL], bends
        return
    for key, each in tree.items():
        yield from _intrinsics(each, f"{name} {key}", bends)


def _bends(tree: Any) -> Bends:
    """Return the distortion in a list of numbers, or in the values of k1, k2, p1 and so on; none where it has none."""
    if isinstance(tree, dict):
        tree = [tree.get(key, 0.0) for key in BENDS] if {"k1", "k2"} <= tree.keys() else []
    is_list = isinstance(tree, list) and len(tree) in (4, 5, 8) and all(isinstance(one, int | float) for one in tree)
    return tuple(map(float, tree)) if is_list and any(tree) else ()


def _files(folder: Path) -> dict[int, Path]:
    found = {number: file for file in folder.glob("*.png") if (number := last_number(file.stem)) is not None}
    return dict(sorted(found.items()))


def _stream(files: dict[int, Path], lens: Camera, *, deep: bool) -> Stream:
    def pictures() -> Pictures:
        for number, file in files.items():
            yield number / RATE, partial(read_depth if deep else read_input, file)

    seconds = (max(files) - min(files)) / RATE
    return Stream(lens.width, lens.height, len(files), seconds, lens, pictures)
