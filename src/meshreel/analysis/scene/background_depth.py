"""Fuse the usual depth of every pixel over time into one background mesh (docs/decisions/0019-background.md).

In: the depth pictures of frames, their meshes, and the still faces of these. Out: one mesh. The median over time avoids
depths between two surfaces and removes noise before fusion, so voxels may be finer than those of the frames. Cameras
must not move; a sequence that offers depth pictures has checked that.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float32
from scipy.ndimage import binary_dilation

from ...geometry.depth import STEP, DepthPicture, FreeSpace, inverse_depths
from ...geometry.holes import close_holes
from ...geometry.raycast import Rays, pixels_near
from ...geometry.topology import face_normals, part_of, without_fragments
from ...geometry.tsdf import ALONE, GRAZING, SEEN, extract, integrate
from ...types import Mesh
from .background import BackgroundOptions

RIM = 3  # pixels around moving surface that are ignored: a guess
HIDDEN = np.float32(-1)  # in place of a depth: what stands still is not seen there
OPEN = 0.3  # least share of the moments in which a pixel is not hidden that must have a depth there (guess)
SMOOTH, SPREAD, ROUNDS = 2, 1.5, 2  # pixels around, standard deviation in pixels, and rounds of smoothing (decision 28)
SIMILAR = 4.0  # times the noise, standard deviation of the inverse depths that are averaged (decision 28)
SECOND_MEDIAN = 0.6745 * 6**0.5  # of the absolute second difference of normally distributed values, in deviations
FINER = 3  # times the rows and columns of the pictures, interpolated, that are fused (decision 28)


@dataclass(frozen=True, slots=True)
class Moment:
    """One frame of a scene: its depth pictures, its mesh, and the still faces of the mesh."""

    pictures: list[DepthPicture | None]  # one for each camera
    mesh: Mesh
    still: Bool[np.ndarray, " F"]


def fuse_still_depth(moments: Iterable[Moment], voxel: float, options: BackgroundOptions = BackgroundOptions()) -> Mesh:
    """Fuse the still surface in the depth pictures of some moments; `voxel` (m) is that of the frames' meshes."""
    usual = usual_pictures(moments, options)
    if not usual:
        return Mesh.empty()
    usual = [_smooth(picture) for picture in usual]
    fine, past = ([one.finer(FINER) for one in some] for some in (usual, [_continued(one) for one in usual]))
    mesh = extract(integrate(fine, options.finer * voxel, GRAZING if len(usual) > 1 else ALONE, past), SEEN)
    whole = without_fragments(_facing(mesh, usual, options.facing), options.fragment)
    return close_holes(whole, options.hole, FreeSpace.of(usual).at)


def usual_pictures(moments: Iterable[Moment], options: BackgroundOptions = BackgroundOptions()) -> list[DepthPicture]:
    """Return for each camera the median depth of every pixel over the moments in which it sees still surface."""
    stacks: dict[int, list[np.ndarray]] = {}
    cameras: dict[int, DepthPicture] = {}
    for moment in moments:
        rays = Rays(moment.mesh)
        for number, picture in enumerate(moment.pictures):
            if picture is not None:
                cameras[number] = picture
                stacks.setdefault(number, []).append(_still(picture, rays, moment))
    found = list[DepthPicture]()
    for number, stack in sorted(stacks.items()):
        depth = _medians(np.stack(stack), options)
        if depth.any():
            found.append(DepthPicture(cameras[number].camera, depth, cameras[number].unit, cameras[number].far))
    return found


def _still(picture: DepthPicture, rays: Rays, moment: Moment) -> np.ndarray:
    """Return the depths of a picture, `HIDDEN` for pixels that see moving faces or lie within `RIM` of some."""
    moves = pixels_near(picture.camera, Mesh(moment.mesh.vertices, moment.mesh.faces[~moment.still]))
    faces = rays.faces_in(picture.camera, moves)  # of the whole mesh: what stands still may hide what moves
    moves[moves] = (faces >= 0) & ~np.append(moment.still, True)[faces]
    return np.where(binary_dilation(moves, iterations=RIM), HIDDEN, picture.depth.astype(np.float32))


def _medians(stack: Float32[np.ndarray, "T H W"], options: BackgroundOptions) -> Float32[np.ndarray, "H W"]:
    """Return for each pixel the median of its depths above 0; 0 where too few are.

    A door that opens soon is measured a few times, and what is behind it perhaps never.
    """
    depths = np.sort(np.where(stack > 0, stack, np.inf), axis=0)
    count = np.isfinite(depths).sum(axis=0)
    least = np.maximum(options.least(len(stack)), OPEN * (stack >= 0).sum(axis=0))
    low, high = (np.take_along_axis(depths, np.maximum(at, 0)[None], 0)[0] for at in ((count - 1) // 2, count // 2))
    return np.where(count >= least, (low + high) / 2, 0).astype(np.float32)


def _smooth(picture: DepthPicture) -> DepthPicture:
    """Smooth a depth picture along surfaces: sensors round depth to steps, which noise does not even out.

    Inverse depths are averaged, so that planes stay planes, with those around that are about as far.
    """
    inverse = inverse_depths(picture.depth)
    (height, width), similar = inverse.shape, np.float32(max(SIMILAR * _noise(inverse), 1e-6))
    places = range(-SMOOTH, SMOOTH + 1)
    for _ in range(ROUNDS):
        padded, around = np.pad(inverse, SMOOTH), np.maximum(inverse, np.float32(1e-9))
        sums, weights = np.zeros_like(inverse), np.zeros_like(inverse)
        for down in places:
            for right in places:
                there = padded[SMOOTH + down : SMOOTH + down + height, SMOOTH + right : SMOOTH + right + width]
                near = (there - inverse) / (similar * around)
                weight = np.exp(-(near**2) / 2 - np.float32((down**2 + right**2) / (2 * SPREAD**2))) * (there > 0)
                sums += weight * there
                weights += weight
        inverse = np.where(inverse > 0, sums / np.maximum(weights, np.float32(1e-9)), 0)
    return replace(picture, depth=inverse_depths(inverse))


def _continued(picture: DepthPicture) -> DepthPicture:
    """Return the surfaces of a depth picture a pixel past their borders, where a nearer one or nothing is measured.

    On a grid each surface ends a voxel before what hides it; between the two, one would see through the room.
    """
    inverse, found = np.pad(inverse_depths(picture.depth), 1), np.zeros((1, 1), np.float32)
    for axis, way in ((0, 1), (0, -1), (1, 1), (1, -1)):
        here, before = np.roll(inverse, way, axis), np.roll(inverse, 2 * way, axis)
        guess = np.where(np.abs(here - before) <= STEP * here, 2 * here - before, here)
        hidden = (here > 0) & ((inverse == 0) | (guess < (1 - STEP) * inverse))
        found = np.maximum(found, np.where(hidden, guess, 0))  # the nearest of several
    return replace(picture, depth=inverse_depths(found[1:-1, 1:-1]))


def _noise(inverse: Float32[np.ndarray, "H W"]) -> float:
    """Return the usual noise of inverse depths, as a share of them: by second differences, which planes have not."""
    differences = np.abs(inverse[:, :-2] - 2 * inverse[:, 1:-1] + inverse[:, 2:])
    known = (inverse[:, :-2] > 0) & (inverse[:, 1:-1] > 0) & (inverse[:, 2:] > 0)
    return float(np.median(differences[known] / inverse[:, 1:-1][known])) / SECOND_MEDIAN if known.any() else 0.0


def _facing(mesh: Mesh, pictures: list[DepthPicture], least: float) -> Mesh:
    """Drop the faces that no camera sees frontally, with at least this cosine between its ray and the normal."""
    if mesh.is_empty:
        return mesh
    normals, middles = face_normals(mesh)[0], mesh.vertices[mesh.faces].mean(axis=1)
    best = np.full(len(middles), -1.0)
    for picture in pictures:
        rays = picture.camera.eye - middles
        best = np.maximum(best, (rays * normals).sum(axis=1) / np.maximum(np.linalg.norm(rays, axis=1), 1e-12))
    return part_of(mesh, best >= least)
