"""Ground below a recording, as in the player's `ground.ts`: hardly seen itself, it takes a soft shadow.

In: meshes, and how they stand. Out: a disc that is laid over the samples of a picture. The player has the same
constants: `scripts/generate` writes them to its `ground.gen.ts`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..shapes import Float64, UInt8
from ..types import UP_AXES, Mesh
from .cameras import Camera, matrix_of
from .color_views import sampled
from .drawing import Crop, Parallel, draw
from .strict import products

if TYPE_CHECKING:
    from .picture import Rgba, Standing

# These are guesses.
TEXELS = 256  # of the shadow's picture along a side
ASIDE = 0.35  # of the recording's size: how far the shadow's picture reaches beyond it
REACH = 0.5  # of the recording's height: what hangs higher casts none
RIM = 2.0  # of the half side of the shadow's picture: where the ground has faded away
BELOW = 0.002  # of its height: so that soles hide it
GLOW = 0.12  # how bright the ground's middle is: on a dark page a shadow is seen only where that is brighter
_SOFT = ((1.5, 0.3), (3.0, 0.35), (4.5, 0.4))  # how blurred a copy of the shadow is, and its share

Plane = Float64[np.ndarray, "R C"]


@dataclass(frozen=True, slots=True)
class Ground:
    """A disc, and how dark a shadow makes it."""

    pose: Float64[np.ndarray, "4 4"]  # world to a frame whose origin is the disc's middle and whose z points up
    half: float  # half the side of the shadow's picture
    dark: UInt8[np.ndarray, "H W 3"]  # its shadow: 255 is black

    @staticmethod
    def under(meshes: Sequence[Mesh], standing: Standing) -> Ground:
        """Return the ground below meshes, with their shadow."""
        width, height, depth = standing.size.tolist()
        half = (0.5 + ASIDE) * max(width, depth, REACH * height) or 1.0
        above = np.array(UP_AXES[standing.up])
        right = np.array([1.0, 0.0, 0.0])
        axes = np.stack([right, np.cross(above, right), above])
        middle = standing.middle - above * (0.5 + BELOW) * height
        pose = matrix_of(axes, -(axes * middle).sum(axis=1))
        eye, near = Parallel(TEXELS, TEXELS, 2 * half / TEXELS, pose), np.zeros((TEXELS, TEXELS))
        for mesh in meshes:
            away = draw(mesh, eye).depth.astype(np.float64) / (REACH * (height or 1.0))
            near = np.maximum(near, np.clip(1 - away, 0, 1))
        dark = (255 * np.minimum(1.2 * _softened(near * near), 0.8)).round().astype(np.uint8)
        return Ground(pose, half, np.repeat(dark[..., None], 3, axis=2))

    def lay(self, found: Rgba, nearest: Plane, camera: Camera, crop: Crop) -> None:
        """Lay the ground over samples of a crop, given the depths of what they show."""
        rows, columns = np.mgrid[crop.top : crop.bottom, crop.left : crop.right] + 0.5
        across, down = (columns - camera.center[0]) / camera.focal[0], (rows - camera.center[1]) / camera.focal[1]
        to_disc = products(self.pose, camera.pose.to_world)
        x, y, z = (row[0] * across + row[1] * down + row[2] for row in to_disc[:3])
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = -to_disc[2, 3] / z
            x, y = ((to_disc[k, 3] + depth * way) / self.half for k, way in enumerate((x, y)))
            at = np.flatnonzero((depth > 0) & (depth < nearest) & (x * x + y * y < RIM * RIM))
        x, y = x.reshape(-1)[at], y.reshape(-1)[at]
        faint = np.maximum(1 - np.sqrt(x * x + y * y) / RIM, 0)
        light = GLOW * faint * np.sqrt(faint)
        places = (np.stack([x, y], axis=1) + 1) * TEXELS / 2
        dark = sampled(self.dark, places)[:, 0] / 255
        samples = found.reshape(-1, 4)
        samples[at] *= ((1 - light) * (1 - dark))[:, None]
        samples[at, :3] += (light * (1 - dark))[:, None]
        samples[at, 3] += light + dark * (1 - light)


def _softened(shadow: Plane) -> Plane:
    """Return a shadow, sharp where it is dark and soft where it is faint: a sum of copies of several sizes."""
    levels, total = [shadow], np.zeros(shadow.shape)
    while len(levels[-1]) > 8:
        wide = levels[-1]
        levels.append((wide[::2, ::2] + wide[1::2, ::2] + (wide[::2, 1::2] + wide[1::2, 1::2])) / 4)
    for lod, share in _SOFT:
        offset = 0.6 * math.sqrt(2.0 ** (2 * lod)) / TEXELS
        between = {math.floor(lod), math.ceil(lod)}
        for level in sorted(between):
            small = levels[level]
            spread = (_tents(len(small), offset) + _tents(len(small), -offset)) / 2
            total += share / len(between) * products(products(spread, small), spread.T)
    return total


def _tents(side: int, offset: float) -> Plane:
    """Return the shares of so many texels in each texel of the shadow's picture, `offset` of its side away."""
    places = np.clip(((np.arange(TEXELS) + 0.5) / TEXELS + offset) * side - 0.5, 0, side - 1)
    return np.maximum(1 - np.abs(places[:, None] - np.arange(side)), 0)
