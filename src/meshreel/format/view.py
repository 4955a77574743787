"""First view of a file: where players look from, and at what, when they begin.

In: metadata, whose item `view` is normalised as vertices are, so that edits that move a file move it, too. Out: a View,
or None: a file without one, or with something else under this name, begins with a view of its whole box.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .checks import LARGEST

ITEM = "view"  # of the metadata
USUAL = 45.0  # degrees, field of view where none is given
APART = 1e-6  # least distance of position and target, normalised: nearer ones have no direction (guess)


@dataclass(frozen=True, slots=True)
class View:
    """A camera that looks at a target; the axis of the file that points up does so in the picture."""

    position: tuple[float, ...]  # three, in the unit of the target
    target: tuple[float, ...]
    fov: float = USUAL  # degrees, of the picture's height

    @property
    def is_valid(self) -> bool:
        """True for what a file may have; of normalised places."""
        numbers = (*self.position, *self.target)
        return (
            len(self.position) == len(self.target) == 3
            and all(abs(number) <= LARGEST for number in numbers)  # False for NaN
            and math.dist(self.position, self.target) >= APART
            and 0 < self.fov < 180
        )

    def moved(self, scale: float, rotation: np.ndarray, origin: Sequence[float]) -> View:
        """Return the view with both places scaled, rotated about 0, then moved."""
        places = scale * np.array([self.position, self.target]) @ rotation.T + np.array(origin)
        position, target = (tuple(place) for place in places.tolist())
        return View(position, target, self.fov)

    @property
    def item(self) -> dict[str, Any]:
        """The item of the metadata."""
        return {ITEM: {"position": list(self.position), "target": list(self.target), "fov": self.fov}}


def known_view(metadata: dict[str, Any]) -> View | None:
    """Return the normalised view of a file, None where it has none: any tag could have this name before."""
    item = metadata.get(ITEM)
    if not isinstance(item, dict) or not {"position", "target", "fov"} <= item.keys():
        return None
    places = [item["position"], item["target"]]
    if not all(isinstance(place, list) and all(type(k) in (int, float) for k in place) for place in places):
        return None
    if type(fov := item["fov"]) not in (int, float):
        return None
    position, target = (tuple(map(float, place)) for place in places)
    view = View(position, target, float(fov))
    return view if view.is_valid else None
