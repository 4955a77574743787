"""Pictures that splats are fitted to: of a coloured mesh from around it, or what colour cameras saw of a body.

In: a mesh, and what knows its colours -> cameras with pictures of the mesh alone, on white. Cameras look at the mesh
only: their pictures are cut to it, so that few pixels are empty.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from jaxtyping import Float64

from ...geometry.cameras import Camera, CameraPose, looking_at
from ...geometry.color_views import ColorPicture, sampled
from ...geometry.painted import Painted
from ...geometry.raycast import Hit, Rays, pixels_near
from ...types import UP_AXES, Mesh, Up
from .splat_fit import SplatView

GOLDEN = (math.sqrt(5) - 1) / 2  # of a turn, from a frame's cameras to the next one's: no two frames have the same
TILTS = (0.1, 0.4)  # rad, above the horizon, of cameras in turn (guess)
AWAY = 1.6  # sizes of the mesh, between its middle and a camera (guess)
BORDER = 3  # pixels beside the mesh
FINER = 2  # rays a pixel, along both sides
HIDDEN = 0.01  # of the distance: what is nearer by that hides the mesh (guess)
Colors = Callable[[Hit, Float64[np.ndarray, "N 3"]], Float64[np.ndarray, "N 3"]]  # of hits, and where they are


def ring(mesh: Mesh, count: int, size: int, turn: float, up: Up = "y") -> list[Camera]:
    """Return cameras around a mesh, which fills pictures of `size` pixels; `turn` is that of the first, in turns."""
    extent, found = mesh.diagonal, list[Camera]()
    above = np.array(UP_AXES[up])
    axis = int(np.abs(above).argmax())
    along, aside = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
    for number in range(count):
        angle, tilt = 2 * math.pi * (number / count + turn), TILTS[number % len(TILTS)]
        way = math.cos(tilt) * (math.cos(angle) * along + math.sin(angle) * aside) + math.sin(tilt) * above
        pose = CameraPose.of_camera(looking_at(mesh.middle + AWAY * extent * way, mesh.middle, axis))
        camera = Camera(size, size, (float(size), float(size)), (0.0, 0.0), pose)
        found += [cut] if (cut := cut_to(camera, mesh, size)) else []
    return found


def cut_to(camera: Camera, mesh: Mesh, size: int, most: float = math.inf) -> Camera | None:
    """Return a camera at the same place whose picture is the mesh, its longer side `size` pixels; None: out of sight.

    Its pixels are at most `most` times as fine.
    """
    if mesh.is_empty:
        return None
    local = mesh.vertices @ camera.extrinsic[:3, :3].T + camera.extrinsic[:3, 3]
    if local[:, 2].min() <= 0:
        return None
    places = camera.project(local)
    low, high = places.min(axis=0), places.max(axis=0)
    if most < math.inf:  # of a real picture, nothing is known beyond its border
        low, high = np.maximum(low, 0), np.minimum(high, [camera.width, camera.height])
    extent = float((high - low).max())
    if (high - low).min() < 1:
        return None
    scale = min((size - 2 * BORDER) / extent, most)
    width, height = (max(math.ceil(scale * side) + 2 * BORDER, 8) for side in (high - low))
    moved = np.array([[scale, 0, BORDER - scale * low[0]], [0, scale, BORDER - scale * low[1]], [0, 0, 1]])
    return Camera.of(width, height, moved @ camera.intrinsic, camera.extrinsic)


def rendered(mesh: Mesh, cameras: Sequence[Camera]) -> tuple[SplatView, ...]:
    """Return pictures of a coloured mesh, without light."""
    rays, painted = Rays(mesh), Painted(mesh)
    return tuple(_view(mesh, rays, camera, lambda hit, _: painted.on(hit.faces, hit.barycentric)) for camera in cameras)


def taken(pictures: Sequence[ColorPicture], body: Mesh, whole: Mesh, size: int) -> tuple[SplatView, ...]:
    """Return what colour cameras saw of a body, on white; NaN where something else hides it, and beyond the picture.

    `whole` is all surface of the frame.
    """
    rays, hides, found = Rays(body), Rays(whole), list[SplatView]()
    for picture in pictures:
        camera = cut_to(picture.camera.straight, body, size, most=1.0)
        if camera is not None:
            found.append(_view(body, rays, camera, partial(_pictured, picture, hides)))
    return tuple(found)


def _pictured(
    picture: ColorPicture, hides: Rays, _hit: Hit, points: Float64[np.ndarray, "N 3"]
) -> Float64[np.ndarray, "N 3"]:
    eye = picture.camera.eye
    first = hides.cast(np.broadcast_to(eye, points.shape), points - eye).distances  # the points are at 1
    positions, _ = picture.project(points)
    height, width = picture.pixels.shape[:2]
    with np.errstate(invalid="ignore"):
        inside = (positions >= 0).all(axis=1) & (positions <= [width, height]).all(axis=1)
    known = inside & (first > 1 - HIDDEN)
    colors = np.full(points.shape, np.nan)
    colors[known] = sampled(picture.pixels, positions[known]) / picture.gains
    return colors


def _view(mesh: Mesh, rays: Rays, camera: Camera, colors: Colors) -> SplatView:
    """Cast rays through parts of pixels, and give these the mean of the colours that they find."""
    fine = camera.resized(FINER * camera.width, FINER * camera.height)
    rows, columns = np.nonzero(pixels_near(fine, mesh))
    _, local = fine.rays(np.column_stack([columns, rows]) + 0.5)
    directions = local @ fine.extrinsic[:3, :3]
    hit = rays.cast(np.broadcast_to(fine.eye, directions.shape), directions)
    met = hit.faces >= 0
    met_hit = Hit(hit.faces[met], hit.distances[met], hit.barycentric[met])
    picture = np.full((fine.height, fine.width, 3), 255.0)
    points = fine.eye + hit.distances[met, None] * directions[met]
    picture[rows[met], columns[met]] = colors(met_hit, points)
    parts = picture.reshape(camera.height, FINER, camera.width, FINER, 3)
    return SplatView(camera, (parts.mean(axis=(1, 3)) / 255).astype(np.float32))
