"""What a depth camera measured in one moment, and sequences that know it of their frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, UInt16

from .cameras import PinholeCamera


@dataclass(frozen=True, slots=True)
class DepthPicture:
    """Depths along the optical axis; 0 where nothing was measured that counts."""

    camera: PinholeCamera
    depth: UInt16[np.ndarray, "H W"] | Float32[np.ndarray, "H W"]
    unit: float  # m, that a depth of 1 is
    far: float  # m, beyond which no depth counts


@runtime_checkable
class SeesDepth(Protocol):
    """A sequence whose meshes were made of depth pictures, by cameras that stand still."""

    def pictures(self, index: int) -> list[DepthPicture | None]:
        """Those of a frame, a camera each; None for a camera that lacks the frame."""
        ...
