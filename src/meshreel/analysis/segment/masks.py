"""Who says which pixels move: one protocol for geometric change, mask images and trackers (paper, section 3.2).

In: what the views see of a frame. Out: a mask a view, True where what is seen moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool

from ...geometry.cameras import PinholeCamera
from ...geometry.raycast import Seen


@runtime_checkable
class Masker(Protocol):
    """Says of each pixel of each view whether what it sees moves."""

    def masks(self, frame: int, seen: Sequence[Seen], views: Sequence[PinholeCamera]) -> Bool[np.ndarray, "X H W"]:
        """The masks of one frame, in the order of the views; True: dynamic."""
        ...
