"""Masks of views lifted to faces: each pixel that sees a face votes on it (paper, section 3.2, eqs. 1 to 4).

In: the face that each pixel sees, and a mask of the pixels that move. Out: votes, visibility and score of each face.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from ...geometry.cameras import PinholeCamera
from ...geometry.raycast import Rays


@dataclass(frozen=True, slots=True)
class Votes:
    """How many pixels of all views see each face (U), and how many of them say that it moves (V)."""

    dynamic: Int64[np.ndarray, " F"]  # eq. 2; at most `seen`
    seen: Int64[np.ndarray, " F"]  # eq. 3; 0: no view sees the face

    @staticmethod
    def of(ids: Int32[np.ndarray, "X H W"], masks: Bool[np.ndarray, "X H W"], faces: int) -> Votes:
        """The votes on so many faces; `ids` as `primitive_ids` gives them, masks True where a pixel moves."""
        assert ids.shape == masks.shape, "a mask a view"
        hit = ids >= 0
        return Votes(
            np.bincount(ids[hit & masks], minlength=faces),  # eq. 2
            np.bincount(ids[hit], minlength=faces),  # eq. 3
        )

    @property
    def score(self) -> Float64[np.ndarray, " F"]:
        """The share of the pixels seeing a face that say it moves, 0 to 1; 0 for a face that no view sees."""
        return self.dynamic / np.maximum(self.seen, 1)  # eq. 4


def primitive_ids(rays: Rays, views: Sequence[PinholeCamera]) -> Int32[np.ndarray, "X H W"]:
    """The face that each pixel of each view sees, -1 for none (eq. 1); all views have one size."""
    return np.stack([rays.look(view).faces for view in views])  # eq. 1
