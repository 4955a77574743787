"""Slide a fitted template along the surface until it shows at each vertex what it showed there in its key frame.

In: positions of a template on a frame, what knows the frame's colours, the luma that its vertices had in the key frame.
Out: positions whose offsets are tangential, of a fraction of an edge in each round. Shape alone does not tell where a
flat or round surface has slid; texture does. Where there is none, vertices follow their neighbours, or stay.

Optical flow by B. K. P. Horn and B. G. Schunck, *Determining Optical Flow* (1981), on a mesh in place of a picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int32

from ...errors import InputError
from ...geometry.painted import Paint
from ...geometry.topology import face_normals, unique_edges, vertex_normals
from ...types import LUMA, Mesh

ITERATIONS = 60  # of the flow in each round: 60 edges far (guess)
LIGHT = 12  # blurs whose result is light, not texture (guess)


@dataclass(frozen=True, slots=True)
class SlideOptions:
    """Options of the slide; the values are guesses, tried on basketball_player."""

    blurs: tuple[int, ...] = (4, 2, 1)  # of the luma over neighbours, in each round
    contrast: float = 12.0  # luma an edge, 0 to 255: less than this is followed less
    most: float = 0.7  # edges, that a vertex moves in a round

    def __post_init__(self) -> None:
        if min(self.blurs, default=0) < 0 or self.contrast <= 0 or self.most <= 0:
            raise InputError(f"blurs {self.blurs}, contrast {self.contrast}, most {self.most}: give >= 0, > 0 and > 0")


class Slide:
    """A template of constant connectivity, with the luma that each vertex shows in the key frame."""

    def __init__(
        self,
        faces: Int32[np.ndarray, "F 3"],
        key: Float64[np.ndarray, "V 3"],
        paint: Paint,
        options: SlideOptions = SlideOptions(),
    ) -> None:
        """Take the template as it lies on the key frame, and what knows the colours of that."""
        self._faces, self._options, self._means = faces, options, _means_over(faces, len(key))
        self._luma, self._known = self._texture(Mesh(key, faces), paint)

    def to(self, positions: Float64[np.ndarray, "V 3"], paint: Paint) -> Float64[np.ndarray, "V 3"]:
        """Return the positions on a frame, slid to where its colours are those of the key frame."""
        found = positions
        for blurs in self._options.blurs:
            mesh = Mesh(found, self._faces)
            found = found + self._flow(mesh, *self._texture(mesh, paint), blurs)
        return found

    def _texture(self, mesh: Mesh, paint: Paint) -> tuple[Float64[np.ndarray, " V"], Bool[np.ndarray, " V"]]:
        """Return the luma at a mesh's vertices without that of the light, and where it is known.

        It is the mean of those at a vertex and at the middles of its faces: else fine patterns would alias.
        """
        normals = face_normals(mesh)[0]
        places = np.concatenate([mesh.vertices, mesh.vertices[mesh.faces].mean(axis=1)])
        colors, known = paint.at(places, np.concatenate([vertex_normals(mesh), normals]))
        count, luma = len(mesh.vertices), (colors * np.array(LUMA)).sum(axis=1)
        sums, weights = luma * known, known.astype(np.float64)
        corners = mesh.faces.reshape(-1)
        whole, some = (
            values[:count] + np.bincount(corners, values[count:].repeat(3), count) for values in (sums, weights)
        )
        seen = known[:count]
        found = np.where(seen, whole / np.maximum(some, 1), 0.0)
        light, around = found, seen.astype(np.float64)
        for _ in range(LIGHT):
            light, around = self._means @ light, self._means @ around
        return np.where(seen, found - light / np.maximum(around, 1e-9), 0.0), seen

    def _flow(
        self, mesh: Mesh, luma: Float64[np.ndarray, " V"], known: Bool[np.ndarray, " V"], blurs: int
    ) -> Float64[np.ndarray, "V 3"]:
        """Return tangential offsets that bring the luma of the frame nearer to that of the key frame."""
        both = (known & self._known).astype(np.float64)
        wanted, there = self._luma, luma
        for _ in range(blurs):
            wanted, there = self._means @ wanted, self._means @ there
        slopes, edge, normals = _slopes(mesh, there), _edge(mesh), vertex_normals(mesh)
        slopes = _tangential(slopes, normals) * both[:, None] * edge  # luma an edge
        energy = (slopes**2).sum(axis=1)
        weights, gaps = 1 / (self._options.contrast**2 + energy), (there - wanted) * both
        flow = np.zeros_like(mesh.vertices)  # edges
        for _ in range(ITERATIONS):
            around = self._means @ flow
            flow = around - slopes * ((slopes * around).sum(axis=1) + gaps)[:, None] * weights[:, None]
        flow = _tangential(flow, normals)
        sure = energy
        for _ in range(2 * LIGHT):
            sure = self._means @ sure
        flow *= (sure / (sure + self._options.contrast**2))[:, None]
        length = np.sqrt((flow**2).sum(axis=1, keepdims=True))
        return flow * np.minimum(1.0, self._options.most / np.maximum(length, 1e-12)) * edge


def _tangential(vectors: Float64[np.ndarray, "V 3"], normals: Float64[np.ndarray, "V 3"]) -> Float64[np.ndarray, "V 3"]:
    return vectors - normals * (vectors * normals).sum(axis=1, keepdims=True)


def _edge(mesh: Mesh) -> float:
    """Return the usual length of an edge: the side of an equilateral triangle of the mean area."""
    return float(np.sqrt(face_normals(mesh)[1].mean() * 4 / np.sqrt(3)))


def _slopes(mesh: Mesh, values: Float64[np.ndarray, " V"]) -> Float64[np.ndarray, "V 3"]:
    """Return the gradient of values of the vertices along the surface, the mean over the faces at each vertex."""
    normals, areas = face_normals(mesh)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    va, vb, vc = values[mesh.faces].T[..., None]
    turned = np.cross(normals, va * (c - b) + vb * (a - c) + vc * (b - a)) / 2  # area times the gradient
    corners, count = mesh.faces.reshape(-1), len(mesh.vertices)
    sums = np.stack([np.bincount(corners, turned[:, k].repeat(3), count) for k in range(3)], axis=1)
    whole = np.bincount(corners, areas.repeat(3), count)
    return sums / np.maximum(whole, 1e-30)[:, None]


def _means_over(faces: Int32[np.ndarray, "F 3"], count: int) -> Any:
    """Return the sparse matrix that replaces values of vertices by means over each and its neighbours."""
    from scipy.sparse import csr_array

    edges = unique_edges(faces)[0]
    rows = np.concatenate([edges[:, 0], edges[:, 1], np.arange(count)])
    columns = np.concatenate([edges[:, 1], edges[:, 0], np.arange(count)])
    degrees = np.bincount(rows, minlength=count)
    return csr_array((1.0 / degrees[rows], (rows, columns)), shape=(count, count))
