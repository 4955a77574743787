"""The template of a group of layers: a coarse base mesh of its key frame, and detail that all frames share.

In: a key frame; fitted positions of the subdivided base. Out: the base; positions whose detail does not change.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32

from ..errors import InputError
from ..geometry.decimate import decimate
from ..geometry.levels import edge_frames, heights, levels_of, refine
from ..geometry.nearest import Surface
from ..types import Mesh

FEWEST = 40  # vertices of a base mesh: below, a body has no limbs
DECAY = 1.2  # the error of quadric decimation falls with this power of the number of vertices (measured on bodies)
ROUNDS = 2  # of the search for the number of vertices


@dataclass(frozen=True, slots=True)
class TemplateOptions:
    """How fine the template of a group is."""

    error: float = 9e-4  # RMS distance of the key frame's vertices to the base mesh to aim at, of the diagonal
    levels: int = 2  # midpoint subdivisions of the base
    curvatures: tuple[float, ...] = (0.75, 0.9)  # of each level's midpoints, as the coder has them

    def __post_init__(self) -> None:
        if self.error <= 0 or not 0 <= self.levels <= 4 or len(self.curvatures) < self.levels:
            raise InputError(
                f"template error {self.error:g}, {self.levels} levels of curvatures {self.curvatures}: "
                "give > 0, 0 to 4, and one for each level"
            )


def base_mesh(key: Mesh, options: TemplateOptions) -> Mesh:
    """The key frame decimated until its error is about what the options ask for."""
    most = len(key.vertices)
    count = min(max(most // 20, FEWEST), most)
    for left in reversed(range(ROUNDS + 1)):
        base = decimate(key, max(count, 4))
        error = _rms(key, base)
        if left == 0 or error == 0.0 or abs(np.log(error / options.error)) < 0.05:
            break
        wanted = round(len(base.vertices) * (error / options.error) ** (1 / DECAY))
        if (count := min(max(wanted, FEWEST), most)) == len(base.vertices):
            break
    return base


def shared_detail(
    faces: Int32[np.ndarray, "F 3"], count: int, options: TemplateOptions
) -> Callable[[Float64[np.ndarray, "T V 3"]], Float64[np.ndarray, "T V 3"]]:
    """What makes fitted positions coherent: `count` base vertices stay, the detail becomes its median over time.

    Detail is what the coder sees: scalars along the normals of the coarser level.
    """
    levels = levels_of(faces, count, options.levels)

    def coherent(positions: Float64[np.ndarray, "T V 3"]) -> Float64[np.ndarray, "T V 3"]:
        known = np.ascontiguousarray(positions[:, :count])
        medians = [np.median(scalars, axis=0) for scalars in _details(positions)]
        for level, curvature, scalars in zip(levels, options.curvatures, medians, strict=False):
            known = refine(known, level, np.tile(scalars, (len(known), 1)), curvature)
        return known

    def _details(positions: Float64[np.ndarray, "T V 3"]) -> Sequence[Float64[np.ndarray, "T E"]]:
        found = []
        for level, curvature in zip(levels, options.curvatures, strict=False):
            coarse = np.ascontiguousarray(positions[:, : level.count])
            midpoints, directions = edge_frames(coarse, level, curvature)
            found.append(heights(midpoints, directions, positions[:, : level.count + len(level.edges)], level))
        return found

    return coherent


def _rms(mesh: Mesh, base: Mesh) -> float:
    gaps = Surface(base).closest(mesh.vertices).points - mesh.vertices
    return float(np.sqrt((gaps**2).sum(axis=1).mean()))
