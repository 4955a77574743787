"""Frames prepared for fits, with samples along their open borders, and the distance of a fitted template from them.

Point-to-plane rows leave the position across a border free: without samples there, a template that is too small or too
large at a rim (soles cut off at the floor, sleeves, the edge of a camera's view) stays so, and those few vertices carry
most of the error: 3.5 dB on a captured dancer. The distance decides keys and cuts. It is RMS, the larger of both
directions, since either alone misses surface that the other lacks; infinite if a template is wrong: if more surface of
a clean frame than usual has no counterpart, or one that faces away (folds, shards turned inside out).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from ... import _core
from ...geometry.closest_points import Hits, MovingSurface, Surface, area_samples
from ...geometry.depth import FreeSpace
from ...geometry.topology import border_edges, border_mask, face_normals, unique_edges, vertex_normals
from ...types import Mesh

Points = Float64[np.ndarray, "N 3"]
Array = Float64[np.ndarray, " _"]
ON_BORDER = 1e-6  # points of a surface with an interpolated `inside` up to this lie on an open border: rounding
EDGE_SAMPLES = 8  # per border edge: a guess; sliding along the border is free, so a finer search gains nothing
SAMPLES = 4000  # of each surface: as many as tracking matches
STRAY = 6.0  # RMS distances of the noise: samples farther off are surface that the other side lacks: a guess
SHARED = 0.4  # least share of the samples of each surface that noisy frames have in common (guess)
FAR = 0.006  # diagonals: samples farther off have no counterpart (1 cm on a body; decision 24), unless within
FAR_OFF = 4.0  # distances to reach (guess)
WRONG = 0.03  # share of samples beyond the usual share: visible folds; good fits have up to .012 (decision 24)


class FrameSurface:
    """A frame prepared for matching: search structure, vertex normals, and which vertices are on no open border."""

    def __init__(self, mesh: Mesh, free: FreeSpace | None = None, uneven: Array | None = None) -> None:
        """`free`: the space that cameras saw through in the frame, if known.

        `uneven`: the noise of each vertex, in units of the RMS noise of the frames; None: the same everywhere.
        """
        self.mesh, self.free = mesh, free
        self.uneven = uneven
        self.surface = Surface(mesh)
        self.normals = vertex_normals(mesh)
        self.inside = np.ones(len(mesh.vertices), bool)
        self.inside[border_edges(mesh).reshape(-1)] = False
        self._samples: dict[int, Int64[np.ndarray, " S"]] = {}
        self._sampled = dict[int, _core.DeformTarget]()

    def inside_at(self, hits: Hits) -> Float64[np.ndarray, " N"]:
        """Interpolate 1 for vertices inside and 0 for those on open borders at points of the surface."""
        return np.einsum("nk,nk->n", hits.barycentric, self.inside[self.mesh.faces[hits.faces]])

    def gaps(
        self, hits: Hits, points: Points, near: Int64[np.ndarray, " M"], back: Float64[np.ndarray, "M 3"]
    ) -> tuple[Array, Array]:
        """Return squared distances of points from their `hits` on the frame, and of vertices `near` from points `back`.

        They are in units of the square of the noise there, relative to all noise.
        """
        ahead, behind = ((hits.points - points) ** 2).sum(axis=1), ((back - self.mesh.vertices[near]) ** 2).sum(axis=1)
        if self.uneven is None:
            return ahead, behind
        return ahead / self.uneven[self.mesh.faces[hits.faces]].mean(axis=1) ** 2, behind / self.uneven[near] ** 2

    def samples(self, count: int) -> Int64[np.ndarray, " S"]:
        """Return about `count` vertices, spread evenly over the area."""
        if count not in self._samples:
            self._samples[count] = area_samples(self.mesh, count)
        return self._samples[count]

    def sampled(self, count: int) -> _core.DeformTarget:
        """Return the frame with about `count` samples, as the core's embedded deformation takes it."""
        if count not in self._sampled:
            samples, spacing = self.samples(count), float(np.sqrt(self.surface.areas.sum() / count))
            samples = samples[self.inside[samples]]
            points, normals = self.mesh.vertices[samples], self.normals[samples]
            whole = (self.surface.tree, self.mesh.vertices, self.mesh.faces, self.normals, self.inside.view(np.uint8))
            self._sampled[count] = _core.DeformTarget(*whole, points, normals, spacing)
        return self._sampled[count]

    @cached_property
    def target(self) -> _core.FitTarget:
        whole = (self.surface.tree, self.mesh.vertices, self.mesh.faces, self.normals, self.inside.view(np.uint8))
        return _core.FitTarget(*whole, *sample_border(self.mesh))


def border_sides(faces: Int32[np.ndarray, "F 3"]) -> tuple[Int64[np.ndarray, " E"], Int64[np.ndarray, " E"]]:
    """Find the half-edges that no second face shares: the face of each, and the corner where it starts."""
    edges, of_faces = unique_edges(faces)
    face_numbers, sides = np.nonzero(border_mask(edges, of_faces)[of_faces])
    return face_numbers, sides


def sample_border(mesh: Mesh) -> tuple[Points, Points, Points]:
    """Place `EDGE_SAMPLES` evenly spaced points on each border edge, in order.

    Return them, the normals of their faces, and the directions in the faces' planes away from the surface.
    """
    faces, sides = border_sides(mesh.faces)
    ends = mesh.vertices[mesh.faces[faces]]
    pick = np.arange(len(faces))
    start, end = ends[pick, sides], ends[pick, (sides + 1) % 3]
    along = end - start
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
    normals = face_normals(Mesh(mesh.vertices, mesh.faces[faces]))[0]
    outward = np.cross(along, normals)  # counter-clockwise faces lie to the left of their edges
    share = (np.arange(EDGE_SAMPLES) + 0.5) / EDGE_SAMPLES
    points = start[:, None] + share[:, None] * (end - start)[:, None]
    return points.reshape(-1, 3), normals.repeat(EDGE_SAMPLES, axis=0), outward.repeat(EDGE_SAMPLES, axis=0)


def shared_distance(
    squares: tuple[Float64[np.ndarray, " N"], Float64[np.ndarray, " M"]],
    over: tuple[Bool[np.ndarray, " N"], Bool[np.ndarray, " M"]],
    noise: float,
) -> float:
    """Return the RMS distance, the larger of both directions, of the surface that two noisy surfaces have in common.

    `squares` are squared distances of samples of each from the other; `over` is True where a sample lies over the
    other surface, not past its border. Surface that one side lacks says nothing about the motion of the rest; infinite
    only if too little is shared.
    """
    shared = [each[inside & (each <= (STRAY * noise) ** 2)] for each, inside in zip(squares, over, strict=True)]
    if any(len(part) < max(SHARED * inside.sum(), 1) for part, inside in zip(shared, over, strict=True)):
        return np.inf
    return float(np.sqrt(max(part.mean() for part in shared)))


class Closeness:
    """A template prepared for measuring its distance from frames."""

    def __init__(self, template: Mesh, target: float, noise: float = 0.0) -> None:
        """`target` is the distance to reach, `noise` the RMS distance of the frames from the truth.

        With noise, holes of the frames do not count.
        """
        self._surface, self._samples, self._noise = MovingSurface(template), area_samples(template, SAMPLES), noise
        self._far = max(FAR, FAR_OFF * target)
        self.usual = 1.0  # share without counterpart in the best fit: gear wheels in mesh face each other

    def of(self, positions: Float64[np.ndarray, "V 3"], frame: FrameSurface) -> float:
        """Return the RMS distance between the template at these positions and a frame; infinite where it is wrong."""
        chosen = frame.samples(SAMPLES)
        template, frame_points = positions[self._samples], frame.mesh.vertices[chosen]
        to_frame = frame.surface.closest(template)
        with self._surface.at(positions) as fitted:
            to_fit, normals = fitted.closest(frame_points), vertex_normals(fitted.mesh)[self._samples]
            fit_normals, frame_normals = fitted.normals[to_fit.faces], frame.surface.normals[to_frame.faces]
            beside = fitted.past_border(to_fit) if self._noise > 0 else None
        back, ahead = frame.gaps(to_frame, template, chosen, to_fit.points)
        if beside is not None:  # holes of noisy frames do not call for another template
            inside = frame.inside_at(to_frame) > ON_BORDER, ~beside
            return shared_distance((back, ahead), inside, self._noise)
        wrong = (np.einsum("nd,nd->n", normals, frame_normals) < 0) | (back > self._far**2)
        lacking = (np.einsum("nd,nd->n", frame.normals[chosen], fit_normals) < 0) | (ahead > self._far**2)
        share = float(max(wrong.mean(), lacking.mean()))
        self.usual = min(self.usual, share)
        if share > self.usual + WRONG:
            return np.inf
        return float(np.sqrt(max(back.mean(), ahead.mean())))
