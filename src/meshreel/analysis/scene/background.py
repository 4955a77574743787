"""Fuse the still surface of many frames into one background mesh (paper, section 3.2; decision 19).

In: the still faces of some frames. Out: one mesh. Signed distances to the surfaces of the frames are averaged, which
reduces noise, and surface that people hide in one frame comes from others.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from ...geometry.mean_surface import MeanOptions, MeanSurface
from ...geometry.topology import without_fragments
from ...types import Mesh


@dataclass(frozen=True, slots=True)
class BackgroundOptions:
    """Options of the fusion of frames into one background (values: decision 19)."""

    frames: int = 20  # largest number of fused frames, spread over the sequence
    depth: bool = True  # fuse the cameras' depth pictures if the sequence has them
    seen: float = 0.15  # smallest share of the frames that must have surface at a voxel
    steady: float = 0.6  # voxels: where the standard deviation of the distances is larger, the surface was not still
    past: float = 0.5  # voxels by which a surface is continued past its border, so that borders do not recede
    finer: float = 0.75  # voxel of a fusion from depth, in voxels of the frames: averaged depth has less noise
    facing: float = 0.15  # cosine: faces that no camera sees more frontally lie between two real surfaces
    fragment: float = 0.02  # m^2: connected pieces with less area are dropped
    hole: float = 0.4  # m: shorter loops of its border are closed where no camera saw through (decision 28)
    coarse: float = 0.5  # RMS distance from the fused surface that decimation may cost, in RMS noise of a frame
    lattice: float = 0.3  # spacing of the lattice, in RMS noise of a frame
    refresh: float | None = None  # s between two copies of the background in the file; None: one copy

    def least(self, count: int) -> int:
        """Return the smallest number of `count` frames that must have surface at a voxel."""
        return max(1, math.ceil(self.seen * count))


def fuse_background(frames: Iterable[Mesh], voxel: float, options: BackgroundOptions = BackgroundOptions()) -> Mesh:
    """Fuse meshes of one still scene into their mean surface, on a grid of `voxel` (m); reads one mesh at a time."""
    sums = MeanSurface(voxel, MeanOptions(steady=options.steady, past=options.past))
    count = 0
    for mesh in frames:
        sums.add(mesh)
        count += 1
    return without_fragments(sums.surface(options.least(count)), options.fragment)
