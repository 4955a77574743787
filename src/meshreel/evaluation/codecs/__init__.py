"""Every codec that can be compared, by name, made at an operating point."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.metadata import entry_points
from typing import Any

from ...errors import InputError
from ..codec import Codec
from .draco import DecimatedDracoCodec, DracoCodec
from .meshreel import MeshreelCodec
from .scenes import BackgroundDracoCodec, SceneDracoCodec

ENTRY_POINTS = "meshreel.codecs"
CODECS: dict[str, Callable[..., Codec]] = {
    "draco": DracoCodec,
    "decimated_draco": DecimatedDracoCodec,
    "meshreel": MeshreelCodec,
    "scene_draco": SceneDracoCodec,
    "background_draco": BackgroundDracoCodec,
    "labelled_draco": BackgroundDracoCodec,  # the same by labels that somebody else has found
}


def known_codecs() -> dict[str, Callable[[], Callable[..., Codec]]]:
    """What makes each codec, by name, found when it is asked for: those here, and those of other packages.

    A package of anybody's has its own by an entry point of the group `meshreel.codecs`; names of ours stay ours.
    """
    others = {entry.name: entry.load for entry in entry_points(group=ENTRY_POINTS)}
    return others | {name: partial(_itself, make) for name, make in CODECS.items()}


def _itself(make: Callable[..., Codec]) -> Callable[..., Codec]:
    return make


def make_codec(kind: str, options: dict[str, Any]) -> Codec:
    """The codec of that kind at the operating point `options`. Raises InputError for a kind or option it lacks."""
    known = known_codecs()
    if kind not in known:
        raise InputError(f"no codec is called {kind!r}; known: {', '.join(sorted(known))}")
    try:
        return known[kind]()(**options)
    except ImportError as error:
        raise InputError(f"codec {kind!r} cannot be loaded ({error}); install what its package needs") from error
    except TypeError as error:
        raise InputError(f"codec {kind!r} does not take {options}: {error}") from error
