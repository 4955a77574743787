"""Judge the groups of an interval before they are kept, and encode again what does not hold.

In: an interval, its recipe. Out: its groups, none of which has lost or invented a part of a frame. A group is decoded
as a reader does it, and compared with the frames as a stranger would, without the correspondences that made it: samples
of each surface look for the other one. Where a frame is lost, the frames of its group get a template of their own, then
a finer one, and then each a mesh of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64

from ... import _core
from ...errors import InputError
from ...geometry.closest_points import Surface, area_samples
from ...geometry.topology import connected_faces, drop_unreferenced, face_normals
from ...metrics.distance import NEAR
from ...types import Frames, Mesh
from ..group.forms import NORMALISED, EncodedGroup, intra_only, target_of
from ..group.interval import Interval
from ..group.progress import Stages
from ..settings.options import Recipe

SAMPLES = 4000  # vertices of a surface that look for the other one, or all vertices and middles of faces (guess)
NOISES = 4.0  # times the noise, within which surface is covered, too (guess)
# Shares of the surface, of clean frames and of noisy ones. Measured at qualities 10 to 95: clean bodies lose .001 at
# most, noisy ones .07, of which .016 in one piece.
LOST, PIECE, INVENTED = (0.05, 0.2), (0.01, 0.05), (0.02, 0.6)
DISTANCE = 4.0  # times the distance to reach that a clean frame may have: 1.5 at most was seen


@dataclass(frozen=True, slots=True)
class Verdict:
    """The shares of a frame's surface that are lost and invented, and its distance."""

    lost: float = 0.0  # without decoded surface near it
    piece: float = 0.0  # the largest connected area of that
    invented: float = 0.0  # of the decoded surface, that without surface of the frame near it
    distance: float = 0.0  # normalised, RMS of the samples of the side that is farther off

    def holds(self, noise: float, target: float) -> bool:
        """Return whether the frame is shown: up to `DISTANCE` times the `target` distance, where it has no noise."""
        lost, piece, invented = (limits[noise > 0] for limits in (LOST, PIECE, INVENTED))
        near = noise > 0 or self.distance <= DISTANCE * target
        return near and self.lost <= lost and self.piece <= piece and self.invented <= invented


def judged(interval: Interval, recipe: Recipe, stages: Stages | None) -> Iterator[EncodedGroup]:
    """Yield the groups of an interval, each of which holds. Raises InputError for frames that no mesh reproduces."""
    at, count = 0, len(interval.frames)
    while at < count:
        state, first = None, at
        for group in recipe.encode(_from(interval, at, count), stages):
            some = _from(interval, at, at + group.frame_count)
            group, state, holds = _judged(some, recipe, group, state)
            at += group.frame_count
            if not holds:  # alone, the same frames may be encoded otherwise
                ways = (recipe.finer(), None) if group.frame_count == count - first else (recipe, recipe.finer(), None)
                yield from _again(some, recipe, ways)
                break  # the groups that follow were predicted from it
            yield group


def _judged(
    interval: Interval, recipe: Recipe, group: EncodedGroup, state: _core.GroupState | None
) -> tuple[EncodedGroup, _core.GroupState | None, bool]:
    """Return a group with its least covered frame, the state after it, and whether it holds; `state` is that before."""
    if not recipe.judged or interval.frames[0].is_empty:
        return group, None, True
    frames = list(interval.frames)
    found = _core.Group(group.payload, len(frames), None, state if group.predicted else None, NORMALISED)
    shown = [drop_unreferenced(Mesh(*arrays[:2])) for arrays in found.frames()]
    target = target_of(frames, recipe.options.target.scaled(interval.larger), interval.noise).distance
    verdicts = [_verdict(interval, number, *both) for number, both in enumerate(zip(frames, shown, strict=True))]
    covered = 1 - max(verdict.lost for verdict in verdicts)
    worst = max(range(len(frames)), key=lambda number: verdicts[number].lost)
    fidelity = replace(group.fidelity, covered=covered, least=interval.first_frame + worst)
    holds = all(verdict.holds(interval.noise, target) for verdict in verdicts)
    return replace(group, fidelity=fidelity), found.state, holds


def _again(interval: Interval, recipe: Recipe, ways: Sequence[Recipe | None]) -> Iterator[EncodedGroup]:
    """Yield groups of the frames of one that does not hold, by the first way by which all hold; None: each alone."""
    for way in ways:
        groups, at = list[EncodedGroup](), 0
        state, holds = None, True
        for group in _alone(interval, recipe) if way is None else way.encode(interval, Stages(None, 1)):
            some = _from(interval, at, at + group.frame_count)
            group, state, held = _judged(some, recipe, group, state)
            groups.append(replace(group, mended=True))
            holds, at = holds and held, at + group.frame_count
        if holds:
            yield from groups
            return
    where = f"frames {interval.first_frame} to {interval.stop - 1}"
    text = f"{where} of track {interval.track}: neither a template nor a mesh for each shows them as they are"
    raise InputError(f"{text}; raise --quality, or look whether these frames are damaged")


def _alone(interval: Interval, recipe: Recipe) -> Iterator[EncodedGroup]:
    """Yield the frames as meshes of their own."""
    frames, target = list(interval.frames), recipe.options.target.scaled(interval.larger)
    while frames:
        group = intra_only(frames, target_of(frames, target, interval.noise), recipe.options.intra)
        frames = frames[group.frame_count :]
        yield group


def _verdict(interval: Interval, number: int, frame: Mesh, mesh: Mesh) -> Verdict:
    if mesh.is_empty:
        return Verdict(1.0, 1.0, 0.0, np.inf)
    uneven, surface = interval.unevenness(frame.vertices), Surface(mesh)
    noise = interval.noise * (np.ones(len(frame.vertices)) if uneven is None else uneven)
    near = np.maximum(NEAR * frame.diagonal, NOISES * noise)
    (corners, shares), (others, weights) = _samples(frame), _samples(mesh)
    gaps = surface.distances(frame.vertices[corners].mean(axis=1))
    points, original = mesh.vertices[others].mean(axis=1), Surface(frame)
    hits = original.closest(points)
    back = np.linalg.norm(hits.points - points, axis=1)
    beyond = back > near[frame.faces[hits.faces]].mean(axis=1)
    if beyond.any() and (free := interval.free(number)) is not None:  # surface is invented where a camera saw through
        beyond[beyond] = free.at(points[beyond])
    lost = float(shares[gaps > near[corners].mean(axis=1)].sum())
    piece = _largest(frame, surface, near) if lost else 0.0
    rms = max(float((shares * gaps**2).sum()), float((weights * back**2).sum())) ** 0.5
    return Verdict(lost, piece, float(weights[beyond].sum()), rms)


def _samples(mesh: Mesh) -> tuple[Int64[np.ndarray, "N 3"], Float64[np.ndarray, " N"]]:
    """Return samples of a surface, each the middle of three vertices, and their shares of its area."""
    chosen = area_samples(mesh, SAMPLES)
    if len(chosen) < len(mesh.vertices):
        return chosen[:, None].repeat(3, axis=1), np.full(len(chosen), 1 / len(chosen))
    areas = face_normals(mesh)[1]
    around = np.bincount(mesh.faces.reshape(-1), (areas / 12).repeat(3), len(mesh.vertices))
    shares = np.concatenate([around, 0.75 * areas])
    return np.concatenate([chosen[:, None].repeat(3, axis=1), mesh.faces]), shares / max(shares.sum(), 1e-300)


def _largest(frame: Mesh, surface: Surface, near: Float64[np.ndarray, " V"]) -> float:
    """Return the share of a frame's surface in its largest connected area that is farther than `near`."""
    far = (surface.distances(frame.vertices) > near)[frame.faces].all(axis=1)
    if not far.any():
        return 0.0
    areas = face_normals(frame)[1]
    pieces = np.bincount(connected_faces(frame.faces[far], len(frame.vertices)), areas[far])
    return float(pieces.max() / areas.sum())


class _Some(Frames):
    """Successive frames of an interval."""

    def __init__(self, frames: Frames | Sequence[Mesh], numbers: range) -> None:
        self._frames, self._numbers = frames, numbers

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: int) -> Mesh:
        return self._frames[self._numbers[index]]


def _from(interval: Interval, start: int, stop: int) -> Interval:
    """Return the frames `start` to `stop`, counted from the first, as an interval."""
    if stop - start == len(interval.frames):
        return interval
    return replace(
        interval, frames=_Some(interval.frames, range(start, stop)), first_frame=interval.first_frame + start
    )
