"""Bodies side by side: several sequences as one, the paper's Synthetic in small (section 4.1).

In: sequences and where each stands. Out: one sequence, as long as the shortest.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from meshreel.geometry.topology import concatenate
from meshreel.types import Frames, Mesh, MeshSequence

Place = tuple[float, float, float]  # m, added to the coordinates


class SideBySide(Frames):
    """A frame has the frames of all, each at its place; the rate is the first one's."""

    def __init__(self, bodies: Sequence[tuple[MeshSequence, Place]]) -> None:
        """At least one."""
        self._bodies = tuple(bodies)
        self.frame_rate = bodies[0][0].frame_rate

    def __len__(self) -> int:
        return min(len(body) for body, _ in self._bodies)

    def __getitem__(self, index: int) -> Mesh:
        number = range(len(self))[index]
        return concatenate([_moved(body[number], place) for body, place in self._bodies])


def _moved(mesh: Mesh, place: Place) -> Mesh:
    return Mesh.of(mesh.vertices.astype(np.float64) + place, mesh.faces)
