"""Encode the detail of one level of subdivision: a scalar per new vertex and frame, along the decoded normal there.

In: the scalars that would place the new vertices on the desired surface (geometry.subdivision). Out: a LayersLevel, and
the decoded scalars, from which both sides place the vertices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ... import _core
from ...format.layout import LayersLevel, Origin
from ...geometry.topology import Level
from ...shapes import Float64
from ...types import Placement
from .fields import EncodedField, Rate, encode_field
from .graph import Connectivity, siblings

SIBLING_WEIGHTS = (36, 16)  # weights of the siblings' mean that the encoder tries, 64ths: guesses


@dataclass(frozen=True, slots=True)
class EncodedLevel:
    """Record of a level, with its field and scalars as they decode."""

    record: LayersLevel
    field: EncodedField
    scalars: Float64[np.ndarray, "T E"]


@dataclass(frozen=True, slots=True)
class Shown:
    """Destination of the vertices of the last decoded level."""

    positions: Float64[np.ndarray, "T W 3"]  # written by the decoder
    place: Placement | None  # applied to the vertices


def encode_level(
    scalars: Float64[np.ndarray, "T E"],
    level: Level,
    rate: Rate,
    curvature: int,
    previous: Float64[np.ndarray, " E"] | None,
) -> EncodedLevel:
    """Encode the scalars of a level, alone or from the previous group, with the cheaper sibling weight."""
    follows = previous is not None and ((scalars - previous) ** 2).sum() < (scalars**2).sum()
    offsets = np.ascontiguousarray((scalars - previous if follows else scalars).T)
    near = siblings(level)
    tried = [(weight, encode_field(offsets, near.graph(weight), rate)) for weight in SIBLING_WEIGHTS]
    weight, field = min(tried, key=lambda pair: _cost(pair[1], offsets, rate))
    record = LayersLevel(Origin.PREVIOUS if follows else Origin.ALONE, curvature, weight, field.record)
    return EncodedLevel(record, field, field.decoded.T + previous if follows else field.decoded.T)


def decode_level(
    record: bytes,
    near: Connectivity,
    known: Float64[np.ndarray, "V 3 T"],
    previous: Float64[np.ndarray, " E"] | None,
) -> tuple[Float64[np.ndarray, "W 3 T"], Float64[np.ndarray, " E"]]:
    """Decode the rows of a level's vertices from those of the coarser level; also return the last frame's scalars.

    `record` is a packed LayersLevel. Raises FormatError if it is damaged, or predicted from a missing group.
    """
    return _core.decode_level(record, near.core, known, previous)


def decode_last(
    record: bytes,
    near: Connectivity,
    known: Float64[np.ndarray, "V 3 T"],
    previous: Float64[np.ndarray, " E"] | None,
    shown: Shown,
) -> Float64[np.ndarray, " E"]:
    """Decode the last level into `shown.positions`, placed by `shown.place`; return the last frame's scalars.

    Raises FormatError as `decode_level` does, and if a position is not finite.
    """
    place = None if shown.place is None else shown.place.numbers
    return _core.decode_last_level(record, near.core, known, previous, place, shown.positions)


def decode_last_scalars(
    record: bytes, near: Connectivity, frames: int, previous: Float64[np.ndarray, " E"] | None
) -> Float64[np.ndarray, " E"]:
    """Decode the last frame's scalars alone, from which the next group is predicted. Errors as in `decode_level`."""
    return _core.decode_last_scalars(record, near.core, frames, near.level.vertices, previous)


def _cost(field: EncodedField, offsets: Float64[np.ndarray, "E T"], rate: Rate) -> float:
    error = float(((field.decoded.T - offsets.T) ** 2).sum())
    return error + rate.price * rate.step**2 * (field.basis_bits + field.symbol_bits)
