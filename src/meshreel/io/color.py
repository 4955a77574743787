"""Colours in files: sRGB in 8 bits, as meshes have them, and linear light, as glTF has colours of vertices."""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8, UInt16


def to_linear(colors: UInt8[np.ndarray, "V 3"]) -> UInt16[np.ndarray, "V 3"]:
    """Return sRGB as linear light, all of which is 65535 (IEC 61966-2-1)."""
    s = np.arange(256) / 255
    light = np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)
    return np.rint(65535 * light).astype(np.uint16)[colors]


def from_linear(light: np.ndarray) -> UInt8[np.ndarray, "V 3"]:
    """Return linear light, integers whose largest number is all of it or shares of 1, as sRGB."""
    most = np.iinfo(light.dtype).max if light.dtype.kind in "iu" else 1.0
    shares = np.clip(np.nan_to_num(light.astype(np.float64) / most), 0.0, 1.0)
    s = np.where(shares <= 0.0031308, 12.92 * shares, 1.055 * shares ** (1 / 2.4) - 0.055)
    return np.rint(255 * s).astype(np.uint8)
