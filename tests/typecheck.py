"""The checker behind the annotations: beartype, with an int accepted where a float is asked for (PEP 484)."""

from collections.abc import Callable
from functools import reduce
from operator import or_
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

from beartype import BeartypeConf, beartype

_CHECK = beartype(conf=BeartypeConf(is_pep484_tower=True))


def check(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function whose arguments and result are checked; of named choices the type alone: their values come from users,
    whom our own errors answer."""
    if hints := getattr(function, "__annotations__", None):
        function.__annotations__ = {name: _plain(hint) for name, hint in hints.items()}
    return _CHECK(function)


def _plain(hint: Any) -> Any:
    if get_origin(hint) is Literal:
        return reduce(or_, {type(value) for value in get_args(hint)})
    return reduce(or_, map(_plain, get_args(hint))) if get_origin(hint) in (Union, UnionType) else hint
