"""The checker behind the annotations: beartype, with an int accepted where a float is asked for (PEP 484)."""

from collections.abc import Callable
from typing import Any

from beartype import BeartypeConf, beartype

_CHECK = beartype(conf=BeartypeConf(is_pep484_tower=True))


def check(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function whose arguments and result are checked; not settings, whose users our own errors answer."""
    return function if function.__module__ == "meshreel.encoder.settings.settings" else _CHECK(function)
