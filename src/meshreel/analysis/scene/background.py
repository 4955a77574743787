"""Fuse the still surface of many frames into one background mesh (paper, section 3.2; decision 19).

In: the still faces of some frames, or their depth pictures. Out: one mesh. Signed distances to the surfaces of the
frames are averaged, which reduces noise, and surface that people hide in one frame comes from others. Of depth, the
median over time of every pixel is fused, which lies on a surface and has less noise, so voxels may be finer; that of
cameras that move is fused from the pictures of the whole take.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import repeat

import numpy as np
from jaxtyping import Bool
from scipy.ndimage import binary_dilation

from ...geometry.depth import STEP, DepthPicture, FreeSpace, inverse_depths
from ...geometry.drawing import draw
from ...geometry.reconstruct import ALONE, GRAZING, SEEN, MeanOptions, MeanSurface, close_holes, extract, integrate
from ...geometry.threads import mapped
from ...geometry.topology import face_means, face_normals, part_of, without_fragments
from ...types import Mesh

FRAMES = 20  # of a scene: largest number of fused frames, spread over the sequence (decision 19)
WALKED = 80  # frames that are fused where a camera moves, and sees a part of the scene in each (guess)
SHARED = 0.15  # smallest share of the frames that must have surface at a voxel (decision 19)
STEADY = 0.6  # voxels: where the standard deviation of the distances is larger, the surface was not still (decision 19)
PAST = 0.5  # voxels by which a surface is continued past its border, so that borders do not recede (decision 19)
FRAGMENT = 0.02  # m^2: connected pieces with less area are dropped (decision 19)
RIM = 3  # pixels around moving surface that are ignored: a guess
HIDDEN = np.float32(-1)  # in place of a depth: moving surface hides the still surface there
OPEN = 0.3  # least share of the moments in which a pixel is not hidden that must have a depth there (guess)
SIMILAR = 4.0  # times the noise, standard deviation of the inverse depths that are averaged (decision 28)
SECOND_MEDIAN = 0.6745 * 6**0.5  # of the absolute second difference of normally distributed values, in deviations
FINER_VOXEL = 0.75  # in voxels of the frames: averaged depth has less noise (decision 19)
FACING = 0.15  # cosine: faces that no camera sees more frontally lie between two real surfaces (decision 19)
WALK_SEEN = 1.5  # pictures of a walk in which a voxel must be measured: what one alone has is noise (guess)
HOLE = 0.4  # m: shorter loops of its border are closed where no camera saw through (decision 28)
FINER = 3  # times the rows and columns of the pictures, interpolated, that are fused (decision 28)


def fuse_background(frames: Iterable[Mesh], voxel: float) -> Mesh:
    """Fuse meshes of one still scene into their mean surface, on a grid of `voxel` (m); reads one mesh at a time."""
    sums = MeanSurface(voxel, MeanOptions(steady=STEADY, past=PAST))
    count = 0
    for mesh in frames:
        sums.add(mesh)
        count += 1
    return without_fragments(sums.surface(least_frames(count)), FRAGMENT)


def least_frames(count: int) -> int:
    """Return how many of `count` frames must have surface at a voxel."""
    return max(1, math.ceil(SHARED * count))


SMOOTH, SPREAD, ROUNDS = 2, 1.5, 2  # pixels around, standard deviation in pixels, and rounds of smoothing (decision 28)


@dataclass(frozen=True, slots=True)
class Moment:
    """Depth pictures and mesh of one frame of a scene, and the still faces of the mesh."""

    pictures: list[DepthPicture | None]  # one for each camera
    mesh: Mesh
    still: Bool[np.ndarray, " F"]


def fuse_still_depth(moments: Iterable[Moment], voxel: float) -> Mesh:
    """Fuse the still surface in the depth pictures of some moments; `voxel` (m) is that of the frames' meshes."""
    usual = usual_pictures(moments)
    if not usual:
        return Mesh.empty()
    usual = mapped(_smooth, usual)
    fine = mapped(DepthPicture.finer, usual, repeat(FINER))
    past = mapped(lambda picture: _continued(picture).finer(FINER), usual)
    mesh = extract(integrate(fine, FINER_VOXEL * voxel, GRAZING if len(usual) > 1 else ALONE, past), SEEN)
    whole = without_fragments(_faced(mesh, usual), FRAGMENT)
    return close_holes(whole, HOLE, FreeSpace.of(usual).at)


def fuse_walk(moments: Iterable[Moment], voxel: float) -> Mesh:
    """Fuse the still surface in the depth pictures of cameras that move; `voxel` (m) is that of the frames' meshes.

    What one picture sees through is no surface of the others: signed distances are averaged over all.
    """
    pictures = list[DepthPicture]()
    for moment in moments:
        for picture in moment.pictures:
            if picture is not None:
                depth = np.maximum(_still(picture, moment), 0).astype(np.float32)
                pictures += [replace(picture, depth=depth)] if depth.any() else []
    if not pictures:
        return Mesh.empty()
    fine = [picture.finer(_times(picture, FINER_VOXEL * voxel)) for picture in pictures]
    mesh = extract(integrate(fine, FINER_VOXEL * voxel, GRAZING), WALK_SEEN)
    whole = without_fragments(_faced(mesh, pictures), FRAGMENT)
    return close_holes(whole, HOLE, FreeSpace.of(pictures).at)


def _times(picture: DepthPicture, voxel: float) -> int:
    """Return by how much finer a picture must be so that two pixels are within a voxel at its usual depth."""
    usual = float(np.median(picture.depth[picture.depth > 0])) * picture.unit
    return int(np.clip(math.ceil(2 * usual / min(picture.camera.focal) / voxel), 1, FINER))


def _faced(mesh: Mesh, pictures: Sequence[DepthPicture]) -> Mesh:
    """Return the faces that some camera sees at more than a grazing angle."""
    normals, middles = face_normals(mesh)[0], face_means(mesh.vertices, mesh.faces)
    best = np.full(len(middles), -1.0)  # cosine between a face's normal and the ray of the camera that it faces most
    for picture in pictures:
        rays = picture.camera.eye - middles
        best = np.maximum(best, (rays * normals).sum(axis=1) / np.maximum(np.linalg.norm(rays, axis=1), 1e-12))
    return part_of(mesh, best >= FACING)


def usual_pictures(moments: Iterable[Moment]) -> list[DepthPicture]:
    """Return for each camera the median depth of every pixel over the moments in which it sees still surface."""
    stacks: dict[int, list[np.ndarray]] = {}
    cameras: dict[int, DepthPicture] = {}
    for moment in moments:
        known = [(number, picture) for number, picture in enumerate(moment.pictures) if picture is not None]
        stills = mapped(_still, (picture for _, picture in known), repeat(moment))
        for (number, picture), still in zip(known, stills, strict=True):
            cameras[number] = picture
            stacks.setdefault(number, []).append(still)
    usual = list[DepthPicture]()
    for number, stack in sorted(stacks.items()):
        # A door that soon opens is measured a few times only, and the surface behind it perhaps never.
        depths = np.stack(stack)
        ordered = np.sort(np.where(depths > 0, depths, np.inf), axis=0)
        count = np.isfinite(ordered).sum(axis=0)
        least = np.maximum(least_frames(len(stack)), OPEN * (depths >= 0).sum(axis=0))
        places = (np.maximum(at, 0)[None] for at in ((count - 1) // 2, count // 2))
        low, high = (np.take_along_axis(ordered, at, 0)[0] for at in places)
        depth = np.where(count >= least, (low + high) / 2, 0).astype(np.float32)
        if depth.any():
            usual.append(DepthPicture(cameras[number].camera, depth, cameras[number].unit, cameras[number].far))
    return usual


def _still(picture: DepthPicture, moment: Moment) -> np.ndarray:
    """Return the depths of a picture; `HIDDEN` at pixels that see moving faces, and within `RIM` of them."""
    faces = draw(moment.mesh, picture.camera).faces  # of the whole mesh: still faces may hide moving ones
    moves = ~np.append(moment.still, True)[faces]
    return np.where(binary_dilation(moves, iterations=RIM), HIDDEN, picture.depth.astype(np.float32))


def _smooth(picture: DepthPicture) -> DepthPicture:
    """Smooth a depth picture along surfaces: sensors round depth to steps, which averaging over time does not remove.

    Inverse depths are averaged, so that planes stay planes, with neighbours at a similar depth.
    """
    inverse = inverse_depths(picture.depth)
    differences = np.abs(inverse[:, :-2] - 2 * inverse[:, 1:-1] + inverse[:, 2:])  # 0 on planes
    measured = (inverse[:, :-2] > 0) & (inverse[:, 1:-1] > 0) & (inverse[:, 2:] > 0)
    shares = differences[measured] / inverse[:, 1:-1][measured]
    noise = float(np.median(shares)) / SECOND_MEDIAN if len(shares) else 0.0
    (height, width), similar = inverse.shape, np.float32(max(SIMILAR * noise, 1e-6))
    places = range(-SMOOTH, SMOOTH + 1)
    for _ in range(ROUNDS):
        padded, around = np.pad(inverse, SMOOTH), np.maximum(inverse, np.float32(1e-9))
        sums, weights = np.zeros_like(inverse), np.zeros_like(inverse)
        for down in places:
            for right in places:
                shifted = padded[SMOOTH + down : SMOOTH + down + height, SMOOTH + right : SMOOTH + right + width]
                offset = (shifted - inverse) / (similar * around)
                weight = np.exp(-(offset**2) / 2 - np.float32((down**2 + right**2) / (2 * SPREAD**2))) * (shifted > 0)
                sums += weight * shifted
                weights += weight
        inverse = np.where(inverse > 0, sums / np.maximum(weights, np.float32(1e-9)), 0)
    return replace(picture, depth=inverse_depths(inverse))


def _continued(picture: DepthPicture) -> DepthPicture:
    """Return a depth picture's surfaces continued a pixel past their borders, behind nearer surface or a hole.

    On a grid each surface ends a voxel before the one that hides it, which would leave a gap in the room.
    """
    inverse, farthest = np.pad(inverse_depths(picture.depth), 1), np.zeros((1, 1), np.float32)
    for axis, way in ((0, 1), (0, -1), (1, 1), (1, -1)):
        depth, before = np.roll(inverse, way, axis), np.roll(inverse, 2 * way, axis)
        guess = np.where(np.abs(depth - before) <= STEP * depth, 2 * depth - before, depth)
        hidden = (depth > 0) & ((inverse == 0) | (guess < (1 - STEP) * inverse))
        farthest = np.maximum(farthest, np.where(hidden, guess, 0))  # the nearest of several
    return replace(picture, depth=inverse_depths(farthest[1:-1, 1:-1]))
