"""Gains and poses of colour cameras, solved from what several of them see of the same surface, and remembered.

Moments of a recording -> for each camera three gains and a rigid motion with which the cameras agree best; the meshes
stay where they are. A file beside `rig.json` keeps them, with the digest of what they were computed from.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from ...errors import InputError
from ...geometry import strict
from ...geometry.cameras import CameraPose, matrix_of
from ...geometry.color_views import ColorFrames, ColorPicture, ColorViews, sampled
from ...geometry.topology import face_means, face_normals, subdivide_midpoint
from ...io.write import write_file
from ...texts import json_of
from ...types import Frames, Mesh, evenly
from ..rig.rig import Rig

Moment = tuple[Mesh, Sequence[ColorPicture | None]]  # a frame's surface, and a picture for each camera that has one
Colors = Float64[np.ndarray, "C N 3"]  # of places in the pictures of cameras; 0 where a camera does not see a place
Gains = Float64[np.ndarray, "C 3"]  # log2
Poses = Float64[np.ndarray, "C 6"]  # turns as vectors and ways, in the cameras' frames; rad, m
Matrix = Float64[np.ndarray, "CD CD"]  # of normal equations
Slope = Float64[np.ndarray, "C D"]
Trust = Float64[np.ndarray, "C N"]  # in a camera's colour of a place; 0: it does not see it

DARK, BRIGHT = 8.0, 250.0  # levels beyond which a ratio says nothing: noise, and what is cut off (guess)
MOST_GAIN, MOST_MOTION = 16.0, 100.0  # log2; rad and m: beyond these a file of corrections is damaged (guess)
LEAST_GAIN, LEAST_COLOR = 0.02, 2.0  # log2, levels: deviations below are no outliers (guess)
GAIN_ERROR, POSE_ERROR = 0.5, 0.02  # deviations of the Gaussian prior on log2 gains, and on poses (rad, m) (guess)
GAIN_ROUNDS = 6  # in which outliers lose their weight (guess)
APART = 0.5  # pixels from a place to both sides, where the slopes of colours are measured
STEP = 1e-5  # rad, m: for derivatives of positions in a picture
REMEMBERED = "color_calibration.json"
_DAMAGED = (OSError, ValueError, LookupError, TypeError, AttributeError)
LN2 = math.log(2)
SMALL = np.finfo(np.float64).tiny


@dataclass(frozen=True, slots=True)
class CalibrationOptions:
    """Options of the calibration of colour cameras."""

    frames: int = 9  # that are looked at, spread over the sequence: every second one judges what the others found
    places: int = 3000  # on the surface of each, about
    halvings: tuple[int, ...] = (2, 1, 0)  # of the pictures' sides, coarse to fine
    rounds: int = 6  # for each of them
    most_side: int = 1280  # pixels of the finest pictures; larger ones are halved (guess)


@dataclass(frozen=True, slots=True)
class Correction:
    """Correction of the pictures of a camera."""

    gains: Float64[np.ndarray, " 3"]  # log2, by which its channels are too bright
    pose: Float64[np.ndarray, " 6"]  # its turn as a vector and its way, rad and m, in the camera's frame

    def of(self, picture: ColorPicture) -> ColorPicture:
        """Return a picture of the camera with this correction."""
        gains = strict.exp(self.gains * LN2)
        return replace(_moved(picture, self.pose), gains=(float(gains[0]), float(gains[1]), float(gains[2])))


Corrections = tuple[Correction, ...]  # of each camera; none where they agree as they are


class Corrected:
    """Colour pictures of a recording, corrected for their cameras; `find` is called when the first one is asked for."""

    def __init__(self, colors: ColorFrames, find: Callable[[], Corrections]) -> None:
        self._colors, self._find = colors, find

    @cached_property
    def corrections(self) -> Corrections:
        """The correction of each camera; empty if the cameras agree as they are."""
        return self._find()

    def __getitem__(self, index: int) -> list[ColorPicture | None]:
        pictures = self._colors[index]
        if not self.corrections:
            return pictures
        pairs = zip(pictures, self.corrections, strict=True)
        return [None if picture is None else correction.of(picture) for picture, correction in pairs]

    def __getstate__(self) -> dict[str, Any]:
        return {"_colors": self._colors, "corrections": self.corrections}  # other processes need not find them again


def corrections_of(
    frames: Frames, colors: ColorFrames, options: CalibrationOptions = CalibrationOptions()
) -> Corrections:
    """Return corrections of the cameras of a recording, from frames spread evenly over it."""
    moments = ((frames[number], colors[number]) for number in evenly(len(frames), options.frames))
    return tuple(calibrate(moments, options) or ())


def calibrate(frames: Iterable[Moment], options: CalibrationOptions) -> list[Correction] | None:
    """Return a correction for each camera; None if none makes the cameras agree better on moments held out."""
    side = options.most_side
    moments = [(mesh, [picture and _small(picture, side) for picture in pictures]) for mesh, pictures in frames]
    if not moments or (cameras := len(moments[0][1])) < 2:
        return None
    fitted, judged = moments[::2], moments[1::2] or moments[::2]
    poses, candidates = np.zeros((cameras, 6)), [(np.zeros((cameras, 3)), np.zeros((cameras, 6)))]
    for halvings in options.halvings:
        looks = [_Look.at(moment, poses, halvings, options.places) for moment in fitted]
        gains = fit_gains(*_joined(looks, poses))
        if len(candidates) == 1:
            candidates.append((gains, poses))  # poses may be right, and gains not
        for _ in range(options.rounds):
            poses = fit_poses(looks, gains, poses)
    candidates.append((fit_gains(*_joined(looks, poses)), poses))
    errors = [disagreement([_Look.at(one, each[1], 0, options.places) for one in judged], *each) for each in candidates]
    best = min(range(3), key=lambda number: errors[number])
    return [Correction(*each) for each in zip(*candidates[best], strict=True)] if best else None


def fit_gains(colors: Colors, trust: Trust) -> Gains:
    """Return how much brighter than the mean each camera's channels are, log2; 0 if it shares no place with another."""
    logs, gains = strict.log2(np.maximum(colors, DARK)), np.zeros((len(colors), 3))
    trust = np.where(((colors > DARK) & (colors < BRIGHT)).all(axis=2), trust, 0.0)
    slopes = np.full((*trust.shape, 1, 1), -1.0)
    for _ in range(GAIN_ROUNDS):
        residuals, weights = _compared(logs - gains[:, None], trust, LEAST_GAIN)
        for k in range(3):
            normal, slope = _equations(slopes, residuals[..., k : k + 1], weights)
            gains[:, k] -= _solved(normal, slope, gains[:, k : k + 1], GAIN_ERROR)[:, 0]
    return gains


def fit_poses(looks: Sequence[_Look], gains: Gains, poses: Poses) -> Poses:
    """Return the poses of cameras after a step of Gauss-Newton towards those with which colours of places agree."""
    factors, sums = strict.exp(-gains * LN2), (np.zeros((poses.size, poses.size)), np.zeros(poses.shape))
    for look in looks:
        residuals, weights = _compared(look.colors(poses) * factors[:, None], look.trust, LEAST_COLOR)
        for total, more in zip(sums, _equations(look.slopes(poses, factors), residuals, weights), strict=True):
            total += more
    return poses - _solved(*sums, poses, POSE_ERROR)


def disagreement(looks: Sequence[_Look], gains: Gains, poses: Poses) -> float:
    """Return by how many levels cameras differ from the mean of what all see of a place, in the mean."""
    colors, trust = _joined(looks, poses)
    shared = _shared(trust)
    residuals = _apart(colors * strict.exp(-gains * LN2)[:, None], shared)
    return float((np.abs(residuals).mean(axis=2) * shared).sum() / max(shared.sum(), SMALL))


@dataclass(frozen=True, slots=True)
class _Look:
    """Places on the surface at one moment, and the pictures that show them."""

    pictures: Sequence[ColorPicture | None]
    points: Float64[np.ndarray, "N 3"]
    trust: Trust
    scales: Float64[np.ndarray, "C N 2 2"]  # pixels, by which a place moves in a picture as it moves on the surface
    ways: Float64[np.ndarray, "C N 2 6"]  # on the surface, of what a pixel shows as its camera's pose changes

    @staticmethod
    def at(moment: Moment, poses: Poses, halvings: int, places: int) -> _Look:
        """Look at a moment through cameras in these poses, whose pictures are halved some times."""
        mesh, pictures = moment
        for _ in range(halvings):
            pictures = [one and halved(one) for one in pictures]
        points, normals = _places(mesh, places)
        empty = [np.zeros((len(pictures), len(points), *more)) for more in ((), (2, 2), (2, 6))]
        look, along = _Look(pictures, points, *empty), np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
        moved = [one and _moved(one, pose) for one, pose in zip(pictures, poses, strict=True)]
        views = iter(ColorViews([one for one in moved if one is not None], mesh).views)
        for k, (given, picture) in enumerate(zip(pictures, moved, strict=True)):
            if given is None or picture is None:
                continue
            look.trust[k] = next(views).weights(points, normals)
            rows = np.flatnonzero(look.trust[k])
            there, at = points[rows], picture.project(points[rows])[0]
            tangents = (STEP * way[rows] for way in (along, np.cross(normals, along)))
            look.scales[k, rows] = np.stack([picture.project(there + way)[0] - at for way in tangents], 2) / STEP
            turned = (_moved(given, poses[k] + step) for step in STEP * np.eye(6))
            changes = np.stack([one.project(there)[0] - at for one in turned], 2) / STEP
            look.ways[k, rows] = strict.products(strict.inverses(look.scales[k, rows]), changes)
        return look

    def colors(self, poses: Poses) -> Colors:
        """Return the colours of the places in pictures taken from these poses."""
        colors = np.zeros((*self.trust.shape, 3))
        for k, picture, rows, at in self._seen(poses):
            colors[k, rows] = sampled(picture.pixels, at)
        return colors

    def slopes(self, poses: Poses, factors: Float64[np.ndarray, "C 3"]) -> Float64[np.ndarray, "C N 3 6"]:
        """Return how the colours of the places change with the poses, by the mean slope of what all cameras see.

        Slopes of each camera's own would differ by noise, which then passes for what ties all cameras to the surface.
        """
        total = np.zeros((len(self.points), 3, 2))
        for k, picture, rows, at in self._seen(poses):
            sides = [[sampled(picture.pixels, at + way) for way in (step, -step)] for step in APART * np.eye(2)]
            slopes = np.stack([(right - left) / (2 * APART) for right, left in sides], axis=2) * factors[k][:, None]
            total[rows] += self.trust[k, rows, None, None] * strict.products(slopes, self.scales[k, rows])
        means = total / np.maximum(self.trust.sum(axis=0), SMALL)[:, None, None]
        return np.stack([strict.products(means, ways) for ways in self.ways])

    def _seen(self, poses: Poses) -> Iterator[tuple[int, ColorPicture, Int64[np.ndarray, " n"], np.ndarray]]:
        """Yield the cameras with their pictures, the numbers of the places that each sees, and where it has them."""
        for k, picture in enumerate(self.pictures):
            if picture is not None:
                rows = np.flatnonzero(self.trust[k])
                at = _moved(picture, poses[k]).project(self.points[rows])[0]
                yield k, picture, rows, np.nan_to_num(at)  # NaN: a step too long brought it behind the camera


def _places(mesh: Mesh, count: int) -> tuple[Float64[np.ndarray, "N 3"], Float64[np.ndarray, "N 3"]]:
    """Return the middles of about so many faces of a mesh, which is made finer if it has fewer, and their normals."""
    while 0 < len(mesh.faces) < count:
        mesh = subdivide_midpoint(mesh)
    chosen = slice(None, None, max(1, len(mesh.faces) // count))
    return face_means(mesh.vertices, mesh.faces[chosen]), face_normals(mesh)[0][chosen]


def _joined(looks: Sequence[_Look], poses: Poses) -> tuple[Colors, Trust]:
    """Return the colours of the places of all looks, and the trust in them."""
    colors = np.concatenate([look.colors(poses) for look in looks], axis=1)
    return colors, np.concatenate([look.trust for look in looks], axis=1)


def _moved(picture: ColorPicture, pose: Float64[np.ndarray, " 6"]) -> ColorPicture:
    """Return a picture whose camera has moved in its own frame."""
    motion = matrix_of(strict.rotations_of(np.concatenate([[1.0], pose[:3] / 2])[None])[0], pose[3:])
    camera = picture.camera
    return replace(picture, camera=replace(camera, pose=CameraPose.of_world(strict.products(motion, camera.extrinsic))))


def _small(picture: ColorPicture, most_side: int) -> ColorPicture:
    """Return a picture with at most so many pixels a side."""
    while max(picture.pixels.shape) > most_side:
        picture = halved(picture)
    return picture


def halved(picture: ColorPicture) -> ColorPicture:
    """Return a picture with half as many pixels a side, the means of two by two."""
    camera = picture.camera
    width, height = camera.width // 2, camera.height // 2
    blocks = picture.pixels[: 2 * height, : 2 * width].reshape(height, 2, width, 2, 3)
    pixels = ((blocks.sum(axis=(1, 3), dtype=np.uint16) + 2) // 4).astype(np.uint8)
    focal, center = ((0.5 * x, 0.5 * y) for x, y in (camera.focal, camera.center))
    half = replace(camera, width=width, height=height, focal=focal, center=center)
    return replace(picture, camera=half, pixels=pixels)


def _apart(values: Colors, trust: Trust) -> Colors:
    """Return how far the values of each camera are from the means of the places."""
    means = (values * trust[..., None]).sum(axis=0) / np.maximum(trust.sum(axis=0), SMALL)[:, None]
    return values - means


def _shared(trust: Trust) -> Trust:
    """Return the trust in colours of places that several cameras see; 0 for others."""
    return np.where((trust > 0).sum(axis=0) > 1, trust, 0.0)


def _compared(values: Colors, trust: Trust, least: float) -> tuple[Colors, Trust]:
    """Return how far values are from the means of their places, and trust over variance, less in outliers (Cauchy)."""
    shared = _shared(trust)
    residuals = _apart(values, shared)
    far = np.sqrt((residuals**2).mean(axis=2))
    scale = max(least, float(np.median(far[shared > 0])) if shared.any() else least)
    weights = shared / (1 + (far / (2 * scale)) ** 2)
    return _apart(values, weights), weights / scale**2


def _equations(
    slopes: Float64[np.ndarray, "C N k D"], residuals: Float64[np.ndarray, "C N k"], weights: Trust
) -> tuple[Matrix, Slope]:
    """Return the normal equations of the least weighted sum of squares of values about the means of their places."""
    cameras, _, _, count = slopes.shape
    weighted = slopes * weights[..., None, None]
    means = weighted / np.sqrt(np.maximum(weights.sum(axis=0), SMALL))[:, None, None]
    flat = np.moveaxis(means, 3, 1).reshape(cameras * count, -1)
    normal = -strict.products(flat, flat.T)
    for k in range(cameras):
        rows = slice(k * count, (k + 1) * count)
        normal[rows, rows] += strict.products(weighted[k].reshape(-1, count).T, slopes[k].reshape(-1, count))
    return normal, np.einsum("cnki,cnk->ci", weighted, residuals)


def _solved(normal: Matrix, slope: Slope, estimate: np.ndarray, deviation: float) -> Slope:
    """Return the step to subtract from what is known, which is expected to be as large as `deviation`."""
    right = slope + estimate / deviation**2
    step = strict.products(strict.inverse(normal + np.eye(slope.size) / deviation**2), right.reshape(-1, 1))
    return step.reshape(slope.shape)


def remembered(
    rig: Rig, looked_at: Sequence[int], depends_on: dict[str, Any], find: Callable[[], Corrections]
) -> Corrections:
    """Return the corrections in a rig's folder if of these `looked_at` and `depends_on`; else find and write them."""
    digest = _digest(rig, looked_at, depends_on)
    with suppress(*_DAMAGED):
        record = json_of((rig.folder / REMEMBERED).read_bytes())
        if record["of"] == digest:
            return _corrections(rig, record["cameras"])
    found = find()
    pairs = zip(rig.color_cameras, found, strict=False)
    entries = [{"name": eye.name, "log2_gains": one.gains.tolist(), "motion": one.pose.tolist()} for eye, one in pairs]
    with suppress(OSError, InputError):
        if rig.folder.stat().st_mode & 0o222:  # root could write where nobody is meant to
            text = json.dumps({"of": digest, "cameras": entries}, indent=1) + "\n"
            write_file(rig.folder / REMEMBERED, text.encode())
    return found


def _corrections(rig: Rig, entries: list[dict[str, Any]]) -> Corrections:
    """Return corrections as they were written. Raises ValueError unless each is of its camera, and possible."""
    if entries and [entry["name"] for entry in entries] != [camera.name for camera in rig.color_cameras]:
        raise ValueError("of other cameras")
    pairs = ((_numbers(one["log2_gains"], 3, MOST_GAIN), _numbers(one["motion"], 6, MOST_MOTION)) for one in entries)
    return tuple(Correction(*pair) for pair in pairs)


def _numbers(values: Any, count: int, most: float) -> Float64[np.ndarray, " n"]:
    numbers = np.array(values, dtype=np.float64)
    if numbers.shape != (count,) or not (np.abs(numbers) <= most).all():
        raise ValueError(f"{values!r:.40} are not {count} numbers up to {most:g}")
    return numbers


def _digest(rig: Rig, looked_at: Sequence[int], depends_on: dict[str, Any]) -> str:
    """Return the digest of all that corrections depend on; pictures count by their sizes in bytes."""
    files = [*rig.files, *(camera.files for camera in rig.color_cameras)]
    sizes = [[each[frame].stat().st_size if frame in each else -1 for frame in looked_at] for each in files]
    colors = [camera.view.record() | {"distortion": camera.view.distortion} for camera in rig.color_cameras]
    cameras = [camera.record() for camera in rig.cameras]
    cameras += [{"path": each.path[n].to_world.tolist()} for each in rig.color_cameras if each.path for n in looked_at]
    facts = depends_on | {"cameras": cameras, "colors": colors, "frames": list(looked_at), "sizes": sizes}
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()
