"""Every codec that can be compared, by name, made at an operating point."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...errors import InputError
from ..codec import Codec
from .draco import DecimatedDracoCodec, DracoCodec
from .meshreel import MeshreelCodec
from .necgs import NecgsCodec
from .scenes import BackgroundDracoCodec, SceneDracoCodec

CODECS: dict[str, Callable[..., Codec]] = {
    "draco": DracoCodec,
    "decimated_draco": DecimatedDracoCodec,
    "meshreel": MeshreelCodec,
    "necgs": NecgsCodec,
    "scene_draco": SceneDracoCodec,
    "background_draco": BackgroundDracoCodec,
    "labelled_draco": BackgroundDracoCodec,  # the same by labels that somebody else has found
}


def make_codec(kind: str, options: dict[str, Any]) -> Codec:
    """The codec of that kind at the operating point `options`. Raises InputError for a kind or option it lacks."""
    if kind not in CODECS:
        raise InputError(f"no codec is called {kind!r}; known: {', '.join(sorted(CODECS))}")
    try:
        return CODECS[kind](**options)
    except TypeError as error:
        raise InputError(f"codec {kind!r} does not take {options}: {error}") from error
