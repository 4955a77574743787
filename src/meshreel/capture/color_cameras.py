"""Colour cameras of a rig, and the pictures that they recorded.

In: entries of `rig.json`. Out: cameras with their pictures by frame number. A depth camera's `color` is a folder of
pictures that are aligned with its depth, or an object that says what is different; `color_cameras` has those alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64

from ..errors import InputError
from ..geometry.cameras import PinholeCamera
from ..geometry.color_views import ColorPicture
from ..io.file_names import last_number
from ..io.pictures import read_picture

PICTURES = {"depth": (".png",), "color": (".png", ".jpg", ".jpeg", ".webp", ".bmp")}
MOST_DISTORTION = 10.0  # of a coefficient: beyond, the picture would fold many times (guess)


@dataclass(frozen=True, slots=True)
class ColorCamera:
    """A pinhole camera that takes pictures in colour; its numbers are those of a DepthCamera."""

    name: str
    width: int  # pixels
    height: int  # pixels
    intrinsic: Float64[np.ndarray, "3 3"]  # camera coordinates to homogeneous pixels, whose middles are whole numbers
    camera_to_world: Float64[np.ndarray, "4 4"]  # m
    distortion: tuple[float, ...]  # k1, k2, p1, p2, k3, and perhaps k4, k5, k6, as OpenCV has them
    files: Mapping[int, Path]  # pictures by frame number
    beside: int | None = None  # number of the depth camera that it stands beside; None: it stands alone

    def picture(self, frame: int) -> ColorPicture | None:
        """Read the picture of a frame, None where there is none. Raises InputError where it has another size."""
        if frame not in self.files:
            return None
        pixels = read_picture(self.files[frame])
        if pixels.shape[:2] != (self.height, self.width):
            size, wanted = f"{pixels.shape[1]} x {pixels.shape[0]}", f"{self.width} x {self.height}"
            raise InputError(f"{self.files[frame]}: {size} pixels where camera {self.name} has {wanted}; mend either")
        shifted = self.intrinsic + np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
        camera = PinholeCamera(self.width, self.height, shifted, np.linalg.inv(self.camera_to_world))
        return ColorPicture(camera, pixels, self.distortion)


def pictures_in(folder: Path, name: str, kind: Literal["depth", "color"]) -> dict[int, Path]:
    """Return a camera's pictures by the last number in their names. Raises InputError where there is none."""
    try:
        paths = sorted(p for p in folder.iterdir() if p.suffix.lower() in PICTURES[kind] and not p.name.startswith("."))
    except OSError as error:
        text = f"{folder}: {kind} of camera {name} cannot be read ({error.strerror})"
        raise InputError(f"{text}; name its folder as `{kind}`, or leave it out") from None
    found: dict[int, Path] = {}
    for path in paths:
        number = last_number(path.stem)
        if number is None:
            raise InputError(f"{path}: has no frame number in its name; name it as {kind}_00012.png")
        if number in found:
            raise InputError(f"{path}: is frame {number}, as {found[number].name} is; keep one of them")
        found[number] = path
    if not found:
        raise InputError(f"{folder}: camera {name} has no {kind} pictures (*{PICTURES[kind][0]}); record some")
    return found


def check_frames(folder: Path, cameras: Sequence[ColorCamera], frames: Sequence[int]) -> None:
    """Raise InputError where a camera has pictures of other frames than these, which depth cameras have."""
    for camera in cameras:
        if odd := set(camera.files) ^ set(frames):
            counts = f"{len(camera.files)} color pictures for {len(frames)} frames of depth"
            text = f"{folder}: camera {camera.name} has {counts}; only one of both has frame {min(odd)}"
            raise InputError(f"{text}: give every frame a picture of its number, and no others")


def distortion_of(entry: Mapping[str, Any]) -> tuple[float, ...]:
    """Return the coefficients of an entry, five at least; missing ones are 0. Raises InputError for others."""
    given = entry.get("distortion", [])
    good = isinstance(given, list) and len(given) <= 8
    if not good or not all(type(k) in (int, float) and abs(k) <= MOST_DISTORTION for k in given):  # no NaN is
        text = f"give up to eight numbers of at most {MOST_DISTORTION:g}, k1 k2 p1 p2 k3 k4 k5 k6, as OpenCV has them"
        raise InputError(f"distortion is {given!r:.60}; {text}")
    return (*map(float, given), *[0.0] * (5 - len(given)))
