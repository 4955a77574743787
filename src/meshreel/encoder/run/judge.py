"""Judge the groups of an interval before they are kept, and encode again what does not hold.

In: an interval, its recipe. Out: its groups, none of which has lost or invented a part of a frame. A group is decoded
as a reader does it, and compared with the frames as a stranger would, without the correspondences that made it: samples
of each surface look for the other one. Where a frame is lost, the frames of its group get a template of their own, then
a finer one, and then each a mesh of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float64, Int64

from ... import _core
from ...errors import InputError
from ...format.layout import Form
from ...geometry import work
from ...geometry.closest_points import Surface, area_samples
from ...geometry.threads import mapped
from ...geometry.topology import boxes_of, components, connected_faces, face_normals, vertex_normals
from ...metrics.distance import NEAR
from ...metrics.surface_samples import used_surface
from ...types import Frames, Mesh
from ..group.forms import NORMALISED, EncodedGroup, intra_only, target_of
from ..group.interval import Interval
from ..settings.options import Recipe

PART = 0.1  # of the diagonal of a connected piece, within which it is covered: another leaf is not this one (guess)
SAMPLES = 2000  # vertices of a surface that look for the other one, or all vertices and middles of faces (guess)
NOISES = 4.0  # times the noise, within which surface is covered, too (guess)
# Shares of the surface, of clean frames and of noisy ones. Measured at qualities 10 to 95: clean bodies lose .001 at
# most, noisy ones .07, of which .016 in one piece.
LOST, PIECE, INVENTED = (0.05, 0.2), (0.01, 0.05), (0.02, 0.6)
# Of a template that follows noisy frames: .16 of a real one was seen, and .23 to .46 where its motion crumpled it.
TURNED = 0.2
DISTANCE = 4.0  # times the distance to reach that a clean frame may have: 1.5 at most was seen


@dataclass(frozen=True, slots=True)
class Verdict:
    """The shares of a frame's surface that are lost and invented, and its distance."""

    lost: float = 0.0  # without decoded surface near it
    piece: float = 0.0  # the largest connected area of that, or all of it where that is little
    invented: float = 0.0  # of the decoded surface, that without surface of the frame near it
    turned: float = 0.0  # of the decoded surface, that which faces away from a noisy frame's surface nearest to it
    distance: float = 0.0  # normalised, RMS of the samples of the side that is farther off

    def fault(self, noise: float, target: float, follows: bool) -> str:
        """Return why the frame is not shown, empty where it is: up to `DISTANCE` times the `target`, without noise.

        `follows` says whether the mesh is a template that follows the frames; others face as the frames do.
        """
        lost, piece, invented = (limits[noise > 0] for limits in (LOST, PIECE, INVENTED))
        for name, share, most in (
            ("lost", self.lost, lost),
            ("lost in one piece", self.piece, piece),
            ("invented", self.invented, invented),
            ("inside out", self.turned, TURNED if follows else 1.0),
        ):
            if share > most:
                return f"{100 * share:.1f} % of its surface is {name}"
        far = noise == 0 and self.distance > DISTANCE * target
        return f"it is {self.distance / target:.1f} times as far off as the quality asks for" if far else ""


def judged(interval: Interval, recipe: Recipe) -> Iterator[EncodedGroup]:
    """Yield the groups of an interval, each of which holds. Raises InputError for frames that no mesh reproduces."""
    at, count = 0, len(interval.frames)
    while at < count:
        state, first = None, at
        for group in recipe.encode(_from(interval, at, count)):
            work.passed("code", group.frame_count)
            some = _from(interval, at, at + group.frame_count)
            group, state, fault = _judged(some, recipe, group, state)
            at += group.frame_count
            if fault:  # alone, the same frames may be encoded otherwise
                ways = (recipe.finer(), None) if group.frame_count == count - first else (recipe, recipe.finer(), None)
                yield from _again(some, recipe, ways)
                break  # the groups that follow were predicted from it
            yield group


def _judged(
    interval: Interval, recipe: Recipe, group: EncodedGroup, state: _core.GroupState | None
) -> tuple[EncodedGroup, _core.GroupState | None, str]:
    """Return a group with its least covered frame, the state after it, and why it does not hold, empty where it does.

    `state` is that before it.
    """
    if not recipe.judged or interval.frames[0].is_empty:
        return group, None, ""
    frames = mapped(interval.frames.__getitem__, range(len(interval.frames)))
    found = _core.Group(group.payload, len(frames), None, state if group.predicted else None, NORMALISED)
    shown = [used_surface(Mesh(*arrays[:2])) for arrays in found.frames()]
    target = target_of(frames, recipe.options.target.scaled(interval.larger), interval.noise).distance
    verdicts = mapped(partial(_verdict, interval), range(len(frames)), frames, shown)
    covered = 1 - max(verdict.lost for verdict in verdicts)
    worst = max(range(len(frames)), key=lambda number: verdicts[number].lost)
    fidelity = replace(group.fidelity, covered=covered, least=interval.first_frame + worst)
    follows = group.form == Form.LAYERS
    faults = ((number, verdict.fault(interval.noise, target, follows)) for number, verdict in enumerate(verdicts))
    fault = next((f"frame {interval.first_frame + number}: {why}" for number, why in faults if why), "")
    return replace(group, fidelity=fidelity), found.state, fault


def _again(interval: Interval, recipe: Recipe, ways: Sequence[Recipe | None]) -> Iterator[EncodedGroup]:
    """Yield groups of the frames of one that does not hold, by the first way by which all hold; None: each alone.

    Alone, frames are coded with their noise where they do not hold without.
    """
    tries = [lambda way=way: way.encode(interval) for way in ways if way is not None]
    tries += [partial(_alone, interval, recipe, noise) for noise in sorted({interval.noise, 0.0}, reverse=True)]
    fault = ""
    for encode in tries:
        groups, at, fault = list[EncodedGroup](), 0, ""
        state = None
        for group in encode():
            some = _from(interval, at, at + group.frame_count)
            group, state, why = _judged(some, recipe, group, state)
            groups.append(replace(group, mended=True))
            fault, at = fault or why, at + group.frame_count
        if not fault:
            yield from groups
            return
    text = f"{fault}, and neither a template nor a mesh of its own shows it better (track {interval.track})"
    raise InputError(f"{text}; raise --quality, try --dynamic-only, or look whether the frame is damaged")


def _alone(interval: Interval, recipe: Recipe, noise: float) -> Iterator[EncodedGroup]:
    """Yield the frames as meshes of their own, to the distance that frames of this noise have."""
    frames, target = list(interval.frames), recipe.options.target.scaled(interval.larger)
    while frames:
        group = intra_only(frames, target_of(frames, target, noise), recipe.options.intra)
        frames = frames[group.frame_count :]
        yield group


def _verdict(interval: Interval, number: int, frame: Mesh, mesh: Mesh) -> Verdict:
    work.passed("judge")
    if mesh.is_empty:
        return Verdict(lost=1.0, piece=1.0, distance=np.inf)
    uneven, surface, noisy = interval.unevenness(frame.vertices), Surface(mesh), interval.noise > 0
    noise = interval.noise * (np.ones(len(frame.vertices)) if uneven is None else uneven)
    near = np.maximum(np.minimum(NEAR * frame.diagonal, PART * _piece_sizes(frame)), NOISES * noise)
    (corners, shares), (others, weights) = _samples(frame), _samples(mesh)
    gaps = surface.distances(frame.vertices[corners].mean(axis=1))
    points, original = mesh.vertices[others].mean(axis=1), Surface(frame)
    hits = original.closest(points)
    back = np.linalg.norm(hits.points - points, axis=1)
    beyond = back > near[frame.faces[hits.faces]].mean(axis=1)
    if beyond.any() and (free := interval.free(number)) is not None:  # surface is invented where a camera saw through
        beyond[beyond] = free.at(points[beyond])
    turned = 0.0
    if noisy:  # clean frames may be wound as they like
        facing = np.einsum("nd,nd->n", vertex_normals(mesh)[others].sum(axis=1), original.normals[hits.faces])
        turned = float(weights[facing < 0].sum())
    lost = float(shares[gaps > near[corners].mean(axis=1)].sum())
    piece = _largest(frame, surface, near) if lost > PIECE[noisy] else lost
    rms = max(float((shares * gaps**2).sum()), float((weights * back**2).sum())) ** 0.5
    return Verdict(lost, piece, float(weights[beyond].sum()), turned, rms)


def _samples(mesh: Mesh) -> tuple[Int64[np.ndarray, "N 3"], Float64[np.ndarray, " N"]]:
    """Return samples of a surface, each the middle of three vertices, and their shares of its area."""
    chosen = area_samples(mesh, SAMPLES)
    if len(chosen) < len(mesh.vertices):
        return chosen[:, None].repeat(3, axis=1), np.full(len(chosen), 1 / len(chosen))
    areas = face_normals(mesh)[1]
    around = np.bincount(mesh.faces.reshape(-1), (areas / 12).repeat(3), len(mesh.vertices))
    shares = np.concatenate([around, 0.75 * areas])
    return np.concatenate([chosen[:, None].repeat(3, axis=1), mesh.faces]), shares / max(shares.sum(), 1e-300)


def _piece_sizes(mesh: Mesh) -> Float64[np.ndarray, " V"]:
    """Return the diagonal of the box of each vertex's connected piece."""
    label = components(mesh.faces, len(mesh.vertices))
    low, high = boxes_of(label, mesh.vertices, int(label.max()) + 1)
    return np.linalg.norm(high - low, axis=1)[label]


def _largest(frame: Mesh, surface: Surface, near: Float64[np.ndarray, " V"]) -> float:
    """Return the share of a frame's surface in its largest connected area that is farther than `near`."""
    far = (surface.distances(frame.vertices) > near)[frame.faces].all(axis=1)
    if not far.any():
        return 0.0
    areas = face_normals(frame)[1]
    pieces = np.bincount(connected_faces(frame.faces[far], len(frame.vertices)), areas[far])
    return float(pieces.max() / areas.sum())


class _Excerpt(Frames):
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
        interval, frames=_Excerpt(interval.frames, range(start, stop)), first_frame=interval.first_frame + start
    )
