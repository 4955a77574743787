"""Render the views as pictures for people and for tools that make masks (paper, section 3.2).

In: views of frames, and the pictures of colour cameras if there are any. Out: these without lens distortion, or normals
as colors; and folders of such pictures in the layout of the mask folders that `ImageMasks` reads.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float64, UInt8

from ...geometry.cameras import Camera, Rays, Seen, pack_cameras
from ...io.write import frame_names, make_folder, replacing, write_picture
from ...types import Frames
from .color_looks import ColorLooks
from .masks import CAMERAS, one_size


def normal_picture(seen: Seen, view: Camera) -> UInt8[np.ndarray, "H W 3"]:
    """Render normals n in world axes as colors (n + 1) / 2; white where nothing is seen.

    Normals are computed from the depths of neighbouring pixels, so they face the camera whatever the orientation of the
    faces.
    """
    ahead = view.ahead
    hit = np.isfinite(seen.depth)
    points = np.where(hit, seen.depth, np.nan)[..., None] * ahead
    normals = np.nan_to_num(np.cross(_step(points, 1), _step(points, 0)))
    normals *= -np.sign((normals * ahead).sum(axis=-1, keepdims=True))
    world = np.einsum("hwd,de->hwe", normals, view.extrinsic[:3, :3])
    world /= np.maximum(np.linalg.norm(world, axis=-1, keepdims=True), 1e-30)
    colors = np.rint(255 * (world + 1) / 2).astype(np.uint8)
    return np.where(hit[..., None], colors, np.uint8(255))


def write_views(
    folder: Path,
    frames: Frames,
    views: Sequence[Camera],
    report: Callable[[int], None] = lambda _done: None,
    colors: ColorLooks | None = None,
) -> None:
    """Write pictures of each frame from each view: view00/frame_00000.png ..., and `cameras.json` last.

    The pictures are those in `colors`, if given, whose views these are; else normals. A tool that makes masks from them
    keeps names and sizes, and puts the same `cameras.json` beside its masks. `report` is called with the number of
    finished frames.
    """
    views = one_size(views, "views")
    places = [folder / f"view{number:02}" for number in range(len(views))]
    for place in places:
        make_folder(place)
    for number, name in enumerate(frame_names(len(frames), "png")):
        rays = Rays(frames[number])
        for view, place in enumerate(places):
            photo = None if colors is None else colors.at(number, view)
            picture = normal_picture(rays.look(views[view]), views[view]) if photo is None else photo
            write_picture(picture, place / name)
        report(number + 1)
    with replacing(folder / CAMERAS) as file:
        file.write(pack_cameras(views))


def _step(points: Float64[np.ndarray, "H W 3"], axis: int) -> Float64[np.ndarray, "H W 3"]:
    """Return the vector to the next point along an axis: ahead or behind, whichever differs less in depth.

    This keeps edges sharp.
    """
    ahead = np.diff(points, axis=axis)
    none = np.full_like(np.take(points, [0], axis=axis), np.nan)
    after, before = np.concatenate([ahead, none], axis=axis), np.concatenate([none, ahead], axis=axis)
    costs = [np.where(np.isnan(step[..., 2:]), np.inf, np.abs(step[..., 2:])) for step in (after, before)]
    return np.where(costs[0] <= costs[1], after, before)
