"""Labels of faces to look at: colors of bodies, pictures of what the views see in them, and one sheet of many pictures.

In: what moves in some frames, and the views. Out: colors, and pictures as arrays.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Integer, UInt8

from ...geometry.cameras import PinholeCamera
from ...geometry.raycast import Rays, Seen
from ...types import Mesh
from .pictures import normal_picture

_RESTS, _NO_BODY = (205, 205, 205), (90, 90, 90)
_BODIES = (
    (214, 39, 40),
    (31, 119, 180),
    (44, 160, 44),
    (255, 127, 14),
    (148, 103, 189),
    (23, 190, 207),
)
_LIGHT = np.array([0.36, 0.80, 0.48])
_AMBIENT = 0.45  # what no light reaches has this much of its color
_GAP = 4  # pixels


def label_colors(moving: Bool[np.ndarray, " F"], bodies: Integer[np.ndarray, " F"]) -> UInt8[np.ndarray, "F 3"]:
    """A color a face: light gray where it rests, one of six by the number of its body, dark gray for bits of none."""
    own = np.array(_BODIES, np.uint8)[(bodies.astype(np.int64) - 1) % len(_BODIES)]
    known = np.where((bodies > 0)[:, None], own, np.array(_NO_BODY, np.uint8))
    return np.where(moving[:, None], known, np.array(_RESTS, np.uint8))


def colored_picture(seen: Seen, view: PinholeCamera, colors: UInt8[np.ndarray, "F 3"]) -> UInt8[np.ndarray, "H W 3"]:
    """What a view sees, in the faces' colors under one light; white where nothing is seen."""
    normals = normal_picture(seen, view).astype(np.float64) * (2 / 255) - 1
    light = _AMBIENT + (1 - _AMBIENT) * np.abs(normals @ _LIGHT)
    hit = seen.faces >= 0
    picture = np.full((*hit.shape, 3), 255, np.uint8)
    picture[hit] = np.rint(colors[seen.faces[hit]] * np.minimum(light[hit], 1)[:, None])
    return picture


def look_at_labels(
    mesh: Mesh, moving: Bool[np.ndarray, " F"], bodies: Integer[np.ndarray, " F"], views: Sequence[PinholeCamera]
) -> tuple[list[UInt8[np.ndarray, "H W 3"]], list[int]]:
    """A picture a view, and how many faces that move it sees."""
    rays, colors = Rays(mesh), label_colors(moving, bodies)
    looks = [rays.look(view) for view in views]
    pictures = [colored_picture(seen, view, colors) for seen, view in zip(looks, views, strict=True)]
    return pictures, [int(moving[np.unique(seen.faces[seen.faces >= 0])].sum()) for seen in looks]


def sheet(rows: Sequence[Sequence[UInt8[np.ndarray, "H W 3"]]]) -> UInt8[np.ndarray, "Y X 3"]:
    """Pictures of one size, in rows of one length, on white."""
    height, width, _ = rows[0][0].shape
    whole = np.full((len(rows) * (height + _GAP) - _GAP, len(rows[0]) * (width + _GAP) - _GAP, 3), 255, np.uint8)
    for i, row in enumerate(rows):
        for k, picture in enumerate(row):
            y, x = i * (height + _GAP), k * (width + _GAP)
            whole[y : y + height, x : x + width] = picture
    return whole
