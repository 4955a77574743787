"""One level of subdivision <-> CodedField: a scalar for each new vertex and frame, along the decoded normal there.

In: the scalars that would place the new vertices on the wanted surface (geometry.subdivision). Out: the scalars as
decoded, from which both sides place them; the decoder as they come about.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ... import _core
from ...format.layout import LayersLevel, Origin
from ...geometry.subdivision import Level
from ...types import Placement
from .fields import EncodedField, Rate, encode_field
from .graph import Connectivity, siblings

SIBLING_WEIGHTS = (36, 16)  # tried, 64ths


@dataclass(frozen=True, slots=True)
class EncodedLevel:
    """A level's record and what both sides know of it."""

    record: LayersLevel
    field: EncodedField
    scalars: Float64[np.ndarray, "T E"]


@dataclass(frozen=True, slots=True)
class Shown:
    """Where a last level's vertices go."""

    positions: Float64[np.ndarray, "T W 3"]  # set
    place: Placement | None  # what it does to them


def encode_level(
    scalars: Float64[np.ndarray, "T E"],
    level: Level,
    rate: Rate,
    curvature: int,
    previous: Float64[np.ndarray, " E"] | None,
) -> EncodedLevel:
    """The cheapest way to code the scalars of a level: alone or from the frame before; more or less of siblings."""
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
    """Rows of the level's vertices from those of the coarser one's, and the last frame's scalars.

    `record` is a packed LayersLevel. Raises FormatError where it is damaged, or needs a group that is not there.
    """
    return _core.decode_level(record, near.core, known, previous)


def decode_last(
    record: bytes,
    near: Connectivity,
    known: Float64[np.ndarray, "V 3 T"],
    previous: Float64[np.ndarray, " E"] | None,
    shown: Shown,
) -> Float64[np.ndarray, " E"]:
    """As `decode_level`, of a last level, whose vertices it places. FormatError where they are not finite, too."""
    place = None if shown.place is None else shown.place.numbers
    return _core.decode_last_level(record, near.core, known, previous, place, shown.positions)


def _cost(field: EncodedField, offsets: Float64[np.ndarray, "E T"], rate: Rate) -> float:
    error = float(((field.decoded.T - offsets.T) ** 2).sum())
    return error + rate.price * rate.step**2 * (field.basis_bits + field.symbol_bits)
