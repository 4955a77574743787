"""A rig: depth cameras around a scene, which stand still or move on known paths, and what they recorded.

A folder with `camera.json` and `depth/` is a rig of one camera. Pictures of different cameras belong to one frame if
their file names have the same number, or numbers.
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64, UInt16

from ...errors import InputError
from ...geometry.cameras import Camera, CameraPose, Matrix
from ...geometry.color_views import ColorPicture
from ...geometry.depth import DepthPicture
from ...io.file_names import Order, gaps
from ...io.files import read_json
from ...io.pictures import read_depth
from ...io.write import make_folder, write_file
from ...types import UP_AXES, UPS, Up
from .cameras import C, ColorCamera, DepthCamera, Key, at_frame, check_size, distortion_of, pictures_in, placed

RIG, SINGLE = "rig.json", "camera.json"
POSES = "poses.json"  # of a camera that moves, in its folder
POSE_DIGITS = 9  # of its numbers: more differ between machines, whose sines are not the same to the last bit
LOOKED_AT = 12  # frames examined for movement and for what stands still, spread over the recording (guess)
RATES = (1e-9, 1e9)  # 1/s, the range of a sequence of meshes
_TEXTS = ("name", "depth", "poses")
_NUMBERS = ("width", "height", "fx", "fy", "cx", "cy", "depth_unit_m", "depth_min_m", "depth_max_m")
_UPRIGHT = 0.5  # least cosine between an axis and the pictures' mean upward direction (guess)
_SEE = "see `meshreel capture --help`"


@dataclass(frozen=True, slots=True)
class Rig:
    """Cameras of a rig, with the depth pictures of each by frame number."""

    folder: Path
    cameras: tuple[DepthCamera, ...]
    files: tuple[dict[int, Path], ...]  # of each camera
    frame_rate: float  # 1/s
    remarks: tuple[str, ...] = ()  # warnings about the description, for the user
    color_cameras: tuple[ColorCamera, ...] = ()
    paths: Mapping[str, Path] = field(default_factory=dict)  # files with the poses of cameras that move, by name

    @property
    def up(self) -> Up:
        """The axis nearest to upward in the cameras' pictures: y, z, -y or -z; y where none is near."""
        stands = [camera.path.values() or [camera.view.pose] for camera in self.cameras]
        mean = np.mean([np.mean([-pose.to_world[:3, 1] for pose in each], axis=0) for each in stands], axis=0)
        along = {axis: float(mean @ UP_AXES[axis]) for axis in UPS}
        best = max(along, key=along.__getitem__)
        return best if along[best] > _UPRIGHT else "y"

    @property
    def frames(self) -> list[int]:
        """Sorted numbers of the frames that at least one camera has."""
        return sorted(set().union(*self.files))

    def depth_pictures(self, frame: int) -> list[DepthPicture | None]:
        """Read a frame's depths; None for a camera without it. Raises InputError where a picture has another size."""
        cameras = enumerate(self.cameras)
        return [
            at_frame(camera, frame).picture(self.depth(k, frame)) if frame in self.files[k] else None
            for k, camera in cameras
        ]

    def color_pictures(self, frame: int) -> list[ColorPicture | None]:
        """Read a frame's pictures of the colour cameras, as `depth_pictures` does those of depth."""
        return [camera.picture(frame) for camera in self.color_cameras]

    def depth(self, number: int, frame: int) -> UInt16[np.ndarray, "H W"]:
        """Read the depths of one camera, by its number, in a frame that it has; depths out of its range are 0."""
        camera, path = self.cameras[number], self.files[number][frame]
        depth = read_depth(path)
        check_size(path, depth, camera)
        return camera.in_range(depth)

    def looked_at(self, number: int) -> list[Float64[np.ndarray, "H W"]]:
        """Return depths of a camera, m, from frames spread evenly over its recording; 0 is no measurement."""
        frames = sorted(self.files[number])
        chosen = sorted({frames[int(k)] for k in np.linspace(0, len(frames) - 1, LOOKED_AT)})
        return [self.depth(number, frame) * self.cameras[number].depth_unit for frame in chosen]

    def blind(self, number: int, seen: Sequence[Float64[np.ndarray, "H W"]]) -> list[str]:
        """Return a warning if a camera measures nothing in some of the depths `looked_at`."""
        blind, name = sum(not depth.any() for depth in seen), self.cameras[number].name
        return [f"camera {name} measures nothing in {blind} of {len(seen)} frames looked at"] if blind else []

    def missing(self) -> list[str]:
        """Return a warning for each camera that lacks frames, and one for frames that no camera has."""
        frames, warnings = self.frames, []
        for camera, files in zip(self.cameras, self.files, strict=True):
            if lost := sorted(set(frames) - set(files)):
                text = f"camera {camera.name} lacks {len(lost)} of {len(frames)} frames, for example {lost[0]}"
                warnings.append(f"{text}; they are fused without it")
        return [*warnings, *gaps(self.folder, frames)]


def read_rig(folder: Path, order: Order = "auto") -> Rig:
    """Read the rig in a folder. Raises InputError where its description or pictures are missing or wrong."""
    entries, cameras, rate, alone = _described(folder)
    folders = [folder / str(e.get("depth", f"{c.name}/depth")) for e, c in zip(entries, cameras, strict=True)]
    keyed = [pictures_in(place, camera.name, "depth", order) for place, camera in zip(folders, cameras, strict=True)]
    beside = [number for number, entry in enumerate(entries) if "color" in entry]
    colors = [_color_camera(folder, entries[k]["color"], cameras[k].record(), k) for k in beside]
    colors += [_color_camera(folder, entry, {"name": f"color{number}"}, None) for number, entry in enumerate(alone)]
    keyed += [pictures_in(place, camera.name, "color", order) for camera, place in colors]
    files = _numbered(folder, keyed)
    seen = tuple(replace(each, files=of) for (each, _), of in zip(colors, files[len(cameras) :], strict=True))
    cameras = tuple(_moving(folder, *each) for each in zip(entries, cameras, files, strict=False))
    described = [_beside(folder, entries[number]) for number in beside]
    described += [entry if isinstance(entry, dict) else {} for entry in alone]
    seen = tuple(_moving(folder, entry, each, each.files) for entry, each in zip(described, seen, strict=True))
    names = [camera.name for camera in cameras] + [camera.name for camera in seen]
    named = zip(names, (*entries, *described), strict=True)
    paths = {name: folder / entry["poses"] for name, entry in named if "poses" in entry}
    own = [entry["poses"] for entry in entries if "poses" in entry]
    if twice := next((name for name in own if own.count(name) > 1), None):
        raise InputError(f"{folder / RIG}: two cameras have the poses {twice}; give each camera a file of its own")
    rig = Rig(folder, cameras, files[: len(cameras)], rate, tuple(_unknown(folder, entries)), seen, paths)
    for camera in seen:
        camera.picture(min(camera.files))  # an error of its size is told before anything else is done
        if odd := set(camera.files) ^ set(rig.frames):
            counts = f"{len(camera.files)} color pictures for {len(rig.frames)} frames of depth"
            one = next(files[min(odd)] for files in (*rig.files, camera.files) if min(odd) in files)
            text = f"{folder}: camera {camera.name} has {counts}; only one of both has frame {min(odd)}"
            raise InputError(f"{text}: {one} stands alone; give every frame a picture of its number, and no others")
    return rig


def _beside(folder: Path, entry: dict[str, Any]) -> dict[str, Any]:
    """Return the entry of the colour camera beside a depth camera, which moves as that does unless it says how."""
    color = entry["color"] if isinstance(entry["color"], dict) else {}
    if "poses" in entry and "poses" not in color and "camera_to_world" in color:
        text = f"{folder / RIG}: camera {entry.get('name', '')} moves by {entry['poses']}, its color stands still"
        raise InputError(f"{text}; give poses of both, or leave out camera_to_world of color")
    return color if "poses" in color else {key: entry[key] for key in ("poses",) if key in entry}


def _moving(folder: Path, entry: dict[str, Any], camera: C, files: Mapping[int, Path] | None = None) -> C:
    """Return a camera with its pose in each frame where its entry has poses; by default in all that are there.

    Raises InputError for a picture without a pose.
    """
    if "poses" not in entry:
        return camera
    path = folder / str(entry["poses"])
    known = read_path(path)
    if lost := sorted(set(known if files is None else files) - known.keys()):
        text = f"{path}: has no pose of camera {camera.name} in {len(lost)} of {len(files or ())} frames"
        raise InputError(
            f"{text}, as {lost[0]}: {(files or {})[lost[0]]}; give one for each picture, or leave these out"
        )
    found = dict[int, CameraPose]()
    for frame in sorted(known if files is None else files):
        try:
            found[frame] = placed(camera.name, known[frame])
        except InputError as error:
            raise InputError(f"{path}: frame {frame}: {error}") from None
    return replace(camera, path=found, view=replace(camera.view, pose=found[min(found)]))


def read_path(path: Path) -> dict[int, Matrix]:
    """Read the poses of a camera by frame, camera to world. Raises InputError where the file has none, or others."""
    record = read_json(path, "give JSON").get("camera_to_world")
    if not isinstance(record, dict) or not record or not all(map(str.isdecimal, record)):
        raise InputError(f"{path}: has no object `camera_to_world`; give 4 rows of 4 numbers for each frame's number")
    found = dict[int, Matrix]()
    for frame, rows in record.items():
        try:
            found[int(frame)] = _matrix({"camera_to_world": rows})
        except InputError as error:
            raise InputError(f"{path}: frame {frame}: {error}") from None
    return found


def packed_path(path: Mapping[int, Matrix]) -> bytes:
    """Return the poses of a camera by frame, camera to world, as a file that `poses` of a camera names."""
    rows = (
        f"{json.dumps(str(frame))}: {json.dumps(np.round(path[frame], POSE_DIGITS).tolist())}" for frame in sorted(path)
    )
    return ('{"camera_to_world": {\n' + ",\n".join(rows) + "\n}}\n").encode()


def _numbered(folder: Path, keyed: list[dict[Key, Path]]) -> tuple[dict[int, Path], ...]:
    """Return pictures by the number that is their key, or else by the place of their key among those of all folders."""
    keys = sorted(set[Key]().union(*keyed))
    if len({len(key) for key in keys}) > 1:
        ordered = sorted(keyed, key=lambda files: len(next(iter(files))))
        names = " and ".join(str(next(iter(each.values())).relative_to(folder)) for each in (ordered[-1], ordered[0]))
        raise InputError(f"{folder}: pictures sort by several numbers and by one, as {names}; name them alike")
    whole = all(isinstance(key[0], Fraction) and key[0].denominator == len(key) == 1 for key in keys)
    numbers = {key: int(key[0]) if whole else place for place, key in enumerate(keys)}
    return tuple({numbers[key]: path for key, path in files.items()} for files in keyed)


def read_cameras(folder: Path) -> tuple[tuple[DepthCamera, ...], float]:
    """Read the cameras that a folder describes, and their frame rate, 1/s; their pictures may be missing."""
    entries, cameras, rate, _ = _described(folder)
    return tuple(_moving(folder, *pair) for pair in zip(entries, cameras, strict=True)), rate


def _described(folder: Path) -> tuple[list[Any], tuple[DepthCamera, ...], float, list[Any]]:
    """Read a description: its entry per camera, the cameras, their frame rate, 1/s, and entries of further cameras."""
    path, single = folder / RIG, folder / SINGLE
    if path.exists():
        record = read_json(path, "give JSON")
        entries = record.get("cameras")
        if not isinstance(entries, list) or not entries:
            raise InputError(f"{path}: has no list `cameras`; describe one camera at least")
    elif single.exists():
        path = single
        record = read_json(path, "give JSON")
        color = {"color": "color"} if (folder / "color").is_dir() else {}
        entries = [{"name": folder.resolve().name, "depth": "depth"} | color | record]
    else:
        if not folder.exists():
            raise InputError(f"{folder}: no such file or folder; check the path")
        text = f"{folder}: {'' if folder.is_dir() else 'is no folder and '}has neither {RIG} nor {SINGLE}"
        raise InputError(f"{text}; describe its cameras in one, or make a rig of a recording with meshreel capture")
    rate = record.get("frames_per_second")
    if isinstance(rate, bool) or not isinstance(rate, (int, float)) or not RATES[0] <= rate <= RATES[1]:
        raise InputError(f"{path}: frames_per_second is {rate!r:.40}; give a number from {RATES[0]:g} to {RATES[1]:g}")
    cameras = tuple(_camera(path, f"number {number}", entry) for number, entry in enumerate(entries))
    names = [camera.name for camera in cameras]
    if len(set(names)) < len(names):
        raise InputError(f"{path}: two cameras have one name ({', '.join(names)}); name each differently")
    alone = record.get("color_cameras", [])
    if not isinstance(alone, list):
        raise InputError(f"{path}: color_cameras is {alone!r:.40} and not a list; {_SEE}")
    return entries, cameras, float(rate), alone


def write_rig(
    folder: Path, cameras: tuple[DepthCamera, ...], frame_rate: float, colors: Sequence[dict[str, Any] | None] = ()
) -> None:
    """Write `rig.json`, and the poses of depth cameras that move into files beside their pictures.

    `colors` describe the colour cameras beside the first of the cameras, None where is none.
    """
    entries = [camera.record() | {"depth": f"{camera.name}/depth"} for camera in cameras]
    for entry, camera in zip(entries, cameras, strict=True):
        if camera.path:
            entry["poses"] = f"{camera.name}/{POSES}"
            path = {frame: pose.to_world for frame, pose in camera.path.items()}
            make_folder(folder / camera.name)
            write_file(folder / camera.name / POSES, packed_path(path))
    for entry, color in zip(entries, colors, strict=False):
        entry |= {} if color is None else {"color": color}
    text = json.dumps({"frames_per_second": frame_rate, "cameras": entries}, indent=1) + "\n"
    write_file(folder / RIG, text.encode())


def _camera(path: Path, label: str, entry: Any) -> DepthCamera:
    try:
        if not isinstance(entry, dict):
            raise InputError(f"is {entry!r:.40} and not an object")
        for key in _TEXTS:
            if not isinstance(entry.get(key, ""), str):
                raise InputError(f"{key} is {entry[key]!r:.40}; give text")
        given = {"depth_unit_m": 0.001, "depth_min_m": 0.1, "depth_max_m": 10.0} | entry
        width, height, fx, fy, cx, cy, unit, near, far = (_number(given, key) for key in _NUMBERS)
        if not (width.is_integer() and height.is_integer()):
            raise InputError(f"pictures of {width:g} x {height:g}; give whole numbers of pixels")
        to_world = np.eye(4) if "poses" in given else _matrix(given)
    except InputError as error:
        raise InputError(f"{path}: camera {label} is not described: {error}; {_SEE}") from None
    try:
        name = entry.get("name", label.replace("number ", "camera"))
        center, pose = (cx + 0.5, cy + 0.5), placed(name, to_world)
        return DepthCamera(name, Camera(int(width), int(height), (fx, fy), center, pose), unit, (near, far))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _number(entry: dict[str, Any], key: str) -> float:
    value = entry.get(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"{key} is {value!r:.40} and not a number" if key in entry else f"it has no {key}")
    try:
        return float(value)
    except OverflowError:  # whole numbers in JSON may have any size
        return math.inf


def _matrix(entry: dict[str, Any]) -> Matrix:
    """Return the matrix of an entry; its shape is checked here, its numbers by `placed`."""
    if "camera_to_world" not in entry:
        raise InputError("it has no camera_to_world")
    try:
        pose = np.array(entry["camera_to_world"], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError("camera_to_world is not 4 rows of 4 numbers") from None
    if pose.shape != (4, 4):
        name = entry.get("name", "")
        raise InputError(f"camera {name}: camera_to_world has the shape {pose.shape}; give 4 rows of 4 numbers")
    return pose


def _unknown(folder: Path, entries: list[Any]) -> Iterator[str]:
    """Yield a warning about unknown keys of cameras: a misspelt key would silently leave a default in place."""
    known = {*_TEXTS, *_NUMBERS, "camera_to_world", "frames_per_second", "color", "color_cameras"}
    found = dict.fromkeys(key for entry in entries for key in entry if key not in known)
    near = [(key, difflib.get_close_matches(key, known, 1)) for key in found]
    if near:
        keys = ", ".join(key + (f" (is {other[0]} meant?)" if other else "") for key, other in near)
        yield f"{folder}: unknown keys describe cameras and are ignored: {keys}"


def _color_camera(folder: Path, entry: Any, beside: dict[str, Any], number: int | None) -> tuple[ColorCamera, Path]:
    """Return the camera of a folder or an object, else as `beside` has it, and the folder of its pictures."""
    path, given = folder / RIG, {"folder": entry} if isinstance(entry, str) else entry
    if not isinstance(given, dict):
        raise InputError(f"{path}: color of camera {beside['name']} is {entry!r:.40}; give a folder or an object")
    one = beside | given
    label = f"{beside['name']} of colour" if number is None else f"{number} of color_cameras"
    camera = _camera(path, label, {key: one[key] for key in one if key not in ("folder", "distortion")})
    try:
        place, distortion = one.get("folder"), distortion_of(one)
        if not isinstance(place, str):
            raise InputError(f"color camera {camera.name} has no folder; name that of its pictures")
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return ColorCamera(camera.name, replace(camera.view, distortion=distortion), {}, number), folder / place
