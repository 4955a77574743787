"""Lift the masks of views to faces: each pixel votes on the face that it sees (paper, section 3.2, eqs. 1 to 4).

In: the face that each pixel sees, and a mask of the moving pixels. Out: votes, visibility and score of each face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64


@dataclass(frozen=True, slots=True)
class Votes:
    """Numbers of pixels, over all views, that see each face (U) and that see it as moving (V)."""

    dynamic: Int64[np.ndarray, " F"]  # eq. 2; at most `seen`
    seen: Int64[np.ndarray, " F"]  # eq. 3; 0: no view sees the face

    @staticmethod
    def of(ids: Int32[np.ndarray, "X H W"], masks: Bool[np.ndarray, "X H W"], faces: int) -> Votes:
        """Count the votes on `faces` faces; `ids`: the face that each pixel sees, -1: none; `masks`: moving pixels."""
        assert ids.shape == masks.shape, "one mask per view"
        hit = ids >= 0
        return Votes(
            np.bincount(ids[hit & masks], minlength=faces),  # eq. 2
            np.bincount(ids[hit], minlength=faces),  # eq. 3
        )

    @property
    def score(self) -> Float64[np.ndarray, " F"]:
        """Share of the pixels seeing a face that call it moving, 0 to 1; 0 for a face that no view sees."""
        return self.dynamic / np.maximum(self.seen, 1)  # eq. 4
