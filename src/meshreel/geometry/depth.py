"""Depth picture of one camera at one moment, and the protocol of sequences that have such pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, UInt16

from .cameras import PinholeCamera


@dataclass(frozen=True, slots=True)
class DepthPicture:
    """Depths along the optical axis of a camera; 0 is no measurement."""

    camera: PinholeCamera
    depth: UInt16[np.ndarray, "H W"] | Float32[np.ndarray, "H W"]
    unit: float  # m, length of a depth of 1
    far: float  # m, beyond which depths are ignored


@runtime_checkable
class SeesDepth(Protocol):
    """A sequence whose meshes were fused from depth pictures of cameras that stand still."""

    def pictures(self, index: int) -> list[DepthPicture | None]:
        """Return the depth picture of each camera in a frame, None for a camera that lacks the frame."""
        ...
