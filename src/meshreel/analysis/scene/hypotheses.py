"""Which tracked objects move, and where they are in views they were not tracked in (paper, section 3.2).

In: objects that a tracker follows through a reference view over time, and through the views of one moment. Out: the
objects of the moment that move, by the numbers they have in the reference view. Pure arrays; `sam3` has the tracker.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int32

from ...errors import InputError
from ...geometry.cameras import PinholeCamera
from ...geometry.raycast import Seen

_APART = (0.06, 0.02)  # m, and of the depth: what changes by more is something else


@dataclass(frozen=True, slots=True)
class Tracked:
    """Objects that are followed through a video; each pixel belongs to one at most."""

    objects: Int32[np.ndarray, "T H W"]  # numbers from 1 on; 0: none
    kinds: dict[int, str]  # what each number is, as the prompt says


@dataclass(frozen=True, slots=True)
class HypothesisOptions:
    """When a tracked object counts as moving, and when two masks are of one object."""

    variation: float = 0.1  # of an object's mask over time, from which on it moves
    overlap: float = 0.3  # intersection over union from which on masks are of one object

    def __post_init__(self) -> None:
        if not (0 < self.variation <= 1 and 0 < self.overlap <= 1):
            text = f"variation {self.variation:g}, overlap {self.overlap:g}"
            raise InputError(f"{text}: give shares above 0, up to 1")


@dataclass(frozen=True, slots=True)
class Hypotheses:
    """What of a reference view moves."""

    objects: Int32[np.ndarray, "T H W"]  # numbers of objects that move; 0: none
    kinds: frozenset[str]  # of which every object that the reference view sees moves

    @property
    def elsewhere(self) -> int:
        """The number of moving objects that the reference view does not see."""
        return int(self.objects.max(initial=0)) + 1


def hypotheses(tracked: Tracked, options: HypothesisOptions = HypothesisOptions()) -> Hypotheses:
    """The objects of a video over time whose masks vary."""
    moving = {number for number in tracked.kinds if variation(tracked.objects, number) >= options.variation}
    still = {tracked.kinds[number] for number in tracked.kinds if number not in moving}
    kinds = frozenset(tracked.kinds[number] for number in moving) - still
    kept = np.where(np.isin(tracked.objects, sorted(moving)), tracked.objects, 0)
    return Hypotheses(kept.astype(np.int32), kinds)


def variation(objects: Int32[np.ndarray, "T H W"], number: int) -> float:
    """How much an object's mask varies, 0 to 1: one less its mean overlap with its mask in most of its frames.

    Only frames count in which it is seen; 0 where it never is.
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
    """The objects of one moment that move, in every view, the reference view first; 0: none.

    An object that the reference view sees moves where it is one of the hypotheses; one that it does not see goes by
    its kind.
    """
    numbers = np.zeros(max(tracked.kinds, default=0) + 1, np.int32)
    for number, kind in tracked.kinds.items():
        mask = tracked.objects[0] == number
        if mask.any():
            numbers[number] = _match(mask, moving.objects[frame], options.overlap)
        elif kind in moving.kinds:
            numbers[number] = moving.elsewhere
    return numbers[tracked.objects]


def overlap(one: np.ndarray, other: np.ndarray) -> float:
    """Intersection over union of two masks; 1 where both are empty."""
    union = int((one | other).sum())
    return int((one & other).sum()) / union if union else 1.0


def tour(views: Sequence[PinholeCamera], start: int) -> list[int]:
    """All views from one on, each next the one most alike, so that they make a video: as far apart as eyes and axes.

    One turned by 180 degrees counts as one that stands as far off as the views do at most.
    """
    eyes = np.array([view.eye for view in views])
    axes = np.array([np.linalg.inv(view.extrinsic[:3, :3])[:, 2] for view in views])
    away = np.linalg.norm(eyes[:, None] - eyes[None], axis=-1)
    costs = away / (away.max() or 1.0) + (1 - axes @ axes.T) / 2
    order = [start]
    while len(order) < len(views):
        ahead = np.where(np.isin(np.arange(len(views)), order), np.inf, costs[order[-1]])
        order.append(int(np.argmin(ahead)))
    return order


def reference_view(moments: Sequence[Sequence[Seen]]) -> int:
    """The view, of what all views see at a few moments, in which depth changes in most pixels."""
    changes = []
    for seen in zip(*moments, strict=True):
        depths = np.stack([one.depth for one in seen])
        nearest, farthest = depths.min(axis=0), depths.max(axis=0)
        with np.errstate(invalid="ignore"):  # nothing is seen at any moment
            changes.append(int((farthest - nearest > np.maximum(_APART[0], _APART[1] * nearest)).sum()))
    return int(np.argmax(changes))


def _match(mask: np.ndarray, objects: Int32[np.ndarray, "H W"], least: float) -> int:
    """The number of the object whose mask is most alike; 0 where none is enough."""
    shares = {int(number): overlap(mask, objects == number) for number in np.unique(objects[mask]) if number}
    best = max(shares, key=lambda number: (shares[number], -number), default=0)
    return best if shares.get(best, 0.0) >= least else 0
