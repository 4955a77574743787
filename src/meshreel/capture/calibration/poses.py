"""Poses of cameras from other programs' files: COLMAP, OpenCV, caliscope, anipose, ROS and other rigs.

A file -> camera names with 4 x 4 matrices from camera (x right, y down, z forward) to world, in the file's unit.
"""

from __future__ import annotations

import json
import re
import struct
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from ...errors import InputError, needed
from ...geometry import strict
from ...geometry.cameras import Matrix
from ...io.files import read_input, read_json
from ...io.pictures import last_number
from ...texts import json_of, toml_of, yaml_of
from ..rig.cameras import posed
from ..rig.rig import RIG, Rig

_OTHERS = "caliscope's .toml, tf_static as .yaml or .json, or a rig.json"
FORMS = f"COLMAP's images.txt or images.bin, OpenCV's .yml, {_OTHERS}"
_TURNS, _SHIFTS = ("Rot", "R", "rvec"), ("T", "t", "tvec")  # OpenCV's names of matrices, before `_` and a camera's name
_DAMAGED = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, struct.error)


def read_poses(path: Path) -> dict[str, Matrix]:
    """Read the poses in a file, whose name tells the form, or in COLMAP's folder. Raises InputError for none."""
    if path.is_dir():
        path = next((p for p in (path / "images.bin", path / "images.txt") if p.exists()), path / "images.bin")
    read = _READERS.get(path.suffix.lower())
    if read is None:
        raise InputError(f"{path}: {path.suffix or 'no'} extension is of no file of poses; give {FORMS}")
    data = read_input(path)
    try:
        poses = {str(name): np.array(pose, dtype=np.float64) for name, pose in read(data).items()}
        if not poses:
            raise ValueError("has no poses of cameras")
        for name, pose in poses.items():
            if pose.shape != (4, 4) or not np.isfinite(pose).all():
                raise ValueError(f"the pose of {name} is not 4 x 4 finite numbers")
    except _DAMAGED as error:
        text = f"{error} is missing" if isinstance(error, KeyError) else error
        raise InputError(f"{path}: cannot be read ({text}); give {FORMS}") from None
    return poses


def pose_for(name: str, poses: Mapping[str, Matrix], kind: str) -> Matrix | None:
    """Return the pose of the camera with a name, None where there is none.

    In a file it may go on after the name, as in left/00001.png and left_depth_optical_frame; of those, `kind` (color or
    depth) picks. A number alone is that at the end of a camera's name. Raises InputError where several are left.
    """
    if name in poses:
        return poses[name]
    found = [key for key in poses if re.match(re.escape(name) + r"[/_.\-]", key)]
    found = [key for key in found if kind in key] or found
    found = found or [key for key in poses if key.isdecimal() and last_number(name) == last_number(key)]
    if len(found) > 1:
        raise InputError(f"several poses may be of camera {name}: {', '.join(found)}; leave one of them in the file")
    return poses[found[0]] if found else None


def mean_pose(poses: Iterable[Matrix]) -> Matrix:
    """Return the mean of poses; of more than two, those far from most do not count."""
    stack = np.array(list(poses))
    if len(stack) > 2:
        apart = np.abs(stack[:, None] - stack[None]).sum(axis=(2, 3))
        middle = apart[int(np.median(apart, axis=1).argmin())]
        stack = stack[middle <= 3 * max(float(np.median(middle)), 1e-9)]  # guess
    mean = stack.mean(axis=0)
    mean[:3, :3] = strict.nearest_rotations(mean[None, :3, :3])[0][0]
    return mean


def pose_of(turns: Any, shifts: Any) -> Float64[np.ndarray, "*T 4 4"]:
    """Return matrices of rotations (3 x 3, quaternions x y z w, or vectors) and translations. Raises ValueError."""
    from scipy.spatial.transform import Rotation

    numbers, places = np.asarray(turns, np.float64), np.asarray(shifts, np.float64)
    if numbers.shape[-2:] != (3, 3):
        read = Rotation.from_quat if numbers.shape[-1] == 4 else Rotation.from_rotvec
        numbers = read(numbers).as_matrix()
    poses = np.zeros((*places.shape[:-1], 4, 4))
    poses[..., :3, :3], poses[..., :3, 3], poses[..., 3, 3] = numbers, places, 1.0
    return poses


def poses_between(
    known: Float64[np.ndarray, " K"], poses: Float64[np.ndarray, "K 4 4"], times: Float64[np.ndarray, " T"]
) -> Float64[np.ndarray, "T 4 4"]:
    """Return the poses at times between those that are known, ascending; before and after, the first and the last."""
    from scipy.spatial.transform import Rotation, Slerp

    found, inside = np.repeat(poses[:1], len(times), axis=0), np.clip(times, known[0], known[-1])
    if len(known) > 1:
        found[:, :3, :3] = Slerp(known, Rotation.from_matrix(poses[:, :3, :3]))(inside).as_matrix()
        found[:, :3, 3] = np.stack([np.interp(inside, known, poses[:, axis, 3]) for axis in range(3)], axis=1)
    return found


def turns_between(
    first: Float64[np.ndarray, "T 4 4"], second: Float64[np.ndarray, "T 4 4"]
) -> Float64[np.ndarray, " T"]:
    """Return the angles between the rotations of poses, degrees."""
    cosines = (np.einsum("tij,tij->t", first[:, :3, :3], second[:, :3, :3]) - 1) / 2
    return np.degrees(np.arccos(np.clip(cosines, -1, 1)))


def pose_in_root(above: Mapping[str, tuple[str, Matrix]], frame: str) -> tuple[str, Matrix]:
    """Return a frame's root and its pose there; `above`: parent and pose of each. Raises ValueError for a circle."""
    pose = np.eye(4)
    for _ in range(len(above) + 1):
        if frame not in above:
            return frame, pose
        frame, step = above[frame]
        pose = strict.products(step, pose)
    raise ValueError(f"frame {frame} hangs on itself")


def _seen_from(turn: Any, shift: Any) -> Matrix:
    """Return the camera-to-world matrix of a world-to-camera rotation and translation."""
    return strict.inverse(pose_of(turn, shift))


def _colmap_text(data: bytes) -> dict[str, Matrix]:
    lines = [line for line in data.decode().splitlines() if not line.startswith("#")]
    rows = [line.split(maxsplit=9) for line in lines[::2] if line.strip()]  # every second one has points
    return _colmap((row[9], [float(number) for number in row[1:8]]) for row in rows)


def _colmap_binary(data: bytes) -> dict[str, Matrix]:
    found, offset = [], 8
    for _ in range(struct.unpack_from("<Q", data)[0]):
        _, *numbers, _ = struct.unpack_from("<I7dI", data, offset)
        end = data.index(b"\0", offset + 64)
        found.append((data[offset + 64 : end].decode(), numbers))
        offset = end + 9 + 24 * struct.unpack_from("<Q", data, end + 1)[0]
    return _colmap(found)


def _colmap(images: Iterable[tuple[str, list[float]]]) -> dict[str, Matrix]:
    """Return the poses of cameras: the mean over the images of a folder, or that of an image by its own name."""
    groups = defaultdict(list)
    for name, numbers in images:
        folder, _, stem = name.replace("\\", "/").rpartition("/")
        groups[folder or Path(stem).stem].append(_seen_from(np.roll(numbers[:4], -1), numbers[4:]))
    return {name: mean_pose(poses) for name, poses in groups.items()}


def _toml(data: bytes) -> dict[str, Matrix]:
    """Parse caliscope's [cameras.0], or anipose's [cam_0] with a name."""
    record = toml_of(data)
    tables = {name: table for name, table in record.get("cameras", record).items() if isinstance(table, dict)}
    posed = {name: table for name, table in tables.items() if {"rotation", "translation"} <= table.keys()}
    return {t.get("name", name): _seen_from(t["rotation"], t["translation"]) for name, t in posed.items()}


def _yaml(data: bytes) -> dict[str, Matrix]:
    """Parse YAML of OpenCV's FileStorage, or of `ros2 topic echo /tf_static`."""
    with needed("YAML needs the extra `calibrate`: pip install 'meshreel[calibrate]'"):
        records = [record for record in yaml_of(data) if isinstance(record, dict)]
    if any("transforms" in record for record in records):
        return _transforms([one for record in records for one in record.get("transforms", [])])
    return _opencv({key: value for record in records for key, value in record.items()})


def _opencv(record: dict[str, Any]) -> dict[str, Matrix]:
    """Return poses of matrices R_left and T_left for each camera left, or of lists rvecs, Ts and cam_ids."""
    matrices = {key: value["data"] for key, value in record.items() if isinstance(value, dict) and "data" in value}
    if "rvecs" in matrices and "Ts" in matrices:
        turns, shifts = (np.reshape(matrices[key], (-1, 3)) for key in ("rvecs", "Ts"))
        names = str(record["cam_ids"]).split(",") if "cam_ids" in record else range(len(turns))
        return {str(name): _seen_from(*pose) for name, *pose in zip(names, turns, shifts, strict=True)}
    found = {}
    for key, shift in matrices.items():
        kind, _, name = key.partition("_")
        named = [f"{turn}_{name}" for turn in _TURNS if f"{turn}_{name}" in matrices]
        if kind in _SHIFTS and name and named:
            turn = matrices[named[0]]
            found[name] = _seen_from(turn if len(turn) == 3 else np.reshape(turn, (3, 3)), shift)
    return found


def _json(data: bytes) -> dict[str, Any]:
    record = json_of(data)
    if "transforms" in record:
        return _transforms(record["transforms"])
    return {camera["name"]: camera["camera_to_world"] for camera in record["cameras"]}


def _transforms(records: list[dict[str, Any]]) -> dict[str, Matrix]:
    """Return the poses of optical frames, or of all frames where none is named so, in the frame at the root of each."""
    above = {}
    for record in records:
        shift, turn = record["transform"]["translation"], record["transform"]["rotation"]
        pose = pose_of([turn[axis] for axis in "xyzw"], [shift[axis] for axis in "xyz"])
        above[record["child_frame_id"].strip("/")] = (record["header"]["frame_id"].strip("/"), pose)
    optical = [frame for frame in above if frame.endswith("optical_frame")]
    return {frame: pose_in_root(above, frame)[1] for frame in optical or above}


_READERS = {".txt": _colmap_text, ".bin": _colmap_binary, ".yml": _yaml, ".yaml": _yaml, ".toml": _toml, ".json": _json}


def with_poses(rig: Rig, depth: Mapping[str, Matrix], color: Mapping[str, Matrix]) -> Rig:
    """Return a rig with other poses, by the names of depth cameras and of colour cameras; others stay."""
    eyes, cameras, motions = {eye.beside: eye for eye in rig.color_cameras}, [], []
    for number, camera in enumerate(rig.cameras):
        pose = depth.get(camera.name, camera.view.pose.to_world)
        if (eye := eyes.get(number)) is not None and eye.name in color:
            pose = strict.products(color[eye.name], strict.products(strict.inverse(eye.view.pose.to_world), pose))
        cameras.append(posed(camera, pose))
        motions.append(strict.products(pose, strict.inverse(camera.view.pose.to_world)))
    colors = []
    for eye in rig.color_cameras:
        pose = color.get(eye.name, eye.view.pose.to_world)
        if eye.beside is not None:
            pose = strict.products(motions[eye.beside], eye.view.pose.to_world)
        colors.append(posed(eye, pose))
    return replace(rig, cameras=tuple(cameras), color_cameras=tuple(colors))


def posed_by(rig: Rig, poses: Mapping[str, Matrix], kind: str, where: Path) -> tuple[Rig, list[str]]:
    """Return a rig with a file's poses of its depth or colour cameras (`kind`), and warnings. Raises InputError."""
    names = [camera.name for camera in (rig.cameras if kind == "depth" else rig.color_cameras)]
    if not names:
        raise InputError(f"{rig.folder}: has no {kind} cameras, whose poses {where} is said to have; check --poses-of")
    try:
        found = {name: pose for name in names if (pose := pose_for(name, poses, kind)) is not None}
        posed = with_poses(rig, *((found, {}) if kind == "depth" else ({}, found)))
    except InputError as error:  # of a pose that is no camera's, or of one name for several
        raise InputError(f"{where}: {error}") from None
    if not found:
        text = f"has poses of {', '.join(list(poses)[:8])} and of none of the {kind} cameras {', '.join(names)}"
        raise InputError(f"{where}: {text}; name them alike in {RIG}")
    lost = [name for name in names if name not in found]
    return posed, [f"{where}: has no pose of {', '.join(lost)}, which stay where they were"] if lost else []


def described(rig: Rig) -> bytes:
    """Return the rig's description, `rig.json`, with its poses; all else is as in the file."""
    record = read_json(rig.folder / RIG, "give JSON")
    entries = record["cameras"]
    for entry, camera in zip(entries, rig.cameras, strict=True):
        entry["camera_to_world"] = camera.view.pose.to_world.tolist()
    alone = iter(record.get("color_cameras", []))
    for eye in rig.color_cameras:
        entry = next(alone) if eye.beside is None else entries[eye.beside]["color"]
        if isinstance(entry, dict) and "camera_to_world" in entry:
            entry["camera_to_world"] = eye.view.pose.to_world.tolist()
    return (json.dumps(record, indent=1) + "\n").encode()
