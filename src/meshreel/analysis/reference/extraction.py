"""Extract the reference mesh of a group: one surface without contact that deforms to every frame (paper, 3.3.2).

In: the frames and their tracked centers. Out: the mesh and the pose of the centers in which it lies.

Differs from the paper: the pose is that of MDS or of a frame, whichever mesh is nearest to the frames after a quick
surface fit; MDS must be clearly better, since displacements from it need more components (decision 6). The key frame's
surface comes first, and other frames add what it lacks. Faces that tear, or join parts that are separate in some frame,
are cut. Surfaces are joined by the mean of their signed distances, unless `poisson`, which makes surface far from all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float64, Int64

from ...geometry import work
from ...geometry.closest_points import Surface
from ...geometry.decimate import decimate
from ...geometry.reconstruct import MeanOptions, MeanSurface, close_holes, poisson_surface
from ...geometry.topology import (
    clean,
    drop_small,
    drop_unreferenced,
    edge_lengths,
    face_normals,
    large_pieces,
    subdivide_midpoint,
    unique_edges,
    vertex_normals,
)
from ...types import Centers, Mesh
from ..fit.frame import FrameSurface
from ..fit.surface_fit import FitOptions, fit_surfaces
from .centers import (
    Binding,
    Neighbours,
    Points,
    Pose,
    affinity,
    bind,
    center_motions,
    center_spacing,
    largest_distances,
    move,
    moved_to,
    neighbours,
    reference_centers,
)

MDS = -1  # stands for the pose of eq. 5 where a frame number is expected
TRIAL_FIT = FitOptions(gates=(0.024, 0.012), smoothing=(2.0, 0.7), components=0, iterations=20)  # quick: a guess
PROBES = 4000  # vertices of a frame measured in a trial: a guess
KEYS = 3  # frames tried as key, whose surface comes first and whose pose is tried (decision 6)
CANONICAL_KEYS = 2  # the best of these, tried with the MDS pose, too (decision 6)
CANONICAL_GAIN = 0.85  # the MDS pose must leave at most this share of the best frame's misfit (decision 6)
TRIAL_FRAMES = 4  # frames to which a trial is fitted (guess)
TRIAL_VOXEL = 1.0  # of a trial, in mean edges of the frames' meshes (guess)
TRIAL_VERTICES = 2000  # vertices of a trial's mesh, at most (guess)
PoseChoice = Literal["fit", "mds"]  # the pose that fits best (decision 6); that of eq. 5
Edges = tuple[Int64[np.ndarray, "E 2"], Int64[np.ndarray, "F 3"]]  # result of geometry.topology.unique_edges
VOXEL = 0.5  # mean edges of the frames' meshes, of the grid on which surfaces are joined (guess)
COVER = 0.3  # a frame adds surface where earlier ones have less than this share of its own (guess)
REACH = 2.0  # voxels: surfaces closer than this are joined to their mean (guess)
PAST = 1.5  # voxels by which pieces are continued past their borders, so that they meet (guess)
TORN = 3.0  # an edge that grows to more than this factor, plus half a center spacing, tears (guess)
SMALLEST = 0.01  # connected bits with less than this share of the largest one's faces are dropped (guess)
HOLE = 0.08  # holes with a shorter perimeter, which cuts leave, are closed; share of the mesh's diagonal (guess)


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
    misfit: float  # symmetric distance after a quick fit, mean and largest over the frames tried added, in their unit


@dataclass(frozen=True, slots=True)
class Reference:
    """Reference mesh, and the pose of the centers in which it lies."""

    mesh: Mesh
    pose: Pose
    frame: int  # frame whose centers are the pose, or MDS
    key: int  # frame whose surface comes first
    neighbours: Neighbours


def extract_reference(
    frames: Sequence[Mesh], centers: Centers, options: ReferenceOptions, pose: PoseChoice = "fit", again: bool = False
) -> Reference:
    """Extract the reference of a group, each frame of which has a surface, in the chosen pose.

    Which frame's surface comes first is chosen by the fit in any pose. Fewer poses are tried `again`, of a part of a
    group that was tried as a whole.
    """
    assert len(frames) == len(centers), "one pose of the centers for each frame"
    group = Group(frames, centers, options.poisson)
    work.passed("reference", len(frames) // 3)  # of the time that a reference takes
    best = min(_trials(group, options, pose, again), key=_misfit)
    mesh = group.fused(group.pose(best.frame), best.key, VOXEL, options.vertices)
    work.passed("reference", len(frames))
    return Reference(mesh, group.pose(best.frame), best.frame, best.key, group.kin)


def predict(reference: Reference, mesh: Mesh, centers: Centers) -> Float64[np.ndarray, "T V 3"]:
    """Deform a mesh in the reference pose, as the decoded and subdivided reference, to the pose of each frame."""
    return moved_to(mesh, reference.pose, centers.positions, reference.neighbours)


def _trials(group: Group, options: ReferenceOptions, pose: PoseChoice, again: bool) -> list[Trial]:
    """Try the poses of some key frames, each with its own surface first, then the MDS pose with the best of these.

    With `mds`, only that pose is tried, with the surface of each of them first.
    """
    count = min(max(1, KEYS - again), len(group.frames))
    keys = sorted({int(key) for key in (np.arange(count) + 0.5) * len(group.frames) / count})
    if pose == "mds":
        return [_trial(group, MDS, key, options) for key in keys]
    trials = [_trial(group, key, key, options) for key in keys]
    if len(group.frames) > 1:
        best = sorted(trials, key=_misfit)[: 1 if again else CANONICAL_KEYS]
        trials += [_trial(group, MDS, trial.key, options) for trial in best]
    return trials


def _trial(group: Group, frame: int, key: int, options: ReferenceOptions) -> Trial:
    """Make a quick reference in a pose, fit it to some frames, first and last included, and measure the misfit."""
    surfaces, pose = group.surfaces, group.pose(frame)
    if len(surfaces) == 1:
        return Trial(frame, key, 0.0)  # nothing to choose from
    mesh = group.fused(pose, key, TRIAL_VOXEL, min(options.vertices, TRIAL_VERTICES))
    if mesh.is_empty:
        return Trial(frame, key, np.inf)
    tried = sorted({key, *np.linspace(0, len(surfaces) - 1, TRIAL_FRAMES).round().astype(int).tolist()})
    frames = [surfaces[t] for t in tried]
    with work.reporting(None):  # these are no fits of the group
        fitted = fit_surfaces(mesh.faces, group.sent(mesh, pose)[tried], frames, TRIAL_FIT, tried.index(key))
    rms = []
    for frame_surface, moved in zip(frames, fitted, strict=True):
        original = frame_surface.mesh.vertices
        to_fit = Surface(Mesh(moved, mesh.faces)).distances(original[:: max(1, len(original) // PROBES)])
        hits = frame_surface.surface.closest(moved)
        offset = moved - hits.points
        gaps = np.linalg.norm(offset, axis=1)
        inside = np.einsum("nd,nd->n", offset, frame_surface.surface.normals[hits.faces]) < 0
        to_frame = np.where(inside, np.minimum(gaps, group.edge), gaps)  # where bodies touch, a frame lacks surface
        rms.append(max(np.sqrt(np.mean(to_fit**2)), np.sqrt(np.mean(to_frame**2))))
    work.passed("reference")
    return Trial(frame, key, float(np.mean(rms)) + float(np.max(rms)))


def _misfit(trial: Trial) -> float:
    """Return a trial's misfit; that of the MDS pose is raised, since it needs more components."""
    return trial.misfit / (CANONICAL_GAIN if trial.frame == MDS else 1.0)


class Group:
    """Frames with data that hold in every pose: neighbourhoods of centers, bindings, faces that join separate parts."""

    def __init__(self, frames: Sequence[Mesh], centers: Centers, poisson: int | None) -> None:
        """Bind frames to their centers; `poisson` is the depth of the paper's reconstruction, if it joins."""
        self.frames, self.positions, self.poisson = frames, centers.positions, poisson
        self.distances = largest_distances(centers)  # eq. 5's d
        self.kin, self.spacing = neighbours(affinity(self.distances)), center_spacing(self.distances)
        self.canonical = reference_centers(self.distances, self.positions[len(frames) // 2])
        self.surfaces = [FrameSurface(frame) for frame in frames]
        self.edges = [unique_edges(frame.faces) for frame in frames]
        self.edge = float(np.mean([edge_lengths(frame).mean() for frame in frames]))
        self.bindings = [bind(frame, pose, self.kin) for frame, pose in zip(frames, self.positions, strict=True)]
        self.parting = [self._parting(*each) for each in zip(self.edges, self.bindings, self.positions, strict=True)]

    def pose(self, frame: int) -> Pose:
        """Return the pose of the centers in a frame, or that of eq. 5 for `MDS`."""
        return self.canonical if frame == MDS else self.positions[frame]

    def sent(self, mesh: Mesh, pose: Pose) -> Float64[np.ndarray, "T V 3"]:
        """Deform the vertices of a mesh in this pose to each frame."""
        return moved_to(mesh, pose, self.positions, self.kin)

    def pieces(self, pose: Pose, key: int) -> list[Mesh]:
        """Return the surface in a pose in pieces: the key frame's, then pieces that it lacks from frames next to it.

        If tracking drifts, frames disagree by more than their detail, and the mean of all would be blurred.
        """
        covered, pieces = np.zeros(len(pose)), list[Mesh]()
        for t in sorted(range(len(self.frames)), key=lambda t: (abs(t - key), t)):
            frame, binding = self.frames[t], self.bindings[t]
            moved = move(frame.vertices, binding, center_motions(self.positions[t], pose, self.kin), self.kin)
            spoiled = np.zeros(len(moved), bool)
            spoiled[frame.faces[self.parting[t] | self._torn(frame.vertices, moved, self.edges[t])]] = True
            faces = frame.faces[~spoiled[frame.faces].any(axis=1)]
            faces = faces[large_pieces(faces, len(moved), SMALLEST)]  # else: bound to the wrong body's centers
            nearest = binding.nearest
            thirds = np.repeat(face_normals(Mesh(frame.vertices, faces))[1] / 3, 3)
            vertex_areas = np.bincount(faces.reshape(-1), thirds, len(nearest)).astype(np.float64)  # int if empty
            area = np.bincount(nearest, vertex_areas, len(pose))
            # Over neighbourhoods of centers, for surface passes between neighbours from frame to frame.
            around = [np.sum(each[self.kin.indices] * self.kin.affinities, axis=1) for each in (covered, area)]
            lacking = around[0] < COVER * around[1]
            covered += np.where(lacking, area, 0)
            pieces.append(drop_unreferenced(Mesh(moved, faces[lacking[nearest][faces].any(axis=1)])))
        return pieces

    def fused(self, pose: Pose, key: int, voxel: float, vertices: int) -> Mesh:
        """Make one mesh in a pose with about `vertices` vertices, no surface far from the frames', no face that tears.

        `voxel` is in mean edges of the frames' meshes.
        """
        pieces = self.pieces(pose, key)
        if self.poisson is not None:
            pieces = [subdivide_midpoint(piece) for piece in pieces]
            points = np.concatenate([piece.vertices for piece in pieces])
            normals = np.concatenate([vertex_normals(piece) for piece in pieces])
            joined = poisson_surface(points, normals, self.poisson, self.edge)
        else:
            mean = MeanSurface(voxel * self.edge, MeanOptions(reach=REACH, past=PAST))
            for piece in pieces:
                mean.add(piece)
            joined = mean.surface(1)
        mesh = decimate(drop_small(joined, SMALLEST), vertices)
        if mesh.is_empty:
            return mesh
        edges = unique_edges(mesh.faces)
        bad = self._parting(edges, bind(mesh, pose, self.kin), pose)
        for moved in self.sent(mesh, pose):
            bad |= self._torn(mesh.vertices, moved, edges)
        intact = drop_small(clean(Mesh.of(mesh.vertices, mesh.faces[~bad])), SMALLEST)
        return close_holes(intact, HOLE * mesh.diagonal)

    def _parting(self, edges: Edges, binding: Binding, pose: Pose) -> Bool[np.ndarray, " F"]:
        """Return the faces that join centers which are much farther from each other in some frame than in this pose."""
        i, j = binding.nearest[edges[0]].T
        now = np.linalg.norm(pose[i] - pose[j], axis=1)
        return (self.distances[i, j] > TORN * now + self.spacing / 2)[edges[1]].any(axis=1)

    def _torn(self, source: Points, target: Points, edges: Edges) -> Bool[np.ndarray, " F"]:
        """Return the faces with an edge that is much longer in one pose than in the other."""
        i, j = edges[0].T
        before, after = (np.linalg.norm(points[i] - points[j], axis=1) for points in (source, target))
        far = np.maximum(before, after) > TORN * np.minimum(before, after) + self.spacing / 2
        return far[edges[1]].any(axis=1)
