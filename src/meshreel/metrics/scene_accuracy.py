"""Accuracy and coverage of a scene against the truth: of all surface, of moving people and of the still background.

Accuracy is measured backward, from points spread evenly over the decoded area to the reference; coverage forward, of a
truth from visible surface only: in a camera's picture and range, not hidden, not edge-on. The peak of PSNRs is the
diagonal of the whole reference scene, for its parts too. SSIM is that of normal renders from these cameras, over pixels
where either mesh shows the part; flicker of people is the change of the normals in these renders between successive
frames, beyond the truth's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float64

from ..errors import InputError
from ..geometry.cameras import Camera, Rays
from ..geometry.closest_points import Surface, carried_labels
from ..geometry.drawing import draw_places
from ..geometry.topology import face_normals
from ..types import Frames, Mesh
from .comparison import Row, finite
from .distance import PSNR_CEILING, psnr, quantile
from .render import BACKGROUND, BORDER, Picture, ssim_map
from .surface_samples import WORST_ANGLE, Scatter, angles, interpolate, scatter, welded_normals

PARTS = ("all", "people", "background")


@dataclass(frozen=True, slots=True)
class SightOptions:
    """Limits of visible surface, and density of the samples."""

    people: int = 20_000  # points on the moving faces of each mesh
    background: int = 60_000  # points on the still faces of each mesh
    near: float = 0.02  # m, distance up to which surface counts as covered
    grazing: float = 65.0  # degrees, largest angle between ray and normal at which surface can be expected
    slack: float = 0.005  # m that a visible point may lie behind the first surface on its ray


@dataclass(frozen=True, slots=True)
class Sight:
    """A camera that saw the scene, with the range of its depths."""

    camera: Camera
    near: float = 0.0  # m along the optical axis: least depth that is measured
    far: float = math.inf  # m: largest depth that is measured


@dataclass(frozen=True, slots=True)
class ScenePicture(Picture):
    """Picture of a scene's normals from one camera, with its moving pixels."""

    dynamic: Bool[np.ndarray, "H W"]


class Scene:
    """A mesh of one frame prepared for measurements; costly parts are computed on first use.

    `dynamic` marks the moving faces. `complete` is set for a truth, which has surface that no camera can see.
    """

    def __init__(
        self,
        mesh: Mesh,
        dynamic: Bool[np.ndarray, " F"],
        sights: Sequence[Sight],
        options: SightOptions = SightOptions(),
        complete: bool = False,
    ) -> None:
        self.mesh, self.dynamic = mesh, dynamic
        self.sights, self.options, self.complete = tuple(sights), options, complete

    def labelled(self, mesh: Mesh) -> Scene:
        """Prepare another mesh of the same frame; each face takes the label of this scene's nearest face."""
        return Scene(mesh, carried_labels(self.surface, self.dynamic, mesh), self.sights, self.options)

    @cached_property
    def surface(self) -> Surface:
        return Surface(self.mesh)

    @cached_property
    def normals(self) -> Float64[np.ndarray, "V 3"]:
        return welded_normals(self.mesh)

    @cached_property
    def points(self) -> dict[str, Scatter]:
        """Points on both parts; a complete scene has only points that a camera can see."""
        parts = (("people", self.dynamic, self.options.people), ("background", ~self.dynamic, self.options.background))
        samples = {name: scatter(self.mesh, chosen, count) for name, chosen, count in parts}
        if self.complete:
            samples = {name: points.only(visible(self, points)) for name, points in samples.items()}
        return samples

    @cached_property
    def pictures(self) -> tuple[ScenePicture, ...]:
        return tuple(_picture(self, sight.camera) for sight in self.sights)

    @cached_property
    def rays(self) -> Rays:
        return Rays(self.mesh)


def visible(scene: Scene, points: Scatter) -> Bool[np.ndarray, " N"]:
    """Return a mask of the points on a scene's surface that at least one camera can measure."""
    measured = np.zeros(len(points), bool)
    normals = face_normals(scene.mesh)[0][points.faces]
    for sight in scene.sights:
        camera, options = sight.camera, scene.options
        offsets = points.points - camera.eye
        local = offsets @ camera.extrinsic[:3, :3].T
        pixels = camera.project(local)
        inside = ((pixels >= 0) & (pixels < (camera.width, camera.height))).all(axis=1)  # not a number: behind the eye
        inside &= (local[:, 2] >= sight.near) & (local[:, 2] <= sight.far)
        lengths = np.linalg.norm(offsets, axis=1)
        facing = np.abs(np.einsum("nd,nd->n", normals, offsets))
        candidates = np.flatnonzero(inside & ~measured & (facing >= math.cos(math.radians(options.grazing)) * lengths))
        hit_distances = scene.rays.cast(camera.eye[None], offsets[candidates]).distances
        measured[candidates] = hit_distances * lengths[candidates] >= lengths[candidates] - options.slack
    return measured


def scene_row(reference: Scene, decoded: Scene) -> Row:
    """Return the metrics of one frame by name: `median_m` of all, `people_median_m`, `background_median_m`, and so on.

    Numbers of a part that neither mesh has are None; if only the decoded one lacks it, errors are infinite and 180 deg.
    """
    row: Row = {"diagonal_m": reference.mesh.diagonal}
    backward, forward = _Matched.of(decoded, reference), _Matched.of(reference, decoded)
    for part in PARTS:
        lost = forward.part(part)
        values = _accuracy(backward.part(part), lost, reference) | _coverage(lost, reference)
        row |= {name if part == "all" else f"{part}_{name}": value for name, value in values.items()}
    return row | _ssim_row(reference.pictures, decoded.pictures)


def scene_means(rows: Sequence[Row]) -> Row:
    """Return means of the numbers that are not None, None if all are; an infinite PSNR counts as `PSNR_CEILING`."""
    means: Row = {}
    for name in rows[0] if rows else ():
        values = [row[name] for row in rows if row[name] is not None]
        if "psnr" in name:
            values = [min(value, PSNR_CEILING) for value in values]
        means[name] = float(np.mean(values)) if values else None
    return means


def compare_with_truth(
    originals: Frames,
    decoded: Frames,
    truth: Callable[[int], Scene],
    numbers: Sequence[int],
    progress: Callable[[int], None] = lambda _done: None,
) -> Row:
    """Measure the decoded meshes and the originals (noise floor) against the truth, in the frames `numbers`.

    Returns a JSON-ready row of means, and of each frame under `per_frame`; numbers that are not finite, or of a missing
    part, are None. `people_flicker_deg` compares a frame with the one before it, if that is among `numbers`. `progress`
    gets the number of finished frames. Raises InputError for a clean frame without faces, which cannot label others.
    """
    frames: list[Row] = []
    before = dict[str, Scene]()
    for done, number in enumerate(numbers, 1):
        clean = truth(number)
        if clean.mesh.is_empty:
            raise InputError(f"frame {number} of the truth has no faces; simulate the rig again")
        scenes = {"noise_floor": clean.labelled(originals[number]), "decoded": clean.labelled(decoded[number])}
        follows = done > 1 and numbers[done - 2] == number - 1
        row = {name: scene_row(clean, scene) for name, scene in scenes.items()}
        for name, scene in scenes.items():
            flicker = people_flicker((before["truth"], clean), (before[name], scene)) if follows else None
            row[name]["people_flicker_deg"] = flicker
        frames.append(row)
        before = {"truth": clean} | scenes
        progress(done)
    means = {name: finite(scene_means([frame[name] for frame in frames])) for name in ("noise_floor", "decoded")}
    rows = [{name: finite(row) for name, row in frame.items()} for frame in frames]
    return {"frames": list(numbers)} | means | {"per_frame": rows}


def people_flicker(truth: tuple[Scene, Scene], decoded: tuple[Scene, Scene]) -> float | None:
    """Return the RMS change of people's rendered normals from a frame to the next beyond that of the truth, degrees.

    That is the root of the difference of squares, 0 where the truth changes more, over pixels that show people in both
    frames of both; None where there are none.
    """
    excess = list[Float64[np.ndarray, " N"]]()
    for pictures in zip(*(scene.pictures for scene in (*truth, *decoded)), strict=True):
        people = np.logical_and.reduce([picture.dynamic for picture in pictures])
        normals = [2 * picture.colors[people].astype(np.float64) - 1 for picture in pictures]
        excess.append(angles(*normals[2:]) ** 2 - angles(*normals[:2]) ** 2)
    squares = np.concatenate([*excess, np.zeros(0)])
    return math.sqrt(max(float(squares.mean()), 0.0)) if len(squares) else None


@dataclass(frozen=True, slots=True)
class _Matched:
    """Points of one scene matched with the closest points of another."""

    people: Bool[np.ndarray, " N"]
    weights: Float64[np.ndarray, " N"]  # m^2
    distances: Float64[np.ndarray, " N"]  # m
    turned: Float64[np.ndarray, " N"]  # degrees between the normals

    @staticmethod
    def of(source: Scene, target: Scene) -> _Matched:
        parts = source.points
        people = np.repeat([name == "people" for name in parts], [len(points) for points in parts.values()])
        weights = np.concatenate([np.full(len(p), p.area / max(len(p), 1)) for p in parts.values()])
        if target.mesh.is_empty or len(weights) == 0:
            return _Matched(people, weights, np.full(len(weights), np.inf), np.full(len(weights), WORST_ANGLE))
        points = np.concatenate([p.points for p in parts.values()])
        hits = target.surface.closest(points)
        distances = np.linalg.norm(hits.points - points, axis=1)
        corners = source.mesh.faces[np.concatenate([p.faces for p in parts.values()])]
        source_normals = interpolate(source.normals, corners, np.concatenate([p.barycentric for p in parts.values()]))
        target_normals = interpolate(target.normals, target.mesh.faces[hits.faces], hits.barycentric)
        return _Matched(people, weights, distances, angles(source_normals, target_normals))

    def part(self, name: str) -> _Matched:
        """Return the points of a part: all, people or background."""
        if name == "all":
            return self
        kept = self.people if name == "people" else ~self.people
        return _Matched(self.people[kept], self.weights[kept], self.distances[kept], self.turned[kept])

    @property
    def mean_square(self) -> float:
        """Mean squared distance over the area, m^2."""
        return float(np.average(self.distances**2, weights=self.weights))


def _accuracy(backward: _Matched, forward: _Matched, reference: Scene) -> Row:
    names = ("median_m", "rms_backward_m", "normal_error_deg", "d2_psnr_backward")
    if len(backward.weights):
        median, square = quantile(backward.distances, backward.weights, 0.5), backward.mean_square
        angle = float(np.average(backward.turned, weights=backward.weights))
        values: tuple[float | None, ...] = (median, math.sqrt(square), angle, psnr(square, reference.mesh.diagonal))
    else:
        values = (math.inf, math.inf, WORST_ANGLE, 0.0) if len(forward.weights) else (None,) * len(names)
    return dict(zip(names, values, strict=True))


def _coverage(forward: _Matched, reference: Scene) -> Row:
    if len(forward.weights) == 0:
        return {"coverage_rms_m": None, "covered": None, "d2_psnr_forward": None}
    within = float(np.average(forward.distances <= reference.options.near, weights=forward.weights))
    square = forward.mean_square
    d2 = psnr(square, reference.mesh.diagonal)
    return {"coverage_rms_m": math.sqrt(square), "covered": within, "d2_psnr_forward": d2}


def _picture(scene: Scene, camera: Camera) -> ScenePicture:
    shape = (camera.height, camera.width)
    colors = np.full((*shape, 3), BACKGROUND, np.float32)
    covered, dynamic = np.zeros(shape, bool), np.zeros(shape, bool)
    if not scene.mesh.is_empty:
        seen = draw_places(scene.mesh, camera)
        covered = seen.covered
        colors[covered] = (interpolate(scene.normals, scene.mesh.faces[seen.faces], seen.barycentric) + 1) / 2
        dynamic[covered] = scene.dynamic[seen.faces]
    return ScenePicture(covered, colors, dynamic)


def _ssim_row(reference: Sequence[ScenePicture], decoded: Sequence[ScenePicture]) -> Row:
    scores: dict[str, list[float]] = {part: [] for part in PARTS}
    for a, b in zip(reference, decoded, strict=True):
        scored = ssim_map(a.colors.astype(np.float64), b.colors.astype(np.float64))
        inside = np.zeros(a.covered.shape, bool)
        inside[BORDER:-BORDER, BORDER:-BORDER] = True  # SSIM leaves the border out
        covered, people = (a.covered | b.covered) & inside, (a.dynamic | b.dynamic) & inside
        for part, mask in (("all", covered), ("people", people), ("background", covered & ~people)):
            if mask.any():
                scores[part].append(float(scored[mask].mean()))
    names = {part: "ssim_masked" if part == "all" else f"{part}_ssim_masked" for part in PARTS}
    return {names[part]: float(np.mean(values)) if values else None for part, values in scores.items()}
