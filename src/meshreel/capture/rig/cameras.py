"""Cameras of a rig, for depth and for colour, and the entries of `rig.json` that describe them.

In `rig.json` the middles of pixels are whole numbers: `cx` and `cy` are half a pixel less than a Camera's center.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from jaxtyping import UInt16

from ...errors import InputError
from ...geometry.cameras import Camera, CameraPose, Matrix, broken
from ...geometry.color_views import ColorPicture
from ...geometry.depth import DepthPicture
from ...io.file_names import Order, frame_keys
from ...io.pictures import read_picture

PICTURES = {"depth": (".png",), "color": (".png", ".jpg", ".jpeg", ".webp", ".bmp")}
MOST_DISTORTION = 10.0  # of a coefficient: beyond, the picture would fold many times (guess)
MOST_PIXELS = 16_384  # of a picture's side (guess)
FARTHEST = 1e4  # m from the world's origin: fusion has 32-bit coordinates, which are 1 mm apart there (guess)
_MOST_UNIT, _FARTHEST = 1e3, 1e4  # m, of a unit of depth, and of a range (guesses)
FOCAL = (0.05, 100.0)  # in sides of the picture; a focal length outside is not in pixels (guess)
AWAY = 10.0  # sides by which a cropped picture may lie beside its optical axis (guess)
C = TypeVar("C", "DepthCamera", "ColorCamera")
Key = tuple[str | Fraction, ...]  # of a frame, equal in all folders of a rig


@dataclass(frozen=True, slots=True)
class DepthCamera:
    """A camera that measures depth along its optical axis."""

    name: str
    view: Camera
    depth_unit: float = 0.001  # m, what 1 means in a depth picture
    depth_range: tuple[float, float] = (0.1, 10.0)  # m, nearest and farthest depth that counts
    path: Mapping[int, CameraPose] = field(default_factory=dict)  # of a camera that moves, its pose in each frame

    def __post_init__(self) -> None:
        name, view = self.name, self.view
        (fx, fy), (cx, cy) = view.focal, view.center
        sides, size = (view.width, view.height), f"{view.width} x {view.height}"
        if not all(8 <= side <= MOST_PIXELS for side in sides):
            raise InputError(f"camera {name}: pictures of {size}: give 8 to {MOST_PIXELS}")
        if not all(FOCAL[0] * n <= f <= FOCAL[1] * n for f, n in zip(view.focal, sides, strict=True)) or not all(
            -AWAY * n <= c <= (1 + AWAY) * n for c, n in zip(view.center, sides, strict=True)
        ):
            text = f"focal ({fx:g}, {fy:g}), center ({cx - 0.5:g}, {cy - 0.5:g}) for pictures of {size}"
            raise InputError(f"camera {name}: {text}: give pixels, focal above 0; calibrate the camera again")
        near, far = self.depth_range
        if not (0 < self.depth_unit <= _MOST_UNIT and 0 <= near < far <= _FARTHEST):
            text = f"depth unit {self.depth_unit:g}, range {near:g} to {far:g}"
            remedy = f"give metres, a unit above 0 and 0 <= nearest < farthest <= {_FARTHEST:g}"
            raise InputError(f"camera {name}: {text}: {remedy}")

    def in_range(self, depth: UInt16[np.ndarray, "H W"]) -> UInt16[np.ndarray, "H W"]:
        """Return depths with those outside the camera's range set to 0, no measurement."""
        near, far = self.depth_range
        metres = depth * self.depth_unit
        return np.where((metres >= near) & (metres <= far), depth, 0).astype(np.uint16)

    def picture(self, depth: UInt16[np.ndarray, "H W"]) -> DepthPicture:
        """Return depths, already limited by `in_range`, as a DepthPicture of this camera."""
        return DepthPicture(self.view, depth, self.depth_unit, float(self.depth_range[1]))

    def record(self) -> dict[str, Any]:
        """Return the camera as an entry of `rig.json`."""
        view, (near, far) = self.view, self.depth_range
        (fx, fy), (cx, cy) = view.focal, view.center
        record = {"name": self.name, "width": view.width, "height": view.height}
        record |= {"fx": fx, "fy": fy, "cx": cx - 0.5, "cy": cy - 0.5}
        record |= {"depth_unit_m": self.depth_unit, "depth_min_m": near, "depth_max_m": far}
        return record | {"camera_to_world": view.pose.to_world.tolist()}


@dataclass(frozen=True, slots=True)
class ColorCamera:
    """A camera that takes pictures in colour."""

    name: str
    view: Camera
    files: Mapping[int, Path]  # pictures by frame number
    beside: int | None = None  # number of the depth camera that it stands beside; None: it stands alone
    path: Mapping[int, CameraPose] = field(default_factory=dict)  # of a camera that moves, its pose in each frame

    def picture(self, frame: int) -> ColorPicture | None:
        """Read the picture of a frame, None where there is none. Raises InputError where it has another size."""
        if frame not in self.files:
            return None
        pixels = read_picture(self.files[frame])
        check_size(self.files[frame], pixels, self)
        return ColorPicture(at_frame(self, frame).view, pixels)


def at_frame(camera: C, frame: int) -> C:
    """Return a camera where it is in a frame; one that stands still is returned as it is."""
    return replace(camera, view=replace(camera.view, pose=camera.path[frame])) if camera.path else camera


def posed(camera: C, to_world: Matrix) -> C:
    """Return a camera at another place. Raises InputError where the matrix is no pose."""
    return replace(camera, view=replace(camera.view, pose=placed(camera.name, to_world)))


def placed(name: str, to_world: Matrix) -> CameraPose:
    """Return the pose of a camera with a name. Raises InputError where the matrix is none, or far away."""
    reason = broken(to_world)
    if not reason and (away := float(np.abs(to_world[:3, 3]).max())) > FARTHEST:
        text = f"is {away:.3g} m from the world's origin, over {FARTHEST:g}"
        reason = f"{text}: put the origin near the cameras, in metres"
    if reason:
        raise InputError(f"camera {name}: camera_to_world {reason}; calibrate it again, or leave the camera out")
    return CameraPose.of_camera(to_world)


def check_size(path: Path, pixels: np.ndarray, camera: DepthCamera | ColorCamera) -> None:
    """Raise InputError where a picture has another size than its camera."""
    if pixels.shape[:2] != (camera.view.height, camera.view.width):
        size, wanted = f"{pixels.shape[1]} x {pixels.shape[0]}", f"{camera.view.width} x {camera.view.height}"
        raise InputError(f"{path}: {size} pixels where camera {camera.name} has {wanted}; mend either")


def pictures_in(folder: Path, name: str, kind: Literal["depth", "color"], order: Order) -> dict[Key, Path]:
    """Return a camera's pictures by the numbers in their names. Raises InputError where there is none."""
    try:
        paths = sorted(p for p in folder.iterdir() if p.suffix.lower() in PICTURES[kind] and not p.name.startswith("."))
    except (OSError, ValueError) as error:  # of a name with a null
        text = f"{folder}: {kind} of camera {name} cannot be read ({getattr(error, 'strerror', error)})"
        raise InputError(f"{text}; name its folder as `{kind}`, or leave it out") from None
    if not paths:
        raise InputError(f"{folder}: camera {name} has no {kind} pictures (*{PICTURES[kind][0]}); record some")
    found: dict[str, Path] = {}
    for path in paths:
        if not any(map(str.isdecimal, path.stem)):
            raise InputError(f"{path}: has no frame number in its name; name it as {kind}_00012.png")
        if path.stem in found:
            raise InputError(f"{path}: has the frame number of {found[path.stem].name}; keep one of them")
        found[path.stem] = path
    return {key: found[stem] for stem, key in frame_keys(folder, list(found), order).items()}


def distortion_of(entry: Mapping[str, Any]) -> tuple[float, ...]:
    """Return the coefficients of an entry, five at least; missing ones are 0. Raises InputError for others."""
    given = entry.get("distortion", [])
    good = isinstance(given, list) and len(given) <= 8
    if not good or not all(type(k) in (int, float) and abs(k) <= MOST_DISTORTION for k in given):  # no NaN is
        text = f"give up to eight numbers of at most {MOST_DISTORTION:g}, k1 k2 p1 p2 k3 k4 k5 k6, as OpenCV has them"
        raise InputError(f"distortion is {given!r:.60}; {text}")
    return (*map(float, given), *[0.0] * (5 - len(given)))
