"""Connectivity of triangle meshes: edges, components, welding, normals and midpoint subdivision by levels.

Pure functions of vertices (V x 3) and faces (F x 3), without heavy imports: the decoder uses this file. The arithmetic
is in the core and gives the same bits everywhere; its functions raise ValueError for a face that refers to a missing
vertex. A level adds curved midpoints, and vertices placed along the normals there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import _core
from ..errors import FormatError
from ..shapes import Bool, Float64, Int32, Int64
from ..types import GREY, Mesh
from .atlas import side_by_side

Triples = Float64[np.ndarray, "N 3"]

LEAST_COSINE = 0.3  # between direction and surface normal; below it the tangent plane is useless (guess)


def unique_edges(faces: Int32[np.ndarray, "F 3"]) -> tuple[Int64[np.ndarray, "E 2"], Int64[np.ndarray, "F 3"]]:
    """Return the undirected edges (i < j, sorted) and, for each face, the numbers of its edges 01, 12 and 20."""
    count = int(faces.max(initial=-1)) + 1
    edges, finer = _core.subdivide(faces, count)
    middles = finer[3::4]  # of each four, the face between the midpoints
    return edges.astype(np.int64), middles.astype(np.int64) - count


def border_mask(edges: Int64[np.ndarray, "E 2"], face_edges: Int64[np.ndarray, "F 3"]) -> Bool[np.ndarray, " E"]:
    """Return a mask of the `unique_edges` that belong to a single face."""
    return np.bincount(face_edges.reshape(-1), minlength=len(edges)) == 1


def border_edges(mesh: Mesh) -> Int64[np.ndarray, "B 2"]:
    """Return the edges that belong to a single face; a closed mesh has none."""
    edges, face_edges = unique_edges(mesh.faces)
    return edges[border_mask(edges, face_edges)]


def edge_lengths(mesh: Mesh) -> Float64[np.ndarray, " E"]:
    """Return the length of each of the `unique_edges`, in the unit of the vertices."""
    ends = mesh.vertices[unique_edges(mesh.faces)[0]]
    return np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)


def subdivide_midpoint(mesh: Mesh, levels: int = 1) -> Mesh:
    """Cut each triangle into four at its edge midpoints, `levels` times (paper, section 3.3.2).

    Old vertices come first, in order; new ones follow in the order of the sorted edges.
    """
    for _ in range(levels):
        edges, faces = _core.subdivide(mesh.faces, len(mesh.vertices))
        midpoints = (mesh.vertices[edges[:, 0]] + mesh.vertices[edges[:, 1]]) / 2
        mesh = Mesh(np.concatenate([mesh.vertices, midpoints]), faces)
    return mesh


def face_normals(mesh: Mesh) -> tuple[Float64[np.ndarray, "F 3"], Float64[np.ndarray, " F"]]:
    """Return unit normals and areas (squared units of the vertices) of the faces; a zero area has a zero normal."""
    return _core.face_normals(mesh.vertices, mesh.faces)


def blend(values: Float64[np.ndarray, "V 3"], corners: Int32[np.ndarray, "N 3"], weights: Triples) -> Triples:
    """Interpolate values of vertices inside faces, given by their three corners, by barycentric weights."""
    return _core.blend(values, corners, weights)


def face_means(values: Float64[np.ndarray, "V 3"], faces: Int32[np.ndarray, "F 3"]) -> Float64[np.ndarray, "F 3"]:
    """Return the mean of the values of each face's corners; of vertices, the faces' middles."""
    return _core.blend(values, faces, None)


def vertex_normals(mesh: Mesh) -> Float64[np.ndarray, "V 3"]:
    """Return area-weighted unit normals of the vertices; zero where a vertex has no face with an area."""
    return _core.vertex_normals(mesh.vertices, mesh.faces)


def weld(mesh: Mesh) -> Mesh:
    """Merge vertices at exactly equal positions and drop the faces that collapse.

    UV seams duplicate positions; codecs and normals need them to be one vertex.
    """
    return mesh.left(*_core.weld(mesh.vertices, mesh.faces))


def clean(mesh: Mesh) -> Mesh:
    """Remove collapsed, zero-area and repeated faces, then vertices that no face uses."""
    return mesh.left(*_core.clean(mesh.vertices, mesh.faces))


def drop_unreferenced(mesh: Mesh) -> Mesh:
    """Remove vertices that no face uses; the others keep their order."""
    return mesh.left(*_core.drop_unreferenced(mesh.vertices, mesh.faces))


def part_of(mesh: Mesh, chosen: Bool[np.ndarray, " F"]) -> Mesh:
    """Return the mesh of the chosen faces and the vertices that they use."""
    return drop_unreferenced(mesh.with_faces(chosen))


def with_neighbours(faces: Int32[np.ndarray, "F 3"], chosen: Bool[np.ndarray, " F"]) -> Bool[np.ndarray, " F"]:
    """Return the chosen faces and all faces that share a vertex with one of them."""
    touched = np.zeros(int(faces.max(initial=-1)) + 1, bool)
    touched[faces[chosen]] = True
    a, b, c = touched[faces].T
    return a | b | c


def concatenate(meshes: Sequence[Mesh]) -> Mesh:
    """Join meshes into one, vertices and faces in order; if only one has vertices, it is returned itself.

    If any has colours of its vertices, vertices of the others are grey. Several textures are joined side by side.
    """
    meshes = [mesh for mesh in meshes if len(mesh.vertices)] or list(meshes[:1])
    if len(meshes) <= 1:
        return meshes[0] if meshes else Mesh.empty()
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])], dtype=np.int32)
    colors = [np.full(mesh.vertices.shape, GREY, np.uint8) if mesh.colors is None else mesh.colors for mesh in meshes]
    textures = [*dict.fromkeys(mesh.texture for mesh in meshes if mesh.uv is not None and mesh.texture is not None)]
    texture, places = None, list[np.ndarray]()
    if textures:
        pairs = [
            (0, np.full((len(mesh.faces), 3, 2), np.nan, np.float32))
            if mesh.uv is None or mesh.texture is None
            else (textures.index(mesh.texture), mesh.uv)
            for mesh in meshes
        ]
        texture, places = side_by_side(textures, pairs)
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
        None if all(mesh.colors is None for mesh in meshes) else np.concatenate(colors),
        np.concatenate(places) if places else None,
        texture,
    )


def components(faces: Int32[np.ndarray, "F 3"], count: int) -> Int64[np.ndarray, " V"]:
    """Label each of `count` vertices with its connected component; components are numbered by their first vertex."""
    return _core.components(faces, count).astype(np.int64)


def boxes_of(
    labels: Int64[np.ndarray, " V"], vertices: Float64[np.ndarray, "V 3"], count: int
) -> tuple[Float64[np.ndarray, "C 3"], Float64[np.ndarray, "C 3"]]:
    """Return the lower and the upper corners of the boxes of `count` components, each of which has a vertex."""
    order = np.argsort(labels, kind="stable")
    starts = np.searchsorted(labels[order], np.arange(count))
    return np.minimum.reduceat(vertices[order], starts, axis=0), np.maximum.reduceat(vertices[order], starts, axis=0)


def linked(pairs: Int64[np.ndarray, "L 2"], count: int) -> Int64[np.ndarray, " N"]:
    """Label each of `count` items with its component of the graph whose edges are `pairs`."""
    return components(pairs[:, [0, 1, 1]].astype(np.int32), count)


def connected_faces(faces: Int32[np.ndarray, "F 3"], count: int) -> Int64[np.ndarray, " F"]:
    """Label each face with its connected component; labels of vertices without faces do not occur."""
    return components(faces, count)[faces[:, 0]]


def large_pieces(faces: Int32[np.ndarray, "F 3"], count: int, share: float) -> Bool[np.ndarray, " F"]:
    """Return the faces of connected components with at least this share of the faces of the largest one."""
    label = connected_faces(faces, count)
    size = np.bincount(label, minlength=1)
    return size[label] >= share * size.max()


def drop_small(mesh: Mesh, share: float) -> Mesh:
    """Remove connected components that have less than this share of the faces of the largest one."""
    return part_of(mesh, large_pieces(mesh.faces, len(mesh.vertices), share))


def without_fragments(mesh: Mesh, least: float) -> Mesh:
    """Remove connected components whose area is below `least`, in squared units of the vertices."""
    labels = connected_faces(mesh.faces, len(mesh.vertices))
    return part_of(mesh, np.bincount(labels, face_normals(mesh)[1])[labels] >= least)


@dataclass(frozen=True, slots=True)
class Level:
    """Connectivity before and after one midpoint subdivision."""

    coarse: Int32[np.ndarray, "F 3"]
    edges: Int32[np.ndarray, "E 2"]  # sorted; edge e has the vertex `vertices + e` in its middle
    faces: Int32[np.ndarray, "G 3"]  # G = 4 F
    vertices: int  # of the coarser mesh

    @property
    def count(self) -> int:
        return self.vertices + len(self.edges)


def subdivide(faces: Int32[np.ndarray, "F 3"], vertices: int) -> Level:
    """Subdivide the connectivity once; vertices are in the order of `subdivide_midpoint`.

    Raises FormatError if a face refers to a missing vertex.
    """
    try:
        edges, finer = _core.subdivide(faces, vertices)
    except ValueError as error:
        raise FormatError(f"a face that names none of {vertices} vertices, or too many of them") from error
    return Level(faces, edges, finer, vertices)


def levels_of(faces: Int32[np.ndarray, "F 3"], vertices: int, count: int) -> tuple[Level, ...]:
    """Subdivide the connectivity `count` times and return every level."""
    levels = list[Level]()
    for _ in range(count):
        levels.append(subdivide(faces, vertices))
        faces, vertices = levels[-1].faces, levels[-1].count
    return tuple(levels)


def heights(
    wanted: Float64[np.ndarray, "T W 3"], known: Float64[np.ndarray, "T V 3"], level: Level, curvature: int
) -> Float64[np.ndarray, "T E"]:
    """Return the signed distance from each curved midpoint, along its direction, to the wanted surface.

    `wanted` are positions of the finer level's vertices: the surface is the tangent plane at such a vertex or, if the
    direction runs along that plane, the vertex itself. `known` are the coarser level's vertices as both encoder and
    decoder have them. No distance exceeds the length of its edge.
    """
    scalars = np.empty((len(wanted), len(level.edges)))
    for t, (target, coarse) in enumerate(zip(wanted, known, strict=True)):
        coarse = np.ascontiguousarray(coarse)
        midpoints, directions = _core.edge_frames(coarse, level.coarse, level.edges, curvature)
        normals = vertex_normals(Mesh(np.ascontiguousarray(target), level.faces))[level.vertices :]
        away = target[level.vertices :] - midpoints
        cosine = (directions * normals).sum(axis=1)
        steep = cosine >= LEAST_COSINE
        met = (away * normals).sum(axis=1) / np.where(steep, cosine, 1.0)
        ends = coarse[level.edges]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        scalars[t] = np.clip(np.where(steep, met, (away * directions).sum(axis=1)), -length, length)
    return scalars


def refine(
    coarse: Float64[np.ndarray, "T V 3"], level: Level, scalars: Float64[np.ndarray, "T E"], curvature: int
) -> Float64[np.ndarray, "T W 3"]:
    """Return the finer level's vertices: the coarser ones, then curved midpoint + scalar x direction for each edge.

    The direction is the unit sum of the normals at both ends. The curved midpoint lies `curvature` / 64 of the sagitta
    that these normals imply away from the middle of the edge.
    """
    rows = np.ascontiguousarray(coarse.transpose(1, 2, 0))
    return _core.refine(rows, level.coarse, level.edges, np.ascontiguousarray(scalars.T), curvature)
