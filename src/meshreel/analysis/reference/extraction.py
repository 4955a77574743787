"""The reference mesh of a group: one surface, free of contact, that every frame can be told from (section 3.3.2).

In: the frames and their tracked centers. Out: the mesh, the pose of the centers that it lies in, and the way back.

Differs from the paper: the pose is not always that of MDS but the one, MDS or a frame's own, whose mesh is nearest to
the frames after a quick surface fit; MDS must gain something, since displacements from it need more components.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64

from ...errors import InputError
from ...geometry.closest_points import Surface
from ...types import Centers, Mesh
from ..fit.match import Target
from ..fit.surface_fit import FitOptions, fit_targets
from .centers import ReferenceCenterOptions, affinity, largest_distances, reference_centers
from .deform import DeformOptions, Neighbours, bind, center_motions, move, neighbours
from .fuse import FuseOptions, Group

MDS = -1  # in place of a frame's number: the pose is that of eq. 5
TRIAL_FIT = FitOptions(gates=(0.024, 0.012), smoothing=(2.0, 0.7), components=0, iterations=20)
PROBES = 4000  # vertices of a frame that are measured in a trial


@dataclass(frozen=True, slots=True)
class ReferenceOptions:
    """How the reference mesh is made and its pose chosen."""

    vertices: int = 2000  # of the reference mesh
    keys: int = 3  # frames tried as the one whose surface, and whose pose, is taken first
    canonical_keys: int = 2  # the best so many of them are tried with the MDS pose too
    canonical_gain: float = 0.85  # MDS must fit to this share of the best frame pose: it takes more components
    trial_frames: int = 4  # frames that a trial is fitted to
    trial_depth: int = 7  # Poisson depth of the trials
    trial_vertices: int = 2000  # of their meshes
    centers: ReferenceCenterOptions = field(default_factory=ReferenceCenterOptions)
    deform: DeformOptions = field(default_factory=DeformOptions)
    fuse: FuseOptions = field(default_factory=FuseOptions)

    def __post_init__(self) -> None:
        if self.vertices < 4 or self.trial_vertices < 4:
            raise InputError(f"vertices {self.vertices}, trial_vertices {self.trial_vertices}: give at least 4")
        if self.keys < 1:
            raise InputError(f"keys is {self.keys}: give at least 1 frame to try")

    def fewer_trials(self) -> ReferenceOptions:
        """The same with one key frame less to try, for a part of a group that was tried as a whole."""
        return replace(self, keys=max(1, self.keys - 1), canonical_keys=1)


@dataclass(frozen=True, slots=True)
class Trial:
    """How well the mesh made in one pose fits the frames when it is sent back to them."""

    frame: int  # whose centers are the pose, or MDS
    key: int  # the frame whose surface was taken first
    rms: float  # symmetric surface distance after a quick fit, mean over the frames tried, in units of the vertices
    worst: float  # the same of the worst frame


@dataclass(frozen=True, slots=True)
class Reference:
    """The reference mesh, the pose of the centers that it lies in, and why that pose."""

    mesh: Mesh
    pose: Float64[np.ndarray, "K 3"]
    frame: int  # whose centers are the pose, or MDS
    key: int  # the frame whose surface was taken first
    neighbours: Neighbours
    stress: float  # of the MDS pose, eq. 5
    trials: tuple[Trial, ...]  # what the pose was chosen from


def extract_reference(frames: Sequence[Mesh], centers: Centers, options: ReferenceOptions) -> Reference:
    """The reference of a group, in the pose that fits best; empty where all frames are."""
    assert len(frames) == len(centers), "one pose of the centers for each frame"
    distances = largest_distances(centers)
    kin = neighbours(affinity(distances, options.centers), options.deform)
    full = np.array([t for t, frame in enumerate(frames) if not frame.is_empty], dtype=int)
    if len(full) == 0:
        return Reference(Mesh.empty(), centers.positions[0], 0, 0, kin, 0.0, ())
    group = Group([frames[t] for t in full], centers.positions[full], distances, kin, (options.deform, options.fuse))
    canonical = reference_centers(distances, group.positions[len(full) // 2], options.centers)
    trials = _trials(group, canonical.positions, options)
    best = _best(trials, options)
    pose = canonical.positions if best.frame == MDS else group.positions[best.frame]
    mesh = group.fused(pose, best.key, options.fuse.poisson.depth, options.vertices)
    trials = tuple(
        replace(trial, frame=MDS if trial.frame == MDS else int(full[trial.frame]), key=int(full[trial.key]))
        for trial in trials
    )
    best = _best(trials, options)
    return Reference(mesh, pose, best.frame, best.key, kin, canonical.stress, trials)


def predict(reference: Reference, mesh: Mesh, centers: Centers, options: DeformOptions) -> Float64[np.ndarray, "T V 3"]:
    """Where the vertices of a mesh in the reference pose (the decoded, subdivided one, say) are in each frame."""
    binding = bind(mesh, reference.pose, reference.neighbours, options)
    kin = reference.neighbours
    motions = (center_motions(reference.pose, pose, kin) for pose in centers.positions)
    return np.stack([move(mesh.vertices, binding, each, kin) for each in motions])


def _trials(group: Group, canonical: Float64[np.ndarray, "K 3"], options: ReferenceOptions) -> tuple[Trial, ...]:
    """Some frames' own poses, each with its own surface first; then the MDS pose with the best of these surfaces."""
    targets = [Target(frame) for frame in group.frames]
    count = min(options.keys, len(group.frames))
    keys = sorted({int(key) for key in (np.arange(count) + 0.5) * len(group.frames) / count})
    trials = [_trial(group, targets, (key, key), group.positions[key], options) for key in keys]
    if len(group.frames) > 1:
        best = sorted(trials, key=_misfit)[: options.canonical_keys]
        trials += [_trial(group, targets, (MDS, trial.key), canonical, options) for trial in best]
    return tuple(trials)


def _trial(
    group: Group,
    targets: list[Target],
    names: tuple[int, int],
    pose: Float64[np.ndarray, "K 3"],
    options: ReferenceOptions,
) -> Trial:
    """A quick reference in this pose, fitted to some frames, the first and the last among them, and what is left."""
    frame, key = names
    if len(targets) == 1:
        return Trial(frame, key, 0.0, 0.0)  # nothing to choose from
    mesh = group.fused(pose, key, options.trial_depth, min(options.vertices, options.trial_vertices))
    if mesh.is_empty:
        return Trial(frame, key, np.inf, np.inf)
    tried = sorted({key, *np.linspace(0, len(targets) - 1, options.trial_frames).round().astype(int).tolist()})
    some = [targets[t] for t in tried]
    fitted = fit_targets(mesh.faces, group.sent(mesh, pose)[tried], some, replace(TRIAL_FIT, key=tried.index(key)))
    rms = []
    for target, moved in zip(some, fitted, strict=True):
        original = target.mesh.vertices
        there = _gaps(Surface(Mesh(moved, mesh.faces)), original[:: max(1, len(original) // PROBES)])
        back = _outside(target.surface, moved, group.edge)
        rms.append(max(np.sqrt(np.mean(there**2)), np.sqrt(np.mean(back**2))))
    return Trial(frame, key, float(np.mean(rms)), float(np.max(rms)))


def _best(trials: Sequence[Trial], options: ReferenceOptions) -> Trial:
    """The trial that fits best; displacements from the MDS pose lie in more components, so it must gain something."""
    return min(trials, key=lambda trial: _misfit(trial) / (options.canonical_gain if trial.frame == MDS else 1.0))


def _misfit(trial: Trial) -> float:
    return trial.rms + trial.worst


def _outside(surface: Surface, points: Float64[np.ndarray, "N 3"], most: float) -> Float64[np.ndarray, " N"]:
    """Distances to a surface, those of points inside it at `most`: where bodies touch, the frame has no surface
    between them, and a good reference has.
    """
    hits = surface.closest(points)
    offset = points - hits.points
    gaps = np.linalg.norm(offset, axis=1)
    inside = np.einsum("nd,nd->n", offset, surface.normals[hits.faces]) < 0
    return np.where(inside, np.minimum(gaps, most), gaps)


def _gaps(surface: Surface, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    return np.linalg.norm(surface.closest(points).points - points, axis=1)
