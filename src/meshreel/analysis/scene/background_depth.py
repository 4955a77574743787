"""The room without the people from what depth cameras measured over time: the usual depth of each pixel, fused.

In: frames' depth pictures, with their meshes and what stands still of them. Out: one mesh. Of pixels between two
surfaces a median takes one of both, and noise goes before there is a surface, so the voxels may be finer than those of
the frames. Cameras stand still: a sequence that knows its depths has made sure of it.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Bool, Float32

from ...geometry.connected import without_fragments
from ...geometry.depth import DepthPicture
from ...geometry.raycast import Rays
from ...geometry.topology import face_normals, part_of
from ...geometry.tsdf import SEEN, TRUNCATION, extract, integrate
from ...types import Mesh
from .background import BackgroundOptions

BESIDE = 3  # pixels around what moves that are not believed

Moment = tuple[list[DepthPicture | None], Mesh, Bool[np.ndarray, " _"]]  # pictures, the mesh of them, its still faces


def fuse_still_depth(moments: Iterable[Moment], voxel: float, options: BackgroundOptions = BackgroundOptions()) -> Mesh:
    """The surface that stands still in what cameras measured in some moments; `voxel` is that of the frames, m."""
    usual = usual_pictures(moments, options)
    if not usual:
        return Mesh.empty()
    mesh = extract(integrate(usual, options.finer * voxel, TRUNCATION), SEEN)
    return without_fragments(_facing(mesh, usual, options.facing), options.fragment)


def usual_pictures(moments: Iterable[Moment], options: BackgroundOptions = BackgroundOptions()) -> list[DepthPicture]:
    """For each camera the median depth of every pixel, over the moments in which it sees what stands still."""
    stacks: dict[int, list[np.ndarray]] = {}
    cameras: dict[int, DepthPicture] = {}
    for pictures, mesh, still in moments:
        rays = Rays(mesh)
        for number, picture in enumerate(pictures):
            if picture is not None:
                cameras[number] = picture
                stacks.setdefault(number, []).append(_still(picture, rays, still))
    found = list[DepthPicture]()
    for number, stack in sorted(stacks.items()):
        depth = _medians(np.stack(stack), options.least(len(stack)))
        if depth.any():
            found.append(DepthPicture(cameras[number].camera, depth, cameras[number].unit, cameras[number].far))
    return found


def _still(picture: DepthPicture, rays: Rays, still: Bool[np.ndarray, " F"]) -> np.ndarray:
    """The depths that are not of what moves, nor beside it; 0 for the others."""
    from scipy.ndimage import binary_dilation

    faces = rays.look(picture.camera).faces
    moves = faces >= 0
    moves[moves] = ~still[faces[moves]]
    return np.where(binary_dilation(moves, iterations=BESIDE), 0, picture.depth).astype(picture.depth.dtype)


def _medians(stack: np.ndarray, least: int) -> Float32[np.ndarray, "H W"]:
    """Of what is not 0; 0 where that is fewer than `least`."""
    depths = np.sort(np.where(stack > 0, stack, np.inf).astype(np.float32), axis=0)
    count = np.isfinite(depths).sum(axis=0)
    low, high = (np.take_along_axis(depths, np.maximum(at, 0)[None], 0)[0] for at in ((count - 1) // 2, count // 2))
    return np.where(count >= least, (low + high) / 2, 0).astype(np.float32)


def _facing(mesh: Mesh, pictures: list[DepthPicture], least: float) -> Mesh:
    """Without faces that no camera sees from the front: cosine of the angle to its ray, at least."""
    if mesh.is_empty:
        return mesh
    normals, middles = face_normals(mesh)[0], mesh.vertices[mesh.faces].mean(axis=1)
    best = np.full(len(middles), -1.0)
    for picture in pictures:
        rays = picture.camera.eye - middles
        best = np.maximum(best, (rays * normals).sum(axis=1) / np.maximum(np.linalg.norm(rays, axis=1), 1e-12))
    return part_of(mesh, best >= least)
