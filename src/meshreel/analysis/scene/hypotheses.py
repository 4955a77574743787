"""Decide which tracked objects move, and find them in the other views (paper, section 3.2).

In: objects tracked through a reference view over time, and through all views of one moment. Out: the moving objects of
that moment, with their numbers in the reference view. Arrays only; the tracker is in `sam3`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int32

from ...geometry.cameras import Camera, Seen
from ...geometry.strict import inverse, products

APART = (0.06, 0.02)  # m, and share of the depth: a pixel whose depth varies by more sees motion; guesses


@dataclass(frozen=True, slots=True)
class Tracked:
    """Objects tracked through a video; each pixel belongs to at most one."""

    objects: Int32[np.ndarray, "T H W"]  # numbers from 1 on; 0: none
    kinds: dict[int, str]  # for each number, the prompt that found the object


@dataclass(frozen=True, slots=True)
class HypothesisOptions:
    """Thresholds for moving objects and for masks of one object; guesses, untried with real weights (decision 17)."""

    variation: float = 0.1  # smallest variation over time of a moving object's mask
    overlap: float = 0.3  # smallest intersection over union of two masks of one object


@dataclass(frozen=True, slots=True)
class Hypotheses:
    """Moving objects of a reference view over time."""

    objects: Int32[np.ndarray, "T H W"]  # numbers of objects that move; 0: none
    kinds: frozenset[str]  # kinds of which all objects in the reference view move

    @property
    def elsewhere(self) -> int:
        """Common number given to moving objects that the reference view does not see."""
        return int(self.objects.max(initial=0)) + 1


def hypotheses(tracked: Tracked, options: HypothesisOptions = HypothesisOptions()) -> Hypotheses:
    """Select the objects of a video whose masks vary over time."""
    moving = {number for number in tracked.kinds if variation(tracked.objects, number) >= options.variation}
    still = {tracked.kinds[number] for number in tracked.kinds if number not in moving}
    kinds = frozenset(tracked.kinds[number] for number in moving) - still
    objects = np.where(np.isin(tracked.objects, sorted(moving)), tracked.objects, 0)
    return Hypotheses(objects.astype(np.int32), kinds)


def variation(objects: Int32[np.ndarray, "T H W"], number: int) -> float:
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


def moving_in_views(
    tracked: Tracked, moving: Hypotheses, frame: int, options: HypothesisOptions = HypothesisOptions()
) -> Int32[np.ndarray, "X H W"]:
    """Return the moving objects of one moment in every view, the reference view first; 0: none.

    An object in the reference view moves if it matches one of the hypotheses; one that this view does not see moves
    if its kind does.
    """
    numbers = np.zeros(max(tracked.kinds, default=0) + 1, np.int32)
    for number, kind in tracked.kinds.items():
        mask = tracked.objects[0] == number
        if mask.any():
            numbers[number] = _match(mask, moving.objects[frame], options.overlap)
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
            changes.append(int((farthest - nearest > np.maximum(APART[0], APART[1] * nearest)).sum()))
    return int(np.argmax(changes))


def _match(mask: np.ndarray, objects: Int32[np.ndarray, "H W"], least: float) -> int:
    """Return the number of the object with the largest overlap with a mask; 0 if none reaches `least`."""
    shares = {int(number): overlap(mask, objects == number) for number in np.unique(objects[mask]) if number}
    best = max(shares, key=lambda number: (shares[number], -number), default=0)
    return best if shares.get(best, 0.0) >= least else 0
