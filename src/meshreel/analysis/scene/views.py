"""Placement of views that all frames share and that together see nearly every face (paper, section 3.2).

In: a few frames of a scene. Out: cameras. Candidates stand on a grid in the scene's box and look in 26 directions. They
are chosen greedily: the next is the candidate expected to see most of the surface that the earlier ones do not see.

Differs from the paper: it does not state its viewpoints, so this placement is ours (docs/decisions/0017-views.md).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from jaxtyping import Float32, Float64, Int64

from ...errors import InputError
from ...geometry import work
from ...geometry.cameras import Camera, CameraPose, Rays, matrix_of
from ...geometry.strict import dot, norm, products, rounded
from ...geometry.threads import mapped
from ...geometry.topology import face_normals
from ...types import UP_AXES, Frames, Mesh, Up

Place = Float64[np.ndarray, " 3"]
_TOUCHES = 1e-3  # of a ray's length: a hit this near its end is the sample itself; a guess
_INSIDE = 0.5  # a place that sees more than this share of its samples from behind is inside an object; a guess
_SURE = 0.9  # probability that a pixel meets a face of its size; below 1, so that a further view still gains: a guess
_WAYS = np.array([w for w in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(w)])
_ACROSS = rounded(math.tan(math.radians(75.0) / 2))  # of half the horizontal field of view (decision 17)
_PLACES = 6  # candidate places along the longest side of the box (decision 17)
_FRAMES = 4  # frames inspected, spread evenly over those given (decision 17)
_SAMPLES = 2048  # points sampled on the surface of each inspected frame (decision 17)


def place_views(
    meshes: Sequence[Mesh] | Frames, up: Up = "y", count: int = 14, width: int = 320, height: int = 240
) -> tuple[Camera, ...]:
    """Place `count` views of `width` x `height` pixels that together see nearly all of the meshes (decision 17).

    Only `_FRAMES` of the meshes are read. Raises InputError if none of those has a surface. Takes some 4 s of
    CPU for four frames of 500,000 faces.
    """
    chosen = sorted({int(k) for k in np.linspace(0, len(meshes) - 1, _FRAMES)}) if len(meshes) else []
    samples = [_Samples.of(mesh, _SAMPLES) for mesh in (meshes[k] for k in chosen) if not mesh.is_empty]
    if not samples:
        raise InputError(f"none of the {len(chosen)} inspected frames has a surface; give a frame with faces")
    low = np.min([s.mesh.vertices[s.mesh.faces].min(axis=(0, 1)) for s in samples], axis=0)
    high = np.max([s.mesh.vertices[s.mesh.faces].max(axis=(0, 1)) for s in samples], axis=0)
    step = float((high - low).max()) / _PLACES or 1.0
    parts = [max(1, round(side / step)) for side in (high - low).tolist()]
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in parts), indexing="ij"), axis=-1).reshape(-1, 3)
    places = _outside(list(low + (high - low) * (cells + 0.5) / parts), samples)
    focal = width / 2 / _ACROSS
    lens = Camera(width, height, (focal, focal), (width / 2, height / 2))
    candidates = list[Camera]()
    for eye, turn in itertools.product((eye for eye, _ in places), _turns(up)):
        pose = CameraPose.of_world(matrix_of(turn, -products(turn, eye[:, None])[:, 0]))
        candidates.append(replace(lens, pose=pose))
    pixels = np.empty((len(candidates), sum(len(part.points) for part in samples)), np.float32)  # some 100 MB

    def fill(number: int, eye: Place, sees: list[np.ndarray]) -> None:
        work.passed("views")
        pixels[len(_WAYS) * number : len(_WAYS) * (number + 1)] = _pixels(eye, sees, samples, _turns(up), lens)

    mapped(fill, range(len(places)), *zip(*places, strict=True))
    return _greedy(candidates, pixels, count)


@dataclass(frozen=True, slots=True)
class _Samples:
    """Points spread over a mesh evenly by area, and the faces that they lie on."""

    mesh: Mesh
    rays: Rays
    points: Float64[np.ndarray, "N 3"]
    faces: Int64[np.ndarray, " N"]
    normals: Float64[np.ndarray, "N 3"]
    areas: Float64[np.ndarray, " N"]  # of the faces

    @staticmethod
    def of(mesh: Mesh, count: int) -> _Samples:
        normals, areas = face_normals(mesh)
        ends = np.cumsum(areas)
        steps = np.arange(count)
        faces = np.minimum(np.searchsorted(ends, (steps + 0.5) / count * ends[-1]), len(areas) - 1)
        # A deterministic low-discrepancy sequence in the unit square, folded into the triangle.
        u, v = (steps * 0.7548776662466927) % 1, (steps * 0.5698402909980532) % 1
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        points = np.einsum("kn,nkd->nd", np.stack([1 - u - v, u, v]), mesh.vertices[mesh.faces[faces]])
        return _Samples(mesh, Rays(mesh), points, faces, normals[faces], areas[faces])

    def seen_from(self, eye: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return masks of the samples that are visible from `eye`, and of those visible from behind."""
        ahead = self.points - eye
        hit = self.rays.cast(np.broadcast_to(eye, ahead.shape), ahead)
        free = (hit.faces == self.faces) | (hit.distances > 1 - _TOUCHES)
        return free, free & ((self.normals * ahead).sum(axis=1) > 0)


def _outside(eyes: list[Place], samples: list[_Samples]) -> list[tuple[Place, list[np.ndarray]]]:
    """Return the places inside no object in any frame, or all if none is, with the visible samples of each frame."""

    def look(eye: Place) -> tuple[list[np.ndarray], bool]:
        work.passed("views")
        looks = [part.seen_from(eye) for part in samples]
        return [free for free, _ in looks], all(back.sum() <= _INSIDE * free.sum() for free, back in looks)

    places = [(eye, sees, out) for eye, (sees, out) in zip(eyes, mapped(look, eyes), strict=True)]
    return [(eye, sees) for eye, sees, out in places if out] or [(eye, sees) for eye, sees, _ in places]


def _pixels(
    eye: np.ndarray, sees: list[np.ndarray], samples: list[_Samples], turns: Float64[np.ndarray, "W 3 3"], lens: Camera
) -> Float32[np.ndarray, "W N"]:
    """Return the size in pixels, at most 1, of each sample's face in each viewing direction; all frames in one row."""
    focal, across = lens.focal[0], _ACROSS
    high = across * lens.height / lens.width
    sizes = []
    for part, free in zip(samples, sees, strict=True):
        ahead = part.points[free] - eye
        distance = np.maximum(np.linalg.norm(ahead, axis=1), 1e-12)
        facing = np.abs((part.normals[free] * ahead).sum(axis=1)) / distance
        on_axis = (focal**2 * facing * part.areas[free] / distance**2).astype(np.float32)  # on the axis
        x, y, z = np.moveaxis(np.einsum("nd,wed->wne", ahead / distance[:, None], turns), 2, 0)
        within = (np.abs(x) < across * z) & (np.abs(y) < high * z)
        sizes.append(np.zeros((len(turns), len(free)), np.float32))
        sizes[-1][:, free] = np.where(within, np.minimum(on_axis / np.maximum(z, 1e-3) ** 3, 1), 0)
    return np.concatenate(sizes, axis=1)


def _greedy(candidates: list[Camera], pixels: Float32[np.ndarray, "C N"], count: int) -> tuple[Camera, ...]:
    """Choose views one by one, each expected to see most of the samples that the earlier views do not see."""
    unseen = np.ones(pixels.shape[1], np.float32)  # probability that no pixel of the chosen views meets the face
    chosen: list[Camera] = []
    for _ in range(min(count, len(candidates))):
        best = int(np.argmax(np.einsum("cn,n->c", pixels, unseen)))
        chosen.append(candidates[best])
        unseen *= 1 - _SURE * pixels[best]
        pixels[best] = 0  # no view twice
    return tuple(chosen)


@cache
def _turns(axis: Up) -> Float64[np.ndarray, "W 3 3"]:
    """Return the rotation from world to camera for each viewing direction; upright unless the direction is vertical."""
    up = np.array(UP_AXES[axis])
    turns = []
    for way in _WAYS:
        forward = way / norm(way)
        right = np.cross(forward, np.roll(up, 1) if abs(dot(forward, up)) > 0.99 else up)
        right /= norm(right)
        turns.append(np.stack([right, np.cross(forward, right), forward]))
    return np.array(turns)
