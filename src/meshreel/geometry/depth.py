"""Depth pictures: the measurements of a depth camera at one moment, and those of a recording by frame."""

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
    unit: float  # m, of a depth of 1
    far: float  # m, beyond which no depth counts


@runtime_checkable
class DepthFrames(Protocol):
    """The depth pictures of a recording, by frame; its cameras stand still."""

    def __getitem__(self, index: int, /) -> list[DepthPicture | None]:
        """Return a frame's pictures, one for each camera; None for a camera that lacks the frame."""
        ...
