"""Score of a segmentation into faces that move and faces that stand.

In: labels of each frame's faces, found and true -> intersection over union of the dynamic faces, mean and worst frame,
and the share of the static faces that are called dynamic.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from meshreel.errors import InputError

Labels = Bool[np.ndarray, " _"]  # True: the face moves; one a face of the frame


@dataclass(frozen=True, slots=True)
class SegmentationScore:
    """Score of a segmentation; 1, 1 and 0 are perfect."""

    iou: tuple[float, ...]  # of the dynamic faces, by frame; 1 where there are none, found or true
    static_called_dynamic: float  # share of all static faces of all frames

    @property
    def mean(self) -> float:
        """IoU over the frames."""
        return float(np.mean(self.iou))

    @property
    def worst(self) -> float:
        """IoU of the worst frame."""
        return min(self.iou)


def score_labels(found: Iterable[Labels], true: Iterable[Labels]) -> SegmentationScore:
    """The score of labels that are given frame by frame. Raises InputError where frames or faces do not fit."""
    overlaps, called, static = [], 0, 0
    pairs = zip(iter(found), iter(true), strict=True)
    try:
        for number, (a, b) in enumerate(pairs):
            if a.shape != b.shape:
                raise InputError(f"frame {number}: {len(a)} labels for {len(b)} faces; label every face once")
            either = int((a | b).sum())
            overlaps.append(float((a & b).sum()) / either if either else 1.0)
            called, static = called + int((a & ~b).sum()), static + int((~b).sum())
    except ValueError:  # of zip: InputError is none
        raise InputError(f"only {len(overlaps)} frames have labels both found and true; label every frame") from None
    if not overlaps:
        raise InputError("labels of 0 frames; give one frame at least")
    return SegmentationScore(tuple(overlaps), called / max(static, 1))
