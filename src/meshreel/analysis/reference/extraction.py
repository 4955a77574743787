"""Extract the reference mesh of a group: one surface without contact that deforms to every frame (paper, 3.3.2).

In: the frames and their tracked centers. Out: the mesh and the pose of the centers in which it lies.

Differs from the paper: the pose is that of MDS or of a frame, whichever mesh is nearest to the frames after a quick
surface fit; MDS must be clearly better, since displacements from it need more components (decision 6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from ...geometry.closest_points import Surface
from ...types import Centers, Mesh
from ..fit.frame import FrameSurface
from ..fit.surface_fit import FitOptions, Guides, fit_surfaces
from .centers import affinity, largest_distances, reference_centers
from .deform import Neighbours, moved_to, neighbours
from .fuse import VOXEL, Group, GroupCenters

MDS = -1  # stands for the pose of eq. 5 where a frame number is expected
TRIAL_FIT = FitOptions(gates=(0.024, 0.012), smoothing=(2.0, 0.7), components=0, iterations=20)  # quick: a guess
PROBES = 4000  # vertices of a frame measured in a trial: a guess
KEYS = 3  # frames tried as key, whose surface comes first and whose pose is tried (decision 6)
CANONICAL_KEYS = 2  # the best of these, tried with the MDS pose, too (decision 6)
CANONICAL_GAIN = 0.85  # the MDS pose must leave at most this share of the best frame's misfit (decision 6)
TRIAL_FRAMES = 4  # frames to which a trial is fitted (guess)
TRIAL_VOXEL = 1.0  # of a trial, in mean edges of the frames' meshes (guess)
TRIAL_VERTICES = 2000  # vertices of a trial's mesh, at most (guess)


@dataclass(frozen=True, slots=True)
class ReferenceOptions:
    """Options of the reference mesh and of the choice of its pose (decision 6)."""

    vertices: int = 2000  # vertices of the reference mesh
    poisson: int | None = None  # depth of the paper's reconstruction, which then joins surfaces (paper: 9)


@dataclass(frozen=True, slots=True)
class Trial:
    """Misfit of the mesh made in one pose, measured after it is deformed back to some frames."""

    frame: int  # frame whose centers are the pose, or MDS
    key: int  # frame whose surface comes first
    rms: float  # symmetric surface distance after a quick fit, mean over the frames tried, in units of the vertices
    worst: float  # largest such distance over the frames tried


@dataclass(frozen=True, slots=True)
class Reference:
    """Reference mesh, the pose of the centers in which it lies, and the trials from which the pose was chosen."""

    mesh: Mesh
    pose: Float64[np.ndarray, "K 3"]
    frame: int  # frame whose centers are the pose, or MDS
    key: int  # frame whose surface comes first
    neighbours: Neighbours
    stress: float  # of the MDS pose, eq. 5
    trials: tuple[Trial, ...]


def extract_reference(
    frames: Sequence[Mesh],
    centers: Centers,
    options: ReferenceOptions,
    canonical: bool = False,
    again: bool = False,
) -> Reference:
    """Extract the reference of a group in the pose that fits best; its mesh is empty if all frames are.

    If `canonical`, the pose is that of eq. 5; which frame's surface comes first is still chosen by the fit. Fewer
    poses are tried `again`, of a part of a group that was tried as a whole.
    """
    assert len(frames) == len(centers), "one pose of the centers for each frame"
    distances = largest_distances(centers)
    kin = neighbours(affinity(distances))
    full = np.array([t for t, frame in enumerate(frames) if not frame.is_empty], dtype=int)
    if len(full) == 0:
        return Reference(Mesh.empty(), centers.positions[0], 0, 0, kin, 0.0, ())
    tracked = GroupCenters(centers.positions[full], distances, kin)
    group = Group([frames[t] for t in full], tracked, options.poisson)
    spread = reference_centers(distances, group.positions[len(full) // 2])
    trials = _trials(group, spread.positions, options, canonical, again)
    best = _best(trials)
    pose = spread.positions if best.frame == MDS else group.positions[best.frame]
    mesh = group.fused(pose, best.key, VOXEL, options.vertices)
    trials = tuple(
        replace(trial, frame=MDS if trial.frame == MDS else int(full[trial.frame]), key=int(full[trial.key]))
        for trial in trials
    )
    best = _best(trials)
    return Reference(mesh, pose, best.frame, best.key, kin, spread.stress, trials)


def predict(reference: Reference, mesh: Mesh, centers: Centers) -> Float64[np.ndarray, "T V 3"]:
    """Deform a mesh in the reference pose, as the decoded and subdivided reference, to the pose of each frame."""
    return moved_to(mesh, reference.pose, centers.positions, reference.neighbours)


def _trials(
    group: Group, canonical: Float64[np.ndarray, "K 3"], options: ReferenceOptions, alone: bool, again: bool
) -> tuple[Trial, ...]:
    """Try the poses of some key frames, each with its own surface first, then the MDS pose with the best of these.

    If `alone`, only the MDS pose is tried, with the surface of each of them first.
    """
    surfaces = [FrameSurface(frame) for frame in group.frames]
    count = min(max(1, KEYS - again), len(group.frames))
    keys = sorted({int(key) for key in (np.arange(count) + 0.5) * len(group.frames) / count})
    if alone:
        return tuple(_trial(group, surfaces, _Attempt(MDS, key, canonical), options) for key in keys)
    trials = [_trial(group, surfaces, _Attempt(key, key, group.positions[key]), options) for key in keys]
    if len(group.frames) > 1:
        best = sorted(trials, key=_misfit)[: 1 if again else CANONICAL_KEYS]
        trials += [_trial(group, surfaces, _Attempt(MDS, trial.key, canonical), options) for trial in best]
    return tuple(trials)


@dataclass(frozen=True, slots=True)
class _Attempt:
    """A pose to try, and the frame whose surface comes first."""

    frame: int  # frame whose centers are the pose, or MDS
    key: int
    pose: Float64[np.ndarray, "K 3"]


def _trial(group: Group, surfaces: list[FrameSurface], attempt: _Attempt, options: ReferenceOptions) -> Trial:
    """Make a quick reference in a pose, fit it to some frames, first and last included, and measure the misfit."""
    frame, key, pose = attempt.frame, attempt.key, attempt.pose
    if len(surfaces) == 1:
        return Trial(frame, key, 0.0, 0.0)  # nothing to choose from
    mesh = group.fused(pose, key, TRIAL_VOXEL, min(options.vertices, TRIAL_VERTICES))
    if mesh.is_empty:
        return Trial(frame, key, np.inf, np.inf)
    tried = sorted({key, *np.linspace(0, len(surfaces) - 1, TRIAL_FRAMES).round().astype(int).tolist()})
    frames = [surfaces[t] for t in tried]
    fitted = fit_surfaces(mesh.faces, group.sent(mesh, pose)[tried], frames, TRIAL_FIT, Guides(key=tried.index(key)))
    rms = []
    for frame_surface, moved in zip(frames, fitted, strict=True):
        original = frame_surface.mesh.vertices
        to_fit = Surface(Mesh(moved, mesh.faces)).distances(original[:: max(1, len(original) // PROBES)])
        to_frame = _outside(frame_surface.surface, moved, group.edge)
        rms.append(max(np.sqrt(np.mean(to_fit**2)), np.sqrt(np.mean(to_frame**2))))
    return Trial(frame, key, float(np.mean(rms)), float(np.max(rms)))


def _best(trials: Sequence[Trial]) -> Trial:
    """Return the trial with the least misfit; that of the MDS pose is raised, since it needs more components."""
    return min(trials, key=lambda trial: _misfit(trial) / (CANONICAL_GAIN if trial.frame == MDS else 1.0))


def _misfit(trial: Trial) -> float:
    return trial.rms + trial.worst


def _outside(surface: Surface, points: Float64[np.ndarray, "N 3"], most: float) -> Float64[np.ndarray, " N"]:
    """Return distances to a surface, at most `most` for points inside it.

    Where bodies touch, the frame has no surface between them, but a good reference has.
    """
    hits = surface.closest(points)
    offset = points - hits.points
    gaps = np.linalg.norm(offset, axis=1)
    inside = np.einsum("nd,nd->n", offset, surface.normals[hits.faces]) < 0
    return np.where(inside, np.minimum(gaps, most), gaps)
