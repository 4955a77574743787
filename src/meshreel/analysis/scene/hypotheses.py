"""Decide which tracked objects move, find them in the other views, and prompt for them by motion (paper, section 3.2).

In: objects tracked through a reference view over time, and through all views of one moment. Out: the moving objects of
that moment, with their numbers in the reference view. Arrays only; the tracker is in `sam3`.

Differs from the paper's release: there, differences of the grey values of successive pictures give the prompts of one
object; here, depth less than the far depth of the pixel does, so that every object has prompts, a person who stands for
a while too, and shadows have none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32
from scipy.ndimage import binary_opening, distance_transform_edt, label

from ...geometry.cameras import Camera
from ...geometry.depth import apart
from ...geometry.drawing import Seen
from ...geometry.strict import inverse, products

Objects = Int32[np.ndarray, "T H W"]  # numbers of objects, from 1 on, over time or in several views; 0: none
# Guesses, untried with real weights (decision 17):
VARIATION = 0.1  # smallest variation over time of a moving object's mask
OVERLAP = 0.3  # smallest intersection over union of two masks of one object
SIDE = 160  # pixels along the longest side of a map of motion (guess)
_FAR = 0.9  # quantile over time of a pixel's depth that is that of the background (guess)
_LEAST = 5e-3  # share of a map's pixels below which a moving patch is noise, or a piece of a body (guess)
_WIDER = 0.15  # of the size of an object's box: how far beside it points are; as in the paper's release


@dataclass(frozen=True, slots=True)
class Tracked:
    """Objects tracked through a video; each pixel belongs to at most one."""

    objects: Objects  # numbers from 1 on; 0: none
    kinds: dict[int, str]  # for each number, the prompt that found the object


@dataclass(frozen=True, slots=True)
class Hypotheses:
    """Moving objects of a reference view over time."""

    objects: Objects  # numbers of objects that move; 0: none
    kinds: frozenset[str]  # kinds of which all objects in the reference view move

    @property
    def elsewhere(self) -> int:
        """Common number given to moving objects that the reference view does not see."""
        return int(self.objects.max(initial=0)) + 1


def hypotheses(tracked: Tracked) -> Hypotheses:
    """Select the objects of a video whose masks vary over time by at least `VARIATION`."""
    moving = {number for number in tracked.kinds if variation(tracked.objects, number) >= VARIATION}
    still = {tracked.kinds[number] for number in tracked.kinds if number not in moving}
    kinds = frozenset(tracked.kinds[number] for number in moving) - still
    objects = np.where(np.isin(tracked.objects, sorted(moving)), tracked.objects, 0)
    return Hypotheses(objects.astype(np.int32), kinds)


def variation(objects: Objects, number: int) -> float:
    """Return the variation of an object's mask over time, 0 to 1: 1 minus its mean overlap with its usual mask.

    The usual mask has the pixels covered in at least half of the frames in which the object is seen; other frames do
    not count. 0 for an object that is never seen.
    """
    masks = objects == number
    masks = masks[masks.any(axis=(1, 2))]
    if len(masks) == 0:
        return 0.0
    usual = masks.mean(axis=0) >= 0.5
    return 1.0 - float(np.mean([overlap(mask, usual) for mask in masks]))


def moving_in_views(tracked: Tracked, moving: Hypotheses, frame: int) -> Objects:
    """Return the moving objects of one moment in every view, the reference view first; 0: none.

    An object in the reference view moves if it overlaps with one of the hypotheses by `OVERLAP`; one that this view
    does not see moves if its kind does.
    """
    numbers = np.zeros(max(tracked.kinds, default=0) + 1, np.int32)
    for number, kind in tracked.kinds.items():
        mask = tracked.objects[0] == number
        if mask.any():
            seen = moving.objects[frame]
            shares = {int(other): overlap(mask, seen == other) for other in np.unique(seen[mask]) if other}
            best = max(shares, key=lambda other: (shares[other], -other), default=0)
            numbers[number] = best if shares.get(best, 0.0) >= OVERLAP else 0
        elif kind in moving.kinds:
            numbers[number] = moving.elsewhere
    return numbers[tracked.objects]


def overlap(first: np.ndarray, second: np.ndarray) -> float:
    """Return the intersection over union of two masks; 1 if both are empty."""
    union = int((first | second).sum())
    return int((first & second).sum()) / union if union else 1.0


def tour(views: Sequence[Camera], start: int) -> list[int]:
    """Return the views in an order that makes a video: from `start` on, the most similar remaining view is next.

    Views differ by the distance of their eyes and by the angle of their axes; opposite axes count as much as the
    largest distance between two eyes.
    """
    eyes = np.array([view.eye for view in views])
    axes = np.array([inverse(view.extrinsic[:3, :3])[:, 2] for view in views])
    away = np.linalg.norm(eyes[:, None] - eyes[None], axis=-1)
    costs = away / (away.max() or 1.0) + (1 - products(axes, axes.T)) / 2
    order = [start]
    while len(order) < len(views):
        ahead = np.where(np.isin(np.arange(len(views)), order), np.inf, costs[order[-1]])
        order.append(int(np.argmin(ahead)))
    return order


def reference_view(moments: Sequence[Sequence[Seen]]) -> int:
    """Return the number of the view in which depth changes in most pixels between a few moments."""
    changes = []
    for looks in zip(*moments, strict=True):
        depths = np.stack([look.depth for look in looks])
        nearest, farthest = depths.min(axis=0), depths.max(axis=0)
        with np.errstate(invalid="ignore"):  # nothing is seen at any moment
            changes.append(int((farthest - nearest > apart(nearest)).sum()))
    return int(np.argmax(changes))


_INSIDE, _BESIDE = 3, 2  # points on an object and beside it, as many as in the paper's release


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
    return np.asarray(binary_opening(nearer > apart(far), np.ones((1, 3, 3))))


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
