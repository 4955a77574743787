"""Lays the faces of a room into the pictures of its cameras, which are its texture.

In: a mesh, and the views of its surface. Out: the mesh with large faces cut as the pictures need it, and the places of
its faces in the pictures, side by side.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64, Int64

from ...geometry.atlas import MOST_SIDE, Layout
from ...geometry.bisection import bisected
from ...geometry.color_views import ColorViews, View
from ...geometry.drawing import draw
from ...geometry.topology import edge_lengths, face_means, face_normals, unique_edges
from ...types import Mesh

Vectors = Float64[np.ndarray, "F 3"]
PerFace = Float64[np.ndarray, " F"]
ENLARGED = 3.0  # largest number of texels along a pixel: 39 dB of living_room; with 2: 38, with 1: 36, at similar rates
USUAL_SIDE = 1024  # texels, side up to which small pictures are enlarged (guess)
BLOCK = 16  # texels: the height of the texture is a multiple, as video has blocks
SMALL = 0.025  # of a picture's longer side: longest side of a face of which it need not have all, 5 cm at 2 m (guess)
# By which the middles of pixels inside a face differ from its area, per root of its border's pixels (guess). Pixels are
# those of depths: of a large picture, what hides less than some tens of them is not seen.
COUNTED = 1.5
BENT = 0.002  # of a picture's longer side, by which perspective may bend an edge (guess)
TURNS, SEAM = 16, 1.0  # rounds of choosing pictures; what neighbours count beside how well a picture shows (guess)
CUTS = 16  # rounds of cutting faces in two, at most: one of 3 m to 5 cm takes 12
THIN, THIN_ROUNDS = 0.05, 4  # height over length of faces whose normals are rounding; how many lie side by side (guess)


def projected(mesh: Mesh, views: ColorViews) -> tuple[Layout, float]:
    """Return the faces' places in the cameras' pictures, laid side by side, and the texels along a pixel.

    A face is in a picture that sees it frontally, if possible in that of the faces beside it: thin faces and seams
    between pictures show. A face that no picture has entirely has no place. Small pictures are enlarged, because
    corners are on whole texels, and large ones are reduced to fit a texture.
    """
    normals, count = steady_normals(mesh), len(mesh.faces)
    shown = [_Shown.of(mesh, normals, view) for view in views.views]
    weights = [np.where(each.has_all | (each.longest <= SMALL), each.weights, 0.0) for each in shown]
    best = _with_few_seams(mesh, np.stack([np.zeros(count), *weights]))
    places, left, height = np.zeros((count, 3, 2)), 0, 0
    for number, (view, each) in enumerate(zip(views.views, shown, strict=True)):
        camera = view.picture.camera
        places[best == number] = each.corners[best == number] + [left, 0]
        left, height = left + camera.width, max(height, camera.height)
    side = max(left, height)
    scale = min(ENLARGED, max(1.0, USUAL_SIDE / side), MOST_SIDE / side)
    scaled = np.where(best[:, None, None] < 0, 0.0, places * scale)
    sides = [max(2, -(-round(side * scale) // BLOCK) * BLOCK) for side in (left, height)]
    return Layout(sides[0], sides[1], np.ascontiguousarray(np.rint(scaled).astype(np.int32))), scale


def _with_few_seams(mesh: Mesh, weights: Float64[np.ndarray, "P F"]) -> Int64[np.ndarray, " F"]:
    """Return the number of a picture for each face, by how well it shows the face and its neighbours; -1 for none.

    The first row of `weights` is no picture's.
    """
    relative = weights / np.maximum(weights.max(axis=0), 1e-300)
    _, sides = unique_edges(mesh.faces)
    lengths = edge_lengths(mesh)[sides]
    best, shares = relative.argmax(axis=0), lengths / np.maximum(lengths.sum(axis=1, keepdims=True), 1e-300)
    for turn in range(TURNS):
        beside = np.zeros_like(relative)
        for number in range(1, len(relative)):
            is_there = best == number
            around = np.bincount(sides.reshape(-1), np.repeat(is_there, 3))[sides]
            beside[number] = ((around - is_there[:, None]) * shares).sum(axis=1)
        better = np.where(weights > 0, relative + SEAM * beside, 0.0).argmax(axis=0)
        best = np.where(np.arange(len(best)) % 2 == turn % 2, better, best)  # neighbours would swap for ever
    return best - 1


def shown_whole(mesh: Mesh, views: ColorViews) -> Mesh:
    """Return a mesh whose large faces are cut until a picture has them entirely, or none has any of them.

    Of a large face that something hides in part, a picture has what hides it, too; and a picture shows it in
    perspective, of which a texture knows nothing.
    """
    for _ in range(CUTS):
        wanted, most = np.zeros(len(mesh.faces), bool), np.zeros(len(mesh.faces))
        (edges, sides), normals = unique_edges(mesh.faces), steady_normals(mesh)
        middles = mesh.vertices[edges].mean(axis=1)
        for view in views.views:
            shown, side = _Shown.of(mesh, normals, view), max(view.picture.camera.width, view.picture.camera.height)
            ends = view.picture.project(mesh.vertices)[0][edges]
            with np.errstate(invalid="ignore"):
                off = np.linalg.norm(view.picture.project(middles)[0] - ends.mean(axis=1), axis=1)[sides].max(axis=1)
            large, better = ~(shown.longest <= SMALL), shown.has_all & (shown.weights > most)
            most[better], wanted[better] = shown.weights[better], (large & (off > BENT * side))[better]
            wanted |= shown.has_some & large & (most == 0)
        if not wanted.any():
            break
        mesh = bisected(mesh, wanted)
    return mesh


@dataclass(frozen=True, slots=True)
class _Shown:
    """The faces of a mesh, as a picture shows them."""

    corners: Float64[np.ndarray, "F 3 2"]  # where they are in the picture
    longest: PerFace  # side, as a share of the picture's longer one; NaN where a corner is behind the camera
    weights: PerFace  # of their middles; 0 where the face is not within the picture
    has_some: Bool[np.ndarray, " F"]  # of the face, from before it
    has_all: Bool[np.ndarray, " F"]

    @staticmethod
    def of(mesh: Mesh, normals: Vectors, view: View) -> _Shown:
        taken, middles = view.picture, face_means(mesh.vertices, mesh.faces)
        size = np.array([taken.camera.width, taken.camera.height])
        corners = taken.project(mesh.vertices)[0][mesh.faces]
        with np.errstate(invalid="ignore"):
            inside = ((corners >= 0) & (corners <= size)).all(axis=(1, 2))
            longest = _sides(corners).max(axis=1) / size.max()
        weights = np.where(inside, view.weights(middles, normals, at_step=0.1), 0.0)
        drawn = draw(mesh, view.camera).faces
        counts = np.bincount(drawn[drawn >= 0], minlength=len(mesh.faces))
        straight = replace(taken, camera=view.camera).project(mesh.vertices)[0][mesh.faces]
        a, b, c = np.moveaxis(straight, 1, 0)
        with np.errstate(invalid="ignore"):
            areas = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
            has_all = counts >= areas - COUNTED * np.sqrt(_sides(straight).sum(axis=1)) - 1
        is_before = np.einsum("nc,nc->n", normals, taken.camera.eye - middles) > 0
        return _Shown(corners, longest, weights, is_before & (counts > 0), has_all & (weights > 0))


def _sides(corners: Float64[np.ndarray, "F 3 2"]) -> Float64[np.ndarray, "F 3"]:
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)


def steady_normals(mesh: Mesh) -> Vectors:
    """Return unit normals of the faces; those of thin ones, which tell nothing, are of the faces beside them."""
    (normals, areas), (_, sides) = face_normals(mesh), unique_edges(mesh.faces)
    thin = np.flatnonzero(2 * areas <= THIN * edge_lengths(mesh)[sides].max(axis=1) ** 2)
    sums = normals * areas[:, None]
    for _ in range(THIN_ROUNDS if len(thin) else 0):
        of_edges = [np.bincount(sides.reshape(-1), np.repeat(sums[:, k], 3)) for k in range(3)]
        sums[thin] = np.stack(of_edges, axis=1)[sides[thin]].sum(axis=1)
    return sums / np.maximum(np.linalg.norm(sums, axis=1), 1e-300)[:, None]
