"""Sizes of the auto-decoder and quantization of its numbers (NeCGS, section 3.2 and appendix A.1)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float64, Int32

SIDE = 4  # K': points along a side of an embedded feature
OUTPUTS = 4  # of a grid point: its distance and three components of its deformation
RESOLUTIONS = (16, 32, 64, 128)
MOST_CHANNELS = 128
MOST_FEATURES = 64
BITS = range(4, 17)
_NARROWING = (1.0, 0.75, 0.5, 0.375, 0.25)  # of 64: 64, 48, 32, 24 and 16 channels, as in the authors' configuration


@dataclass(frozen=True, slots=True)
class Shape:
    """Sizes of an auto-decoder."""

    resolution: int  # K, points along a side of the grid; one of RESOLUTIONS
    features: int  # C, channels of an embedded feature
    channels: int  # of the first module's output
    bits: int  # N: numbers are multiples of 2 / 2^N from -1 to 1

    @property
    def feature_size(self) -> int:
        """Length of an embedded feature."""
        return self.features * SIDE**3

    @property
    def layers(self) -> tuple[tuple[int, int], ...]:
        """Input and output channels of each convolution: L modules that double the resolution, and the last."""
        modules = round(math.log2(self.resolution // SIDE))
        widths = [self.features, *(max(OUTPUTS, round(self.channels * share)) for share in _NARROWING[:modules])]
        inner = [(a, 8 * b) for a, b in pairwise(widths)]
        return (*inner, (widths[-1], OUTPUTS))

    @property
    def tensors(self) -> tuple[tuple[int, ...], ...]:
        """Shapes of the parameters: weights, then biases of each convolution."""
        return tuple(size for a, b in self.layers for size in ((b, a, 3, 3, 3), (b,)))


def quantize(values: Float64[np.ndarray, " N"], bits: int) -> Int32[np.ndarray, " N"]:
    """Return symbols of values clamped to -1 .. 1: 2^N + 1 levels including 0 (section A.1, eq. 5)."""
    return np.rint(np.clip(values, -1, 1) * (1 << (bits - 1))).astype(np.int32)


def dequantize(symbols: Int32[np.ndarray, " N"], bits: int) -> Float64[np.ndarray, " N"]:
    """Return the values of symbols."""
    return symbols / float(1 << (bits - 1))
