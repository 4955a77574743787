"""Slide a fitted template along the surface until its colours agree with those of its key frame.

In: positions of a template on a frame, the source of the frame's colours, the template's luma in the key frame. Out:
positions with tangential offsets of a fraction of an edge in each round. Shape alone does not determine how a flat or
round surface slid; texture does. Without texture, vertices follow their neighbours, or stay.

Optical flow by B. K. P. Horn and B. G. Schunck, *Determining Optical Flow* (1981), on a mesh in place of a picture: the
colours are compared at the vertices of a finer mesh, whose offsets are those of the template between its vertices.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int32

from ...geometry import work
from ...geometry.color_views import Paint
from ...geometry.strict import inverses
from ...geometry.topology import face_normals, subdivide, unique_edges, vertex_normals
from ...types import LUMA, Mesh

Points = Float64[np.ndarray, "V 3"]  # of the template
Luma = Float64[np.ndarray, " N"]  # at the vertices of the finer mesh, 0 to 255
ITERATIONS = 40  # of the flow in each round: as near to its end as 160 without acceleration
SLOWEST = 0.995  # factor by which an iteration without acceleration would lower the slowest error that counts (guess)
LIGHT = 40  # blurs whose result is light, not texture; with 15 or 120, .3 dB worse on basketball_player
LEVELS = 2  # midpoint subdivisions, at most, to the mesh at whose vertices colours are compared (guess)
BLURS = (12, 4, 1, 1)  # blurs of the luma over that mesh, in each round, after all of `LEVELS` (guess)
CONTRAST = 12.0  # luma per edge of that mesh after all of `LEVELS`, 0 to 255: weaker slopes count less (guess)
MOST = 0.7  # edges of the template, largest motion of a vertex in a round (guess)


class Slide:
    """A template of constant connectivity, with its luma in the key frame."""

    def __init__(self, faces: Int32[np.ndarray, "F 3"], key: Points, paint: Paint) -> None:
        """Take the template's positions on the key frame, and the source of that frame's colours."""
        from scipy.sparse import eye_array, kron

        self._faces = faces
        self._around = kron(_means_over(faces, len(key)), eye_array(3), format="csr")  # of offsets
        pixels = paint.pixels_on(Mesh(key, faces))  # a finer mesh shows no more
        self._levels = next((level for level in range(LEVELS) if 4**level * len(key) >= pixels), LEVELS)
        self._finer, self._finer_faces = _finer(faces, len(key), self._levels)  # interpolates vertices
        self._vectors = kron(self._finer, eye_array(3), format="csr")  # the same for vectors
        self._gather = self._finer.T.tocsr()
        self._shares = self._gather @ np.ones(self._finer.shape[0])
        self._blur = _means_over(self._finer_faces, self._finer.shape[0])
        self._luma, self._known = self._texture(self._sampled(key), paint)

    def to(self, positions: Points, paint: Paint) -> Points:
        """Return the positions on a frame, slid so that its colours agree with the key frame's."""
        work.passed("slide")
        slid = positions
        for blurs in map(self._times, BLURS):
            mesh = self._sampled(slid)
            slid = slid + self._flow(slid, mesh, *self._texture(mesh, paint), blurs)
        return slid

    def _times(self, blurs: int) -> int:
        """Return how often to blur over edges that are longer than at `LEVELS`, to reach as far."""
        return max(1, round(blurs / 4 ** (LEVELS - self._levels)))

    def _sampled(self, positions: Points) -> Mesh:
        """Return the finer mesh at whose vertices colours are compared."""
        return Mesh(self._finer @ positions, self._finer_faces)

    def _texture(self, mesh: Mesh, paint: Paint) -> tuple[Luma, Bool[np.ndarray, " N"]]:
        """Return the luma at the finer mesh's vertices without lighting, and a mask of known values."""
        colors, seen = paint.at(mesh.vertices, vertex_normals(mesh))
        luma = np.where(seen, (colors * np.array(LUMA)).sum(axis=1), 0.0)
        light, around = luma, seen.astype(np.float64)
        for _ in range(self._times(LIGHT)):
            light, around = self._blur @ light, self._blur @ around
        return np.where(seen, luma - light / np.maximum(around, 1e-9), 0.0), seen

    def _flow(self, positions: Points, mesh: Mesh, luma: Luma, known: Bool[np.ndarray, " N"], blurs: int) -> Points:
        """Return tangential offsets of the template that bring the luma of the frame nearer to that of the key frame.

        They minimise squared differences of luma and from the neighbours' offsets, by Jacobi iterations whose bound on
        the normal equations is a 3 x 3 block per vertex, accelerated after Chebyshev (Golub and Varga 1961).
        """
        from scipy.sparse import csr_array, diags_array

        shared = (known & self._known).astype(np.float64)
        key_luma, frame_luma = self._luma, luma
        for _ in range(blurs):
            key_luma, frame_luma = self._blur @ key_luma, self._blur @ frame_luma
        edge = float(np.sqrt(face_normals(mesh)[1].mean() * 4 / np.sqrt(3)))  # of an equilateral triangle of mean area
        gaps, stiff = (frame_luma - key_luma) * shared, (CONTRAST * 2 ** (LEVELS - self._levels)) ** 2
        slopes = _tangential(_slopes(mesh, frame_luma), vertex_normals(mesh)) * shared[:, None] * edge
        blocks = self._mean((slopes[:, :, None] * slopes[:, None]).reshape(-1, 9)).reshape(-1, 3, 3)
        rows = np.arange(len(slopes)).repeat(3)
        along = csr_array((slopes.reshape(-1), (rows, np.arange(slopes.size))), shape=(len(slopes), slopes.size))
        at_template = along @ self._vectors
        normal = diags_array(1 / self._shares.repeat(3)) @ (at_template.T @ at_template)  # each row over its share
        solve = _blocks(inverses(blocks + stiff * np.eye(3)))
        step = (solve @ (_blocks(blocks) + stiff * self._around - normal)).tobsr((3, 3))
        start = solve @ self._mean(slopes * gaps[:, None]).reshape(-1)
        flow, before = -start, np.zeros(positions.size)  # edges of the finer mesh
        more = 2.0  # of Chebyshev's steps
        for _ in range(ITERATIONS - 1):
            more = 1 / (1 - SLOWEST**2 * more / 4)
            flow, before = more * (step @ flow - start - before) + before, flow
        flow = _tangential(flow.reshape(-1, 3), vertex_normals(Mesh(positions, self._faces)))
        length, most = np.sqrt((flow**2).sum(axis=1, keepdims=True)), MOST * 2**self._levels
        return flow * np.minimum(1.0, most / np.maximum(length, 1e-12)) * edge

    def _mean(self, values: Float64[np.ndarray, "N C"]) -> Float64[np.ndarray, "V C"]:
        """Return the means of values at the finer mesh's vertices around each vertex of the template."""
        return (self._gather @ values) / self._shares[:, None]


def _blocks(matrices: Float64[np.ndarray, "V 3 3"]) -> Any:
    """Return the sparse matrix of these blocks along its diagonal."""
    from scipy.sparse import bsr_array

    return bsr_array((matrices, np.arange(len(matrices)), np.arange(len(matrices) + 1)))


def _tangential(vectors: Points, normals: Points) -> Points:
    return vectors - normals * (vectors * normals).sum(axis=1, keepdims=True)


def _slopes(mesh: Mesh, values: Float64[np.ndarray, " V"]) -> Points:
    """Return the gradient of vertices' values along the surface, the mean over the faces at each vertex."""
    normals, areas = face_normals(mesh)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    va, vb, vc = values[mesh.faces].T[..., None]
    turned = np.cross(normals, va * (c - b) + vb * (a - c) + vc * (b - a)) / 2  # area times the gradient
    corners, count = mesh.faces.reshape(-1), len(mesh.vertices)
    sums = np.stack([np.bincount(corners, turned[:, k].repeat(3), count) for k in range(3)], axis=1)
    total_area = np.bincount(corners, areas.repeat(3), count)
    return sums / np.maximum(total_area, 1e-30)[:, None]


def _means_over(faces: Int32[np.ndarray, "F 3"], count: int) -> Any:
    """Return the sparse matrix that replaces values of vertices by means over each and its neighbours."""
    from scipy.sparse import csr_array

    edges = unique_edges(faces)[0]
    rows = np.concatenate([edges[:, 0], edges[:, 1], np.arange(count)])
    columns = np.concatenate([edges[:, 1], edges[:, 0], np.arange(count)])
    degrees = np.bincount(rows, minlength=count)
    return csr_array((1.0 / degrees[rows], (rows, columns)), shape=(count, count))


def _finer(faces: Int32[np.ndarray, "F 3"], count: int, levels: int) -> tuple[Any, Int32[np.ndarray, "G 3"]]:
    """Return the sparse matrix of midpoint subdivisions of values at vertices, and the finer faces."""
    from scipy.sparse import csr_array, eye_array, vstack

    matrix = eye_array(count, format="csr")
    for _ in range(levels):
        level = subdivide(faces, matrix.shape[0])
        rows, shape = np.arange(len(level.edges)).repeat(2), (len(level.edges), matrix.shape[0])
        middles = csr_array((np.full(len(rows), 0.5), (rows, level.edges.reshape(-1))), shape=shape)
        matrix, faces = vstack([matrix, middles @ matrix], format="csr"), level.faces
    return matrix, faces
