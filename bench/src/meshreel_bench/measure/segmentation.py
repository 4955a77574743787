"""Score of a segmentation into faces that move and faces that stand: found and true labels of each frame's faces."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Bool

from meshreel.errors import InputError

Labels = Bool[np.ndarray, " _"]  # True: the face moves; one a face of the frame


def score_labels(found: Iterable[Labels], true: Iterable[Labels]) -> dict[str, float | None]:
    """Return scores of labels frame by frame: 1, 1 and 0 are perfect. InputError where frames do not fit."""
    overlaps, called, static = list[float](), 0, 0
    try:
        for number, (a, b) in enumerate(zip(found, true, strict=True)):
            if a.shape != b.shape:
                raise InputError(f"frame {number}: {len(a)} labels for {len(b)} faces; label every face once")
            either = int((a | b).sum())
            overlaps.append(float((a & b).sum()) / either if either else 1.0)
            called, static = called + int((a & ~b).sum()), static + int((~b).sum())
    except ValueError:  # of zip: InputError is none
        raise InputError(f"only {len(overlaps)} frames have labels both found and true; label every frame") from None
    if not overlaps:
        raise InputError("labels of 0 frames; give one frame at least")
    mean, worst = float(np.mean(overlaps)), min(overlaps)
    return {"iou_mean": mean, "iou_worst": worst, "static_called_dynamic": called / max(static, 1)}
