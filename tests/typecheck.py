"""The checker behind the annotations: beartype, with an int accepted where a float is asked for (PEP 484)."""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from beartype import BeartypeConf, beartype

_CHECK = beartype(conf=BeartypeConf(is_pep484_tower=True))


def check(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function whose arguments and result are checked; not settings, whose users our own errors answer."""
    return function if function.__module__ == "meshreel.encoder.settings.settings" else _CHECK(function)


def modules_with_shapes(package: str) -> list[str]:
    """Names of the modules of a package that say shapes of arrays: mypy checks types, and a call takes .1 ms here."""
    spec = find_spec(package)
    assert spec is not None and spec.origin is not None
    root = Path(spec.origin).parent
    paths = [path for path in root.rglob("*.py") if "[np.ndarray, " in path.read_text(encoding="utf-8")]
    names = [".".join((package, *path.relative_to(root).with_suffix("").parts)) for path in paths]
    return [name.removesuffix(".__init__") for name in names]
