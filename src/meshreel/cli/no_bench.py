"""`meshreel bench` without the distribution meshreel-bench: an error that says what to install."""

from __future__ import annotations

from ..errors import MeshreelError


def command(*_arguments: str) -> None:
    """Raise MeshreelError with the line that installs the bench."""
    raise MeshreelError("the bench is a distribution of its own; install it with: pip install meshreel-bench")
