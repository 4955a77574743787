"""Reconstruction of surfaces: from depth pictures, from several surfaces, and from points; and closing of holes.

Signed distances are on a sparse grid of voxel blocks. A voxel is known where its weight is above a threshold; surface
is extracted between known voxels only, by the core. Vertices and faces are ordered by position alone, so the same
distances give the same mesh, on every machine. Poisson reconstruction (paper, section 3.3.2) needs the extra `open3d`.
"""

from __future__ import annotations

import math
import threading
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32, Int64
from scipy.spatial import cKDTree

from .. import _core
from ..errors import InputError, needed
from ..types import Mesh
from .closest_points import Surface
from .depth import DepthPicture
from .strict import inverse, products
from .topology import clean, unique_edges, weld
from .voxels import Lattice, around, contains, distinct, spread

Points = Float64[np.ndarray, "N 3"]

SIDE = 8  # voxels along a side of a block; the core's
TRUNCATION = 3.0  # voxels before and behind a depth that it constrains (guess)
GRAZING = 4.0  # the same for surface seen at grazing angles (decision 28)
ALONE = 8.0  # the same for a single camera: nothing is known behind a surface (decision 28)
SEEN = 0.5  # weight above which a voxel is known: one measurement is enough (guess)
FREE = 1.0  # the core's distance, in truncations, of voxels farther before a surface
ALIKE = 2.0**-16  # voxels: vertices that are nearer to each other are one (guess)
MOST_BLOCKS = 500_000  # bounds memory: 2 GB (guess)
_ONE_AT_A_TIME = threading.Lock()  # Open3D keeps state in static variables: two threads would change the bits


@dataclass(frozen=True, slots=True)
class Grid:
    """Signed distances at the voxels of some blocks; voxels are at whole multiples of `voxel`.

    A voxel's coordinates are its block's times SIDE, plus (i, j, k); its array index is [k, j, i]. Distances are in any
    unit, positive outside.
    """

    voxel: float  # m
    blocks: Int32[np.ndarray, "B 3"]  # distinct, ordered by position
    distances: Float32[np.ndarray, "B S S S"]
    weights: Float32[np.ndarray, "B S S S"]


def integrate(
    pictures: Sequence[DepthPicture], voxel: float, truncation: float, hidden: Sequence[DepthPicture] = ()
) -> Grid:
    """Integrate depth pictures into a grid, within `truncation` voxels of their surfaces.

    Every picture is integrated into the blocks of all pictures: a camera that sees through false surface of another
    one (flying pixels, noise) carves it away. Surface of `hidden` pictures is guessed, not measured: it counts only at
    voxels without measurement, and is no evidence of free space. Raises InputError if the surface takes more than
    `MOST_BLOCKS` blocks.
    """
    views, guessed = ([_view(picture) for picture in group] for group in (pictures, hidden))
    reach = truncation * voxel
    blocks = [_core.touched_blocks(*view, voxel, reach) for view in (*views, *guessed)]
    union = np.unique(np.concatenate([np.zeros((0, 3), np.int32), *blocks]), axis=0)
    if len(union) > MOST_BLOCKS:
        text = f"surface in {len(union)} blocks of {SIDE * voxel:g} m, over {MOST_BLOCKS}"
        raise InputError(f"{text}; are depth_unit_m and depth_max_m right? If so, give a larger voxel")
    distances, weights = np.zeros((2, len(union), SIDE, SIDE, SIDE), np.float32)
    for view in views:
        _core.integrate(*view, voxel, reach, union, distances, weights)
    if guessed:
        guesses, times = np.zeros((2, *distances.shape), np.float32)
        for view in guessed:
            _core.integrate(*view, voxel, reach, union, guesses, times)
        unknown = (weights == 0) & (times > 0) & (guesses < FREE)
        distances[unknown], weights[unknown] = guesses[unknown], times[unknown]
    return Grid(voxel, union, distances, weights)


def _view(picture: DepthPicture) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return depths, m, the projection, ray directions of pixels, and the eye, as the core takes them."""
    camera, depth = picture.camera, picture.depth.astype(np.float32) * np.float32(picture.unit)
    ways = products(inverse(camera.extrinsic[:3, :3]), inverse(camera.intrinsic))
    limited = np.where(depth <= picture.far, depth, np.float32(0))
    return limited, products(camera.intrinsic, camera.extrinsic[:3]), ways, np.ascontiguousarray(camera.eye)


def extract(grid: Grid, least: float) -> Mesh:
    """Extract the zero level between voxels whose weight is above `least`; the mesh may be empty."""
    vertices, faces = _core.zero_level(grid.blocks, grid.distances, grid.weights, grid.voxel, least)
    if not len(faces):
        return Mesh.empty()
    step = grid.voxel * ALIKE  # merges vertices at one voxel that differ by rounding
    mesh = clean(weld(Mesh(np.rint(vertices / step) * step, faces)))
    order = np.lexsort(mesh.vertices.T[::-1])  # vertices and faces by position; no two vertices share one
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    faces = rank[mesh.faces]
    first = np.argmin(faces, axis=1)[:, None]
    faces = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    return Mesh.of(mesh.vertices[order], faces[np.lexsort(faces.T[::-1])])


@dataclass(frozen=True, slots=True)
class MeanOptions:
    """Limits of the distances that count, in voxels."""

    reach: float = 1.5  # distances are kept this far from a surface: enough for the cubes it crosses, and noise (guess)
    steady: float = math.inf  # where the standard deviation of the distances is larger, there is no surface
    past: float = 0.5  # a surface is continued past its border so far, so that borders do not recede


class MeanSurface:
    """Sums of the signed distances of voxels near any added surface, of their squares, and counts of surfaces.

    Coordinates are taken relative to a point near the first surface: distances are float32, and a scene may be far off.
    """

    def __init__(self, voxel: float, options: MeanOptions = MeanOptions()) -> None:
        self._lattice, self._options = Lattice(np.full(3, -voxel / 2), voxel), options  # cells' middles are voxels
        self._origin: Float64[np.ndarray, " 3"] | None = None
        self._keys = np.zeros(0, np.int64)
        self._sums, self._squares, self._counts = np.zeros(0), np.zeros(0), np.zeros(0, np.int32)

    def add(self, mesh: Mesh) -> None:
        """Add the distances of the voxels near a surface."""
        if mesh.is_empty:
            return
        if self._origin is None:
            self._origin = Lattice.near(mesh, self._lattice.size).origin
        mesh = Mesh(mesh.vertices - self._origin, mesh.faces)
        keys, distances = self._signed(mesh)
        union = distinct(np.concatenate([self._keys, keys]))
        before, now = np.searchsorted(union, self._keys), np.searchsorted(union, keys)
        sums, squares, counts = np.zeros(len(union)), np.zeros(len(union)), np.zeros(len(union), np.int32)
        sums[before], squares[before], counts[before] = self._sums, self._squares, self._counts
        sums[now] += distances
        squares[now] += distances**2
        counts[now] += 1
        self._keys, self._sums, self._squares, self._counts = union, sums, squares, counts

    def surface(self, least: int) -> Mesh:
        """Extract the zero of the mean distance, over voxels that at least `least` surfaces know and agree on."""
        means = self._sums / np.maximum(self._counts, 1)
        varies = np.sqrt(np.maximum(self._squares / np.maximum(self._counts, 1) - means**2, 0))
        agreed = (self._counts >= least) & (varies <= self._options.steady * self._lattice.size)
        if self._origin is None or not agreed.any():
            return Mesh.empty()
        cells = self._lattice.cells(self._keys[agreed])
        inside, shared = cells % SIDE, Lattice(np.zeros(3), 1.0)
        keys, which = np.unique(shared.keys(cells // SIDE + 0.5), return_inverse=True)
        blocks, which = shared.cells(keys), which.reshape(-1)
        distances = np.zeros((len(blocks), SIDE, SIDE, SIDE), np.float32)
        weights = np.zeros_like(distances)
        at = (which, inside[:, 2], inside[:, 1], inside[:, 0])
        distances[at] = means[agreed] / (self._options.reach * self._lattice.size)
        weights[at] = 1.0
        mesh = extract(Grid(self._lattice.size, blocks.astype(np.int32), distances, weights), 0.5)
        return Mesh(mesh.vertices + self._origin, mesh.faces)

    def _signed(self, mesh: Mesh) -> tuple[Int64[np.ndarray, " M"], Float64[np.ndarray, " M"]]:
        """Return the keys of the voxels within reach of a surface and their signed distances to it.

        Past a border the distance is that to the plane of the nearest face.
        """
        size = self._lattice.size
        keys = distinct(self._lattice.keys(spread(mesh, size)[0]))
        for _ in range(math.ceil(self._options.reach - 0.5)):
            keys = around(keys)  # in the end, all within reach
        points, surface = self._lattice.centers(keys), Surface(mesh)
        hits = surface.closest(points)
        away, beyond = points - hits.points, surface.past_border(hits)
        along, distance = (away * surface.normals[hits.faces]).sum(axis=1), np.linalg.norm(away, axis=1)
        aside = np.sqrt(np.maximum(distance**2 - along**2, 0))
        within = (distance <= self._options.reach * size) & (~beyond | (aside <= self._options.past * size))
        signed = np.where(beyond, along, np.where(along < 0, -distance, distance))
        return keys[within], signed[within]


def poisson_surface(points: Points, normals: Points, depth: int, reach: float) -> Mesh:
    """Return the surface through points with outward normals, cut off farther than `reach` from all of them.

    `depth` is that of the octree. Runs in one thread, so that the same points give the same bits. Raises InputError
    without Open3D.
    """
    text = "Poisson reconstruction needs the extra `open3d`: pip install 'meshreel[open3d]'"
    with needed(f"{text}; or use preset `paper`, which does without"):
        import open3d as o3d
    if len(points) < 10:
        return Mesh.empty()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    quiet = o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error)
    with _ONE_AT_A_TIME, quiet:
        solid, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth, n_threads=1)
    mesh = Mesh.of(np.asarray(solid.vertices), np.asarray(solid.triangles))
    near = cKDTree(points).query(mesh.vertices)[0] <= reach
    return clean(Mesh.of(mesh.vertices, mesh.faces[near[mesh.faces].all(axis=1)]))


def close_holes(
    mesh: Mesh, perimeter: float, stay_open: Callable[[Points], Bool[np.ndarray, " N"]] | None = None
) -> Mesh:
    """Close the simple loops of the border of at most this perimeter, in the unit of the vertices, by least area.

    Longer loops stay open: soles missing from a capture, sleeves, the edge of a camera's view. So do loops whose faces
    would repeat an edge of the mesh, or have a middle where `stay_open` returns True. No vertex is added: cracks are
    zipped.
    """
    edges, _ = unique_edges(mesh.faces)
    edge_keys, patches = edges[:, 0] * len(mesh.vertices) + edges[:, 1], list[Int64[np.ndarray, "n 3"]]()
    for loop in border_loops(mesh):
        rim = mesh.vertices[loop]
        if np.linalg.norm(rim - np.roll(rim, -1, axis=0), axis=1).sum() <= perimeter:
            pairs = np.sort(np.stack(np.broadcast_arrays(loop[:, None], loop[None])), axis=0)
            keys = pairs[0] * len(mesh.vertices) + pairs[1]
            exists = edge_keys[np.minimum(np.searchsorted(edge_keys, keys), len(edge_keys) - 1)] == keys
            patches.extend([loop[patch[:, ::-1]] for patch in [_least_area(rim, exists)] if len(patch)])
    if stay_open is not None and patches:
        middles = mesh.vertices[np.concatenate(patches)].mean(axis=1)
        free = np.split(stay_open(middles), np.cumsum([len(patch) for patch in patches])[:-1])
        patches = [patch for patch, is_open in zip(patches, free, strict=True) if not is_open.any()]
    return Mesh.of(mesh.vertices, np.concatenate([mesh.faces, *patches]))


def _least_area(rim: Float64[np.ndarray, "n 3"], taken: Bool[np.ndarray, "n n"]) -> Int64[np.ndarray, "m 3"]:
    """Return the faces of least area that close a loop, with its orientation (Barequet and Sharir 1995).

    No face has a diagonal that `exists` in the mesh; without such faces, return none.
    """
    count = len(rim)
    least, middle = np.zeros((count, count)), np.zeros((count, count), np.int64)
    for length in range(2, count):
        first = np.arange(count - length)
        between, last = first[:, None] + np.arange(1, length), first + length
        sides = rim[between] - rim[first][:, None], (rim[last] - rim[first])[:, None]
        areas = np.linalg.norm(np.cross(*sides), axis=2) / 2
        sums = least[first[:, None], between] + least[between, last[:, None]] + areas
        if length < count - 1:
            sums[taken[first, last]] = np.inf
        middle[first, last] = between[first, best := sums.argmin(axis=1)]
        least[first, last] = sums[first, best]
    if not np.isfinite(least[0, -1]):
        return np.zeros((0, 3), np.int64)
    faces, spans = [], [(0, count - 1)]
    while spans:
        start, end = spans.pop()
        if end - start >= 2:
            at = int(middle[start, end])
            faces.append((start, at, end))
            spans += [(start, at), (at, end)]
    return np.array(faces)


def border_loops(mesh: Mesh) -> Iterator[Int64[np.ndarray, " n"]]:
    """Yield the half-edges without an opposite as loops that pass no vertex twice, each as its vertices.

    If several loops meet at a vertex, a walk along the border cuts off a loop whenever it returns to itself.
    """
    f = mesh.faces.astype(np.int64)
    half = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]])
    count = len(mesh.vertices)
    border = half[~contains(distinct(half[:, 1] * count + half[:, 0]), half[:, 0] * count + half[:, 1])]
    following = defaultdict[int, list[int]](list)
    for a, b in border[np.lexsort(border.T)[::-1]].tolist():
        following[a].append(b)
    for start in sorted(following):
        chain, place = [start], {start: 0}
        while following[chain[-1]]:
            vertex = following[chain[-1]].pop()
            if vertex not in place:
                place[vertex] = len(chain)
                chain.append(vertex)
                continue
            loop = chain[place[vertex] :]
            del chain[place[vertex] + 1 :]
            for gone in loop[1:]:
                del place[gone]
            if len(loop) >= 3:
                yield np.array(loop)
