"""Point prompts on moving objects in a view over time, an alternative to words for SAM3 (paper, section 3.2).

In: the depths that one view sees in all frames. Out: for each moving object, points on it and beside it, in the frame
that shows most of it.

Differs from the paper's release: there, differences of the grey values of successive pictures give the prompts of one
object; here, depth less than the far depth of the pixel does, so that every object has prompts, a person who stands for
a while too, and shadows have none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64
from scipy.ndimage import binary_opening, distance_transform_edt, label

from .hypotheses import APART

SIDE = 160  # pixels along the longest side of a map of motion (guess)
_FAR = 0.9  # quantile over time of a pixel's depth that is that of the background (guess)
_LEAST = 5e-3  # share of a map's pixels below which a moving patch is noise, or a piece of a body (guess)
_INSIDE, _BESIDE = 3, 2  # points on an object and beside it, as many as in the paper's release
_WIDER = 0.15  # of the size of an object's box: how far beside it points are; as in the paper's release


@dataclass(frozen=True, slots=True)
class Prompt:
    """Points on an object and on its surroundings."""

    frame: int
    points: Float64[np.ndarray, "N 2"]  # x and y, as shares of the picture's width and height
    inside: Bool[np.ndarray, " N"]  # True: on the object; False: beside it


def thinned(depth: Float32[np.ndarray, "H W"]) -> Float32[np.ndarray, "h w"]:
    """Return a depth picture with at most `SIDE` rows and columns."""
    step = -(-max(depth.shape) // SIDE)
    return depth[step // 2 :: step, step // 2 :: step].copy()


def motion_prompts(depths: Sequence[Float32[np.ndarray, "h w"]]) -> list[Prompt]:
    """Return prompts for each moving object, given the depths (m, infinite: none) of all frames."""
    moving = _moving(np.stack(depths))
    least = max(1.0, _LEAST * moving[0].size)
    things, count = label(moving, np.ones((3, 3, 3)))  # linked over time: each is shown once
    areas = np.stack([np.bincount(frame.reshape(-1), minlength=count + 1) for frame in things])
    prompts = []
    for thing, frame in enumerate(areas[:, 1:].argmax(axis=0).tolist(), 1):
        pieces, number = label(things[frame] == thing, np.ones((3, 3)))
        patches = [np.asarray(pieces == piece) for piece in range(1, number + 1)]
        prompts += [_prompt(frame, patch, moving[frame]) for patch in patches if patch.sum() >= least]
    return prompts


def _moving(depths: Float32[np.ndarray, "T h w"]) -> Bool[np.ndarray, "T h w"]:
    """Return the pixels of each frame that see surface nearer than the background, without specks."""
    covered = np.isfinite(depths).any(axis=0)
    depths_or_nan = np.where(np.isfinite(depths) | ~covered, depths, np.nan)
    far = np.nanquantile(np.where(covered, depths_or_nan, 0), _FAR, axis=0)
    nearer = np.where(np.isfinite(depths), far - depths, 0)
    return np.asarray(binary_opening(nearer > np.maximum(APART[0], APART[1] * far), np.ones((1, 3, 3))))


def _prompt(frame: int, patch: Bool[np.ndarray, "h w"], moving: Bool[np.ndarray, "h w"]) -> Prompt:
    depth = distance_transform_edt(np.pad(patch, 1))[1:-1, 1:-1]  # pixels to the patch's border
    rows, columns = np.indices(patch.shape)
    points: list[tuple[int, int]] = []
    for _ in range(_INSIDE):  # each in the middle of what is left of the patch
        row, column = np.unravel_index(np.argmax(depth), patch.shape)
        points.append((int(column), int(row)))
        depth = np.where((rows - row) ** 2 + (columns - column) ** 2 <= patch.sum() / 8, 0, depth)
        if not depth.any():
            break
    y, x = np.nonzero(patch)
    pad = _WIDER * max(np.ptp(x) + 1, np.ptp(y) + 1) + 1
    corners = [(across, down) for down in (y.min() - pad, y.max() + pad) for across in (x.min() - pad, x.max() + pad)]
    around = np.clip(np.rint(corners), 0, np.array(patch.shape[::-1]) - 1).astype(np.int64)
    beside = [(int(across), int(down)) for across, down in around if not moving[down, across]][:_BESIDE]
    places = (np.array(points + beside) + 0.5) / patch.shape[::-1]
    return Prompt(frame, places, np.arange(len(places)) < len(points))
