"""`meshreel bench` where the distribution meshreel-bench is not installed."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from ..errors import MeshreelError


def command(*_arguments: Annotated[str, Parameter(allow_leading_hyphen=True, show=False)]) -> None:
    """Measure codecs against each other; install the distribution meshreel-bench first.

    Raises MeshreelError, which names the command that installs it.
    """
    raise MeshreelError("the bench is a distribution of its own; install it with: pip install meshreel-bench")
