"""Every codec that can be compared, by name, made at an operating point."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from meshreel.errors import InputError

from ..codec import Codec
from .background_once import BackgroundOnceDracoCodec
from .draco import DecimatedDracoCodec, DracoCodec
from .klt_tsdf import KltTsdfCodec
from .meshreel import MeshreelCodec
from .necgs import NecgsCodec
from .scenes import BackgroundDracoCodec, SceneDracoCodec
from .tvmc import TvmcCodec

ENTRY_POINTS = "meshreel.codecs"
CODECS: dict[str, Callable[..., Codec]] = {
    "background_once_draco": BackgroundOnceDracoCodec,
    "draco": DracoCodec,
    "decimated_draco": DecimatedDracoCodec,
    "meshreel": MeshreelCodec,
    "klt_tsdf": KltTsdfCodec,
    "necgs": NecgsCodec,
    "scene_draco": SceneDracoCodec,
    "background_draco": BackgroundDracoCodec,
    "labelled_draco": BackgroundDracoCodec,  # the same by labels that somebody else has found
    "tvmc": TvmcCodec,
}


def make_codec(kind: str, options: dict[str, Any]) -> Codec:
    """The codec of that kind at the operating point `options`. Raises InputError for a kind or option it lacks.

    Other packages have theirs by an entry point of the group `meshreel.codecs`; names of ours stay ours.
    """
    make = CODECS.get(kind) or _of_another_package(kind)
    try:
        made = make(**options)
        name, is_codec = getattr(made, "name", None), isinstance(made, Codec)  # either may run what others wrote
    except InputError:
        raise  # which says what it does not take
    except (Exception, SystemExit) as error:
        told = error if isinstance(error, TypeError) else f"{type(error).__name__}: {error}"
        raise InputError(f"codec {kind!r} does not take {options}: {told}") from error
    if not is_codec:
        lacking = [part for part in ("name", "options", "encode", "decode") if not hasattr(made, part)]
        raise InputError(f"codec {kind!r} is a {type(made).__name__} without {', '.join(lacking)}; see docs/codecs.md")
    if kind not in CODECS and str(name).split()[:1] in [[ours] for ours in CODECS]:
        raise InputError(f"codec {kind!r} calls itself {name!r}, as one of meshreel's own; give it another name")
    return made


def codec_version(kind: str) -> str | None:
    """The distribution that brings somebody else's codec, and its version; None for ours and where none says so."""
    entry = None if kind in CODECS else _others().get(kind)
    return None if entry is None or entry.dist is None else f"{entry.dist.name} {entry.dist.version}"


def source_of(kind: str) -> Path | None:
    """The file or the folder of somebody else's codec, once it is loaded; None for ours."""
    entry = None if kind in CODECS else _others().get(kind)
    module = None if entry is None else sys.modules.get(entry.module)
    file = getattr(module, "__file__", None)
    if file is None:
        return None
    return Path(file).parent if hasattr(module, "__path__") else Path(file)


def _others() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=ENTRY_POINTS)}


def _of_another_package(kind: str) -> Callable[..., Codec]:
    others = _others()
    if kind not in others:
        raise InputError(f"no codec is called {kind!r}; known: {', '.join(sorted({*CODECS, *others}))}")
    try:
        make: Callable[..., Codec] = others[kind].load()
    except (Exception, SystemExit) as error:  # what runs when a package is imported may raise anything
        told = error if isinstance(error, ImportError) else f"{type(error).__name__}: {error}"
        raise InputError(f"codec {kind!r} cannot be loaded ({told}); install what its package needs") from error
    if not callable(make):
        raise InputError(f"codec {kind!r} is a {type(make).__name__}; its entry point must name a class or a function")
    return make
