"""Fuse all frames of a group into one surface in one pose of the centers (paper, section 3.3.2).

In: frames, centers, a pose, a key frame. Out: the surfaces of the frames deformed to the pose, and their mean.

Differs from the paper: the key frame's surface comes first, and other frames add what it lacks; faces that tear in the
deformation, or join parts that are separate in some frame, are cut; surfaces are joined by the mean of their signed
distances, not by Poisson reconstruction, which makes surface far from all frames (`poisson` does so).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32, Int64

from ...geometry.decimate import decimate
from ...geometry.reconstruct import MeanOptions, MeanSurface, close_holes, poisson_surface
from ...geometry.rigid import apply
from ...geometry.topology import (
    clean,
    drop_small,
    drop_unreferenced,
    large_pieces,
    subdivide_midpoint,
    unique_edges,
    vertex_areas,
    vertex_normals,
)
from ...types import Mesh
from .centers import center_spacing
from .deform import Binding, Neighbours, bind, blended, center_motions, moved_to

Edges = tuple[Int64[np.ndarray, "E 2"], Int64[np.ndarray, "F 3"]]  # result of geometry.topology.unique_edges
VOXEL = 0.5  # mean edges of the frames' meshes, of the grid on which surfaces are joined (guess)
COVER = 0.3  # a frame adds surface where earlier ones have less than this share of its own (guess)
REACH = 2.0  # voxels: surfaces closer than this are joined to their mean (guess)
PAST = 1.5  # voxels by which pieces are continued past their borders, so that they meet (guess)
TORN = 3.0  # an edge that grows to more than this factor, plus half a center spacing, tears (guess)
SMALLEST = 0.01  # connected bits with less than this share of the largest one's faces are dropped (guess)
HOLE = 0.08  # holes with a shorter perimeter, which cuts leave, are closed; share of the mesh's diagonal (guess)


@dataclass(frozen=True, slots=True)
class GroupCenters:
    """Centers of some frames of a group, with the largest distances and the neighbourhoods over all its frames."""

    positions: Float64[np.ndarray, "T K 3"]
    distances: Float32[np.ndarray, "K K"]  # eq. 5's d
    kin: Neighbours


class Group:
    """Frames with data that hold in every pose: neighbourhoods of centers, bindings, faces that join separate parts."""

    def __init__(self, frames: Sequence[Mesh], centers: GroupCenters, poisson: int | None = None) -> None:
        """Bind non-empty frames to their centers; `poisson` is the depth of the paper's reconstruction, if it joins."""
        positions, kin = centers.positions, centers.kin
        self.frames, self.positions, self.kin = frames, positions, kin
        self.poisson = poisson
        self.distances, self.spacing = centers.distances, center_spacing(centers.distances)
        self.edges = [unique_edges(frame.faces) for frame in frames]
        self.edge = float(
            np.mean([_lengths(f.vertices, e).mean() for f, (e, _) in zip(frames, self.edges, strict=True)])
        )
        self.bindings = [bind(frame, pose, kin) for frame, pose in zip(frames, positions, strict=True)]
        self.parting = [self._parting(*each) for each in zip(self.edges, self.bindings, positions, strict=True)]

    def sent(self, mesh: Mesh, pose: Float64[np.ndarray, "K 3"]) -> Float64[np.ndarray, "T V 3"]:
        """Deform the vertices of a mesh in this pose to each frame."""
        return moved_to(mesh, pose, self.positions, self.kin)

    def pieces(self, pose: Float64[np.ndarray, "K 3"], key: int) -> list[Mesh]:
        """Return the surface in a pose in pieces: the key frame's, then pieces that it lacks from frames next to it.

        If tracking drifts, frames disagree by more than their detail, and the mean of all would be blurred.
        """
        covered, pieces = np.zeros(len(pose)), list[Mesh]()
        for t in sorted(range(len(self.frames)), key=lambda t: (abs(t - key), t)):
            moved, faces = self._moved(t, pose)
            nearest = self.bindings[t].nearest
            area = np.bincount(nearest, vertex_areas(Mesh(self.frames[t].vertices, faces)), len(pose))
            lacking = self._around(covered) < COVER * self._around(area)
            covered += np.where(lacking, area, 0)
            pieces.append(drop_unreferenced(Mesh(moved, faces[lacking[nearest][faces].any(axis=1)])))
        return pieces

    def fused(self, pose: Float64[np.ndarray, "K 3"], key: int, voxel: float, vertices: int) -> Mesh:
        """Make one mesh in a pose with about `vertices` vertices, no surface far from the frames', no face that tears.

        `voxel` is in mean edges of the frames' meshes.
        """
        mesh = decimate(drop_small(self._joined(self.pieces(pose, key), voxel), SMALLEST), vertices)
        if mesh.is_empty:
            return mesh
        edges = unique_edges(mesh.faces)
        bad = self._parting(edges, bind(mesh, pose, self.kin), pose)
        for moved in self.sent(mesh, pose):
            bad |= self._torn(mesh.vertices, moved, edges)
        intact = drop_small(clean(Mesh.of(mesh.vertices, mesh.faces[~bad])), SMALLEST)
        return close_holes(intact, HOLE * mesh.diagonal)

    def _joined(self, pieces: Sequence[Mesh], voxel: float) -> Mesh:
        if self.poisson is not None:
            pieces = [subdivide_midpoint(piece) for piece in pieces]
            points, normals = (
                np.concatenate(several)
                for several in ([p.vertices for p in pieces], [vertex_normals(p) for p in pieces])
            )
            return poisson_surface(points, normals, self.poisson, self.edge)
        mean = MeanSurface(voxel * self.edge, MeanOptions(reach=REACH, past=PAST))
        for piece in pieces:
            mean.add(piece)
        return mean.surface(1)

    def _moved(
        self, t: int, pose: Float64[np.ndarray, "K 3"]
    ) -> tuple[Float64[np.ndarray, "V 3"], Int32[np.ndarray, "F 3"]]:
        """Return a frame's vertices in a pose, and those of its faces that do not tear on the way."""
        frame, binding = self.frames[t], self.bindings[t]
        turns = blended(binding, center_motions(self.positions[t], pose, self.kin), self.kin)
        points = apply(turns, frame.vertices)
        spoiled = np.zeros(len(points), bool)
        spoiled[frame.faces[self.parting[t] | self._torn(frame.vertices, points, self.edges[t])]] = True
        faces = frame.faces[~spoiled[frame.faces].any(axis=1)]
        faces = faces[large_pieces(faces, len(points), SMALLEST)]  # else: bound to the wrong body's centers
        return points, faces

    def _parting(self, edges: Edges, binding: Binding, pose: Float64[np.ndarray, "K 3"]) -> Bool[np.ndarray, " F"]:
        """Return the faces that join centers which are much farther from each other in some frame than in this pose."""
        i, j = binding.nearest[edges[0]].T
        now = np.linalg.norm(pose[i] - pose[j], axis=1)
        return (self.distances[i, j] > TORN * now + self.spacing / 2)[edges[1]].any(axis=1)

    def _torn(
        self, source: Float64[np.ndarray, "V 3"], target: Float64[np.ndarray, "V 3"], edges: Edges
    ) -> Bool[np.ndarray, " F"]:
        """Return the faces with an edge that is much longer in one pose than in the other."""
        before, after = _lengths(source, edges[0]), _lengths(target, edges[0])
        far = np.maximum(before, after) > TORN * np.minimum(before, after) + self.spacing / 2
        return far[edges[1]].any(axis=1)

    def _around(self, amounts: Float64[np.ndarray, " K"]) -> Float64[np.ndarray, " K"]:
        """Sum amounts over each center's neighbourhood: surface passes between neighbours from frame to frame."""
        return np.sum(amounts[self.kin.indices] * self.kin.affinities, axis=1)


def _lengths(vertices: Float64[np.ndarray, "V 3"], edges: np.ndarray) -> Float64[np.ndarray, " E"]:
    return np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
