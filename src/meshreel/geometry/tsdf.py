"""Truncated signed distances on a sparse grid of voxel blocks, and extraction of their zero level, both by the core.

A voxel is known where its weight is above a threshold; surface is extracted between known voxels only. Vertices and
faces are ordered by position alone, so the same distances give the same mesh, on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int32

from .. import _core
from ..errors import InputError
from ..types import Mesh
from .depth import DepthPicture
from .strict import inverse, products
from .topology import clean, weld

SIDE = 8  # voxels along a side of a block; the core's
TRUNCATION = 3.0  # voxels before and behind a depth that it constrains (guess)
GRAZING = 4.0  # the same for surface seen at grazing angles (decision 28)
ALONE = 8.0  # the same for a single camera: nothing is known behind a surface (decision 28)
SEEN = 0.5  # weight above which a voxel is known: one measurement is enough (guess)
FREE = 1.0  # the core's distance, in truncations, of voxels farther before a surface
ALIKE = 2.0**-16  # voxels: vertices that are nearer to each other are one (guess)
MOST_BLOCKS = 500_000  # bounds memory: 2 GB (guess)


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

    @staticmethod
    def of(
        voxel: float,
        blocks: Int32[np.ndarray, "B 3"],
        distances: Float32[np.ndarray, "B S S S"],
        weights: Float32[np.ndarray, "B S S S"],
    ) -> Grid:
        """Make a grid of blocks in any order."""
        order = np.lexsort(blocks.T[::-1])
        return Grid(voxel, blocks[order], distances[order], weights[order])


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
    return (
        np.where(depth <= picture.far, depth, np.float32(0)),
        products(camera.intrinsic, camera.extrinsic[:3]),
        ways,
        np.ascontiguousarray(camera.eye),
    )


def extract(grid: Grid, least: float) -> Mesh:
    """Extract the zero level between voxels whose weight is above `least`; the mesh may be empty."""
    vertices, faces = _core.zero_level(grid.blocks, grid.distances, grid.weights, grid.voxel, least)
    if not len(faces):
        return Mesh.empty()
    step = grid.voxel * ALIKE  # merges vertices at one voxel that differ by rounding
    return _ordered(clean(weld(Mesh(np.rint(vertices / step) * step, faces))))


def _ordered(mesh: Mesh) -> Mesh:
    """Order vertices and faces by position; no two vertices may share one."""
    order = np.lexsort(mesh.vertices.T[::-1])
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    faces = rank[mesh.faces]
    first = np.argmin(faces, axis=1)[:, None]
    faces = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    return Mesh.of(mesh.vertices[order], faces[np.lexsort(faces.T[::-1])])
