"""Find the bodies of an interval: connected pieces of moving surface, followed over time (paper, section 3.3).

In: the moving faces of each frame. Out: bodies, each with one mesh per frame, empty in frames without it. Pieces that
touch in any frame are one body in the whole interval. Small pieces that last are separate bodies, because a template
that follows a person does not follow an object at their side; other small pieces join the body near them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int64
from scipy.spatial import cKDTree

from ...geometry.closest_points import Surface
from ...geometry.topology import (
    concatenate,
    connected_faces,
    face_means,
    face_normals,
    linked,
    part_of,
    with_neighbours,
)
from ...geometry.voxels import Lattice, around, contains, distinct, spread
from ...types import Mesh

MOST_RINGS = 4  # largest number of rings added around moving faces where the background has a gap: a guess
AROUND = 0.9  # m around moving surface within which surface that the room lacks counts as moving: a guess
SPECK = 0.002  # m^2: smaller pieces of surface that the room lacks are noise: a guess
PIECE = 0.01  # m^2: the same far from bodies (guess)
RING = 2.0  # cells, the longest edge of a face in a ring, so that large faces of a wall stay out of it: a guess
NEAR = 3.0  # cells of the scene: pieces of consecutive frames nearer than this are one (guess)
LEAST = 0.1  # m^2: pieces that never reach this area are bits (guess)
LASTS = 5  # frames: bits that are present in at least this many are a body of their own (guess)
LARGE = 0.02  # m^2, of such a body in a frame at least, on average (guess)
BESIDE = 0.9  # m: other bits at most this far from a body join it, such as feet below legs no camera sees (guess)
TOUCHES = 2.0  # cells of the scene: the same for a bit that is present in one frame only (guess)


@dataclass(frozen=True, slots=True)
class Bodies:
    """Bodies of consecutive frames, and the number of faces that belong to none."""

    meshes: list[list[Mesh]]  # for each body, one mesh per frame
    dropped: int  # faces of short-lived bits far from every body


@dataclass(frozen=True, slots=True)
class _Piece:
    """A connected component of the moving surface of one frame."""

    frame: int
    mesh: Mesh
    area: float  # m^2
    cells: Int64[np.ndarray, " C"]  # keys of the coarse cells in which it has surface


def ring(mesh: Mesh, moves: Bool[np.ndarray, " F"], cell: float) -> Bool[np.ndarray, " F"]:
    """Return True for the small faces next to moving ones, which belong to the body; `cell` is in m.

    Around a standing foot, fused surface runs from the floor up to it, a cell wide: it rests as long as the foot does,
    but other frames have only the floor there. Without these faces bodies would hover by a cell.
    """
    added = with_neighbours(mesh.faces, moves) & ~moves
    corners = mesh.vertices[mesh.faces[added]]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    added[added] = longest <= RING * cell
    return added


def with_ring(mesh: Mesh, moves: Bool[np.ndarray, " F"], cell: float, background: Surface | None = None) -> Mesh:
    """Cut the moving faces out of a frame together with the `ring` around them, as bodies are coded.

    Where the background has a gap there, more rings are added: a background fused from depth pictures lacks some pixels
    around moving surface, and pixels of coarse pictures are wide.
    """
    cut = moves | ring(mesh, moves, cell)
    if background is None or not moves.any():
        return part_of(mesh, cut)
    for _ in range(MOST_RINGS - 1):
        more = np.flatnonzero(ring(mesh, cut, cell))
        more = more[background.past_border(background.closest(face_means(mesh.vertices, mesh.faces[more])))]
        if not len(more):
            break
        cut[more] = True
    return part_of(mesh, cut)


def beyond(mesh: Mesh, moves: Bool[np.ndarray, " F"], off: Bool[np.ndarray, " V"]) -> Bool[np.ndarray, " F"]:
    """Return the moving faces, and other pieces of vertices that are `off` the room: near bodies smaller ones, too.

    A foot stands so long and so near to the floor that it seems to belong to the room, but the floor has no such
    surface.
    """
    body = moves | off[mesh.faces].all(axis=1)
    if not body.any():
        return body
    corners = mesh.vertices[mesh.faces[moves]].reshape(-1, 3)
    low, high = corners.min(axis=0, initial=np.inf) - AROUND, corners.max(axis=0, initial=-np.inf) + AROUND
    near = ((mesh.vertices >= low) & (mesh.vertices <= high)).all(axis=1)[mesh.faces[body]].all(axis=1)
    pieces = connected_faces(mesh.faces[body], len(mesh.vertices))
    is_near = np.bincount(pieces, near) > 0
    body[body] = (np.bincount(pieces, face_normals(part_of(mesh, body))[1]) >= np.where(is_near, SPECK, PIECE))[pieces]
    return body | moves


def find_bodies(moving: Sequence[Mesh], size: float, near: float = NEAR, clean: bool = False) -> Bodies:
    """Find the bodies in the moving surface of consecutive frames; `size` is the width of the scene's cells, m.

    Pieces of consecutive frames that are nearer than `near` cells are one. In `clean` frames bits are no noise, and
    those of no body are one more together.
    """
    lattice = _lattice(moving, near * size)
    pieces = list[_Piece]()
    for frame, mesh in enumerate(moving):
        labels = connected_faces(mesh.faces, len(mesh.vertices))
        areas = np.bincount(labels, face_normals(mesh)[1])
        for number in np.flatnonzero(np.bincount(labels)):
            part = part_of(mesh, labels == number)
            pieces.append(_Piece(frame, part, float(areas[number]), _cells(part, lattice)))
    label = _linked(pieces)
    clusters = [[pieces[k] for k in np.flatnonzero(label == number)] for number in range(label.max(initial=-1) + 1)]
    large = [cluster for cluster in clusters if max(piece.area for piece in cluster) >= LEAST]
    bodies: list[list[list[Mesh]]] = [[[] for _ in moving] for _ in large]
    for body, cluster in zip(bodies, large, strict=True):
        for piece in cluster:
            body[piece.frame].append(piece.mesh)
    small = [cluster for cluster in clusters if max(piece.area for piece in cluster) < LEAST]
    if clean and small:
        bits = [piece for cluster in small for piece in cluster]
        bodies.append([[bit.mesh for bit in bits if bit.frame == frame] for frame in range(len(moving))])
    dropped = 0 if clean else sum(_given(bodies, bits, len(moving), size) for bits in small)
    return Bodies([[concatenate(meshes) for meshes in body] for body in bodies], dropped)


def at_most(bodies: Sequence[list[Mesh]], most: int) -> list[list[Mesh]]:
    """Reduce the number of bodies to `most`: each of the smallest joins the kept body with the nearest middle."""
    if len(bodies) <= most:
        return list(bodies)
    middles = np.array([np.concatenate([mesh.vertices for mesh in body]).mean(axis=0) for body in bodies])
    order = np.argsort([-sum(len(mesh.faces) for mesh in body) for body in bodies], kind="stable")
    kept = np.sort(order[:most])
    parts = [[bodies[number]] for number in kept]
    for number in np.sort(order[most:]):
        parts[int(np.linalg.norm(middles[kept] - middles[number], axis=1).argmin())].append(bodies[number])
    return [[concatenate(meshes) for meshes in zip(*part, strict=True)] for part in parts]


def same_bodies(before: Sequence[Mesh], now: Sequence[Mesh], size: float, near: float = NEAR) -> list[int]:
    """Match the bodies of a frame to those of the frame before by the cells that they share.

    Return for each body in `now` the index in `before` of the body that it continues, -1 for none. No body is continued
    twice.
    """
    lattice = _lattice([*before, *now], near * size)
    cells = [[around(_cells(mesh, lattice)) for mesh in meshes] for meshes in (before, now)]
    shared = np.array([[len(np.intersect1d(a, b, assume_unique=True)) for a in cells[0]] for b in cells[1]])
    matches = [-1] * len(now)
    while shared.size and shared.max() > 0:
        new, old = np.unravel_index(int(shared.argmax()), shared.shape)
        matches[int(new)] = int(old)
        shared[new, :] = shared[:, old] = 0
    return matches


def _lattice(meshes: Sequence[Mesh], size: float) -> Lattice:
    return Lattice.near(next((mesh for mesh in meshes if not mesh.is_empty), Mesh.empty()), size)


def _cells(mesh: Mesh, lattice: Lattice) -> Int64[np.ndarray, " C"]:
    return distinct(lattice.keys(spread(mesh, lattice.size)[0]))


def _linked(pieces: list[_Piece]) -> Int64[np.ndarray, " N"]:
    """Label the pieces: pieces that come near each other in consecutive frames have one label."""
    links = list[tuple[int, int]]()
    for frame in sorted({piece.frame for piece in pieces}):
        current, later = ([k for k, piece in enumerate(pieces) if piece.frame == at] for at in (frame, frame + 1))
        keys = np.concatenate([pieces[k].cells for k in later] or [np.zeros(0, np.int64)])
        owner = np.repeat(later, [len(pieces[k].cells) for k in later])
        for k in current:
            near = contains(around(pieces[k].cells), keys)
            links += [(k, int(other)) for other in np.unique(owner[near])]
    return linked(np.array(links, np.int64).reshape(-1, 2), len(pieces))


def _given(bodies: list[list[list[Mesh]]], bits: list[_Piece], frames: int, size: float) -> int:
    """Make lasting bits a body, else add each to the nearest body of its frame; return the number of dropped faces.

    A bit that is present in one frame only is noise, unless it touches a body.
    """
    present = len({bit.frame for bit in bits})
    if present >= LASTS and sum(bit.area for bit in bits) >= LARGE * present:
        body: list[list[Mesh]] = [[] for _ in range(frames)]
        for bit in bits:
            body[bit.frame].append(bit.mesh)
        bodies.append(body)
        return 0
    dropped = 0
    for bit in bits:
        near = list[tuple[float, int]]()  # smallest distances between vertices of the bit and of each body
        for number, body in enumerate(bodies):
            if body[bit.frame]:
                points = np.concatenate([part.vertices for part in body[bit.frame]])
                near.append((float(cKDTree(points).query(bit.mesh.vertices)[0].min()), number))
        gap, number = min(near, default=(np.inf, -1))
        if gap <= (BESIDE if present > 1 else TOUCHES * size):
            bodies[number][bit.frame].append(bit.mesh)
        else:
            dropped += len(bit.mesh.faces)
    return dropped
