"""The reference mesh of a group: one surface, free of contact, that every frame can be told from (section 3.3.2).

In: the frames and their tracked centers. All frames are deformed to one pose of the centers, their points are fused by
Poisson and decimated. The pose, MDS or a frame's own, is the one whose mesh, sent back, fits the frames best.

Differs from the paper: it takes the MDS pose always. Faces that tear on the way, or join parts that are apart in some
frame, are cut; surface far from all data is not invented.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float32, Float64

from ..errors import InputError
from ..geometry.decimate import decimate
from ..geometry.nearest import Surface
from ..geometry.poisson import PoissonOptions, drop_small, reconstruct, thin_out
from ..geometry.topology import clean, components, subdivide_midpoint, unique_edges, vertex_normals
from ..types import Centers, Mesh
from .deform import Binding, DeformOptions, Neighbours, bind, center_motions, move, move_normals, neighbours
from .reference_centers import (
    ReferenceCenterOptions,
    affinity,
    center_spacing,
    largest_distances,
    reference_centers,
)

MDS = -1  # in place of a frame's number: the pose is that of eq. 5


@dataclass(frozen=True, slots=True)
class ReferenceOptions:
    """How the reference mesh is made; lengths in mean edges of the frames' meshes."""

    vertices: int = 3000  # of the reference mesh
    subdivisions: int = 1  # midpoint rounds that make each frame's points dense
    cell: float = 0.5  # points of all frames are averaged in cells of this size
    reach: float = 3.0  # no surface farther than this from a point of some frame
    torn: float = 3.0  # a length that grows by this factor (beyond one center spacing) tears
    smallest: float = 0.01  # connected bits with less than this share of the largest one's faces are dropped
    frame_poses: int = 3  # frames whose own centers are tried as the pose besides MDS
    probe_depth: int = 7  # Poisson depth for the trials
    poisson: PoissonOptions = field(default_factory=PoissonOptions)
    centers: ReferenceCenterOptions = field(default_factory=ReferenceCenterOptions)
    deform: DeformOptions = field(default_factory=DeformOptions)

    def __post_init__(self) -> None:
        if self.vertices < 4 or self.subdivisions < 0 or self.frame_poses < 0:
            raise InputError(
                f"vertices {self.vertices}, subdivisions {self.subdivisions}, frame_poses {self.frame_poses}: "
                "give >= 4, >= 0 and >= 0"
            )
        if not (self.cell > 0 and self.reach > 0 and self.torn > 1):
            raise InputError(f"cell {self.cell}, reach {self.reach}, torn {self.torn}: give > 0, > 0 and > 1")


@dataclass(frozen=True, slots=True)
class Trial:
    """How well the mesh made in one pose fits the frames when it is sent back to them."""

    frame: int  # whose centers are the pose, or MDS
    rms: float  # symmetric surface distance, mean over frames, in units of the vertices
    tail: float  # the same of the 95 % distance


@dataclass(frozen=True, slots=True)
class Reference:
    """The reference mesh, the pose of the centers that it lies in, and why that pose."""

    mesh: Mesh
    pose: Float64[np.ndarray, "K 3"]
    frame: int  # whose centers are the pose, or MDS
    neighbours: Neighbours
    stress: float  # of the MDS pose, eq. 5
    trials: tuple[Trial, ...]


def extract_reference(frames: Sequence[Mesh], centers: Centers, options: ReferenceOptions) -> Reference:
    """The reference of a group, in the pose that fits best; empty where all frames are."""
    assert len(frames) == len(centers), "one pose of the centers for each frame"
    distances = largest_distances(centers)
    kin = neighbours(affinity(distances, options.centers), options.deform)
    full = [t for t, frame in enumerate(frames) if not frame.is_empty]
    if not full:
        return Reference(Mesh.empty(), centers.positions[0], 0, kin, 0.0, ())
    group = _Group([frames[t] for t in full], centers.positions[full], distances, kin, options)
    middle = full[len(full) // 2]
    canonical = reference_centers(distances, centers.positions[middle], options.centers)
    poses = {MDS: canonical.positions} if len(full) > 1 else {}
    poses |= {t: centers.positions[t] for t in _spread(full, max(options.frame_poses, not poses))}
    trials = tuple(group.trial(t, pose) for t, pose in poses.items()) if len(poses) > 1 else ()
    frame = min(trials, key=lambda trial: trial.rms + trial.tail).frame if trials else next(iter(poses))
    mesh = group.fused(poses[frame], options.poisson.depth, options.vertices)
    return Reference(mesh, poses[frame], frame, kin, canonical.stress, trials)


def predict(reference: Reference, mesh: Mesh, centers: Centers, options: DeformOptions) -> Float64[np.ndarray, "T V 3"]:
    """Where the vertices of a mesh in the reference pose (the decoded, subdivided one, say) are in each frame."""
    binding = bind(mesh, reference.pose, reference.neighbours, options)
    return np.stack(
        [
            move(
                mesh.vertices, binding, center_motions(reference.pose, pose, reference.neighbours), reference.neighbours
            )
            for pose in centers.positions
        ]
    )


class _Group:
    """The frames of a group with what does not depend on the pose tried: bindings, tears and surfaces."""

    def __init__(
        self,
        frames: list[Mesh],
        positions: Float64[np.ndarray, "T K 3"],
        distances: Float32[np.ndarray, "K K"],
        kin: Neighbours,
        options: ReferenceOptions,
    ) -> None:
        self.frames, self.positions, self.kin, self.options = frames, positions, kin, options
        self.distances, self.spacing = distances, center_spacing(distances)
        self.edge = float(np.mean([_mean_edge(frame) for frame in frames]))
        self.bindings = [bind(f, p, kin, options.deform) for f, p in zip(frames, positions, strict=True)]
        self.normals = [vertex_normals(frame) for frame in frames]
        self.whole = [~self.parting(*each) for each in zip(frames, self.bindings, positions, strict=True)]
        self.surfaces = [Surface(frame) for frame in frames]

    def parting(self, mesh: Mesh, binding: Binding, pose: Float64[np.ndarray, "K 3"]) -> Bool[np.ndarray, " F"]:
        """Faces that join centers which are far more apart in some frame than in this pose."""
        edges, face_edges = unique_edges(mesh.faces)
        i, j = binding.nearest[edges].T
        now = np.linalg.norm(pose[i] - pose[j], axis=1) + self.spacing
        return (self.distances[i, j] > self.options.torn * now)[face_edges].any(axis=1)

    def cloud(self, pose: Float64[np.ndarray, "K 3"]) -> tuple[np.ndarray, np.ndarray]:
        """Points and outward normals of all frames' surfaces in a pose, dense, torn ones left out."""
        parts = [self._moved(t, pose) for t in range(len(self.frames))]
        points, normals = (np.concatenate(each) for each in zip(*parts, strict=True))
        return thin_out(points, normals, self.options.cell * self.edge)

    def fused(self, pose: Float64[np.ndarray, "K 3"], depth: int, vertices: int) -> Mesh:
        """One mesh of all frames in a pose, with nothing far from data and no face that tears in a frame."""
        options = self.options
        poisson = replace(options.poisson, depth=depth, reach=options.reach * self.edge, smallest=options.smallest)
        mesh = decimate(reconstruct(*self.cloud(pose), poisson), vertices)
        if mesh.is_empty:
            return mesh
        binding = bind(mesh, pose, self.kin, options.deform)
        bad = self.parting(mesh, binding, pose)
        for target in self.positions:
            moved = move(mesh.vertices, binding, center_motions(pose, target, self.kin), self.kin)
            bad |= self._torn(mesh, moved)
        return drop_small(clean(Mesh.of(mesh.vertices, mesh.faces[~bad])), options.smallest)

    def trial(self, frame: int, pose: Float64[np.ndarray, "K 3"]) -> Trial:
        """A quick reference in this pose, sent back to each frame and compared with it in both directions."""
        mesh = self.fused(pose, self.options.probe_depth, min(self.options.vertices, 2000))
        if mesh.is_empty:
            return Trial(frame, np.inf, np.inf)
        binding = bind(mesh, pose, self.kin, self.options.deform)
        rms, tail = [], []
        for own, surface, target in zip(self.frames, self.surfaces, self.positions, strict=True):
            moved = move(mesh.vertices, binding, center_motions(pose, target, self.kin), self.kin)
            some = own.vertices[:: max(1, len(own.vertices) // 4000)]
            there, back = _gaps(Surface(Mesh(moved, mesh.faces)), some), _gaps(surface, moved)
            rms.append(max(np.sqrt(np.mean(there**2)), np.sqrt(np.mean(back**2))))
            tail.append(max(np.quantile(there, 0.95), np.quantile(back, 0.95)))
        return Trial(frame, float(np.mean(rms)), float(np.mean(tail)))

    def _moved(self, t: int, pose: Float64[np.ndarray, "K 3"]) -> tuple[np.ndarray, np.ndarray]:
        frame, binding = self.frames[t], self.bindings[t]
        motions = center_motions(self.positions[t], pose, self.kin)
        points = move(frame.vertices, binding, motions, self.kin)
        normals = move_normals(self.normals[t], binding, motions, self.kin)
        good = self.whole[t] & ~self._torn(frame, points)
        spoiled = np.zeros(len(points), bool)
        spoiled[frame.faces[~good]] = True
        faces = frame.faces[~spoiled[frame.faces].any(axis=1)]
        faces = faces[_large(faces, len(points), self.options.smallest)]
        if len(faces) == 0:
            return np.zeros((0, 3)), np.zeros((0, 3))
        used = np.zeros(len(points), bool)
        used[faces] = True
        faces = (np.cumsum(used) - 1)[faces]
        dense = [subdivide_midpoint(Mesh.of(a[used], faces), self.options.subdivisions) for a in (points, normals)]
        return dense[0].vertices, dense[1].vertices

    def _torn(self, mesh: Mesh, moved: Float64[np.ndarray, "V 3"]) -> Bool[np.ndarray, " F"]:
        """Faces with an edge that is far longer once moved, or was far longer before."""
        edges, face_edges = unique_edges(mesh.faces)
        one, two = (np.linalg.norm(v[edges[:, 0]] - v[edges[:, 1]], axis=1) for v in (mesh.vertices, moved))
        longest = np.maximum(one, two)
        return (longest > self.options.torn * (np.minimum(one, two) + self.spacing))[face_edges].any(axis=1)


def _large(faces: np.ndarray, count: int, share: float) -> Bool[np.ndarray, " F"]:
    """Faces of connected bits that are not tiny: a patch on the wrong body's centers is torn all round."""
    if len(faces) == 0:
        return np.zeros(0, bool)
    label = components(faces, count)[faces[:, 0]]
    size = np.bincount(label)
    return size[label] >= share * size.max()


def _gaps(surface: Surface, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    return np.linalg.norm(surface.closest(points).points - points, axis=1)


def _mean_edge(mesh: Mesh) -> float:
    edges, _ = unique_edges(mesh.faces)
    return float(np.mean(np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)))


def _spread(frames: list[int], count: int) -> list[int]:
    """`count` of the frames at even intervals, the middle one among them where the count is odd."""
    if count == 0:
        return []
    at = (np.arange(count) + 0.5) * len(frames) / count
    return sorted({frames[int(i)] for i in at})
