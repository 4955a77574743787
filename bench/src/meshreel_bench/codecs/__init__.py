"""Lookup of codecs among the plug-ins of the entry point group `meshreel.codecs`, which has the baselines here, too."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any

from meshreel.errors import InputError

from ..codec import Codec

GROUP = "meshreel.codecs"


def codec_names() -> list[str]:
    """Return the names of all installed codecs, sorted."""
    return sorted({entry.name for entry in entry_points(group=GROUP)})


def make_codec(name: str, options: dict[str, Any]) -> Codec:
    """Return the codec of that name at the operating point `options`. Raises InputError where there is none."""
    if (entry := _entry(name)) is None:
        raise InputError(f"no codec is called {name!r}; known: {', '.join(codec_names())}")
    try:
        make = entry.load()
    except (Exception, SystemExit) as error:  # importing a package may raise anything
        reason = error if isinstance(error, ImportError) else f"{type(error).__name__}: {error}"
        raise InputError(f"codec {name!r} cannot be loaded ({reason}); install what its package needs") from error
    if not callable(make):
        raise InputError(f"codec {name!r} is a {type(make).__name__}; its entry point must name a class or a function")
    try:
        made = make(**options)
    except InputError:
        raise  # its message says which value is wrong
    except (Exception, SystemExit) as error:  # a constructor may raise anything
        why = error if isinstance(error, TypeError) else f"{type(error).__name__}: {error}"
        raise InputError(f"codec {name!r} does not take {options}: {why}") from error
    try:
        whole = isinstance(made, Codec)  # evaluates properties
    except (Exception, SystemExit) as error:
        raise InputError(f"codec {name!r}: its name or options raise {type(error).__name__}: {error}") from error
    if not whole:
        lacking = [part for part in ("name", "options", "encode", "decode") if not hasattr(made, part)]
        raise InputError(f"codec {name!r} is a {type(made).__name__} without {', '.join(lacking)}; see docs/codecs.md")
    return made


def codec_version(name: str) -> str | None:
    """Return name and version of the distribution of a codec; None for this one, whose version every row has."""
    entry = _entry(name)
    if entry is None or entry.dist is None or entry.module.partition(".")[0] == __name__.partition(".")[0]:
        return None
    return f"{entry.dist.name} {entry.dist.version}"


def _entry(name: str) -> Any:  # a class of its own with `importlib_metadata`, which Dask brings
    """Return the entry point of that name, None without one. Raises InputError where two distributions have one."""
    found = list(entry_points(group=GROUP, name=name))
    if len(found) > 1:
        owners = " and ".join(entry.dist.name if entry.dist else entry.value for entry in found)
        raise InputError(f"{owners} both bring a codec {name!r}; uninstall one, or give its codec another name")
    return found[0] if found else None
