"""Which axis of a recording points up.

In: what a user or a file says. Out: one of four axes, and its direction.
"""

from __future__ import annotations

from typing import Literal, get_args

from .errors import InputError

Up = Literal["y", "z", "-y", "-z"]
UPS: tuple[Up, ...] = get_args(Up)
UP_AXES = {
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-y": (0.0, -1.0, 0.0),
    "-z": (0.0, 0.0, -1.0),
}


def check_up(axis: str) -> None:
    """Raises InputError where no axis that can point up is called so."""
    if axis not in UP_AXES:
        raise InputError(f"up axis {axis!r}: give {', '.join(UP_AXES)}")


def known_up(told: object) -> Up:
    """The axis that a file says points up; y where it says nothing that is known."""
    return next((axis for axis in UPS if axis == told), "y")
