"""One level of subdivision <-> CodedField: a scalar for each new vertex and frame, along the decoded normal there.

In: the scalars that would place the new vertices on the wanted surface (geometry.subdivision). Out: the scalars as
decoded, from which both sides place them; the decoder as they come about.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from ... import _core
from ...errors import FormatError
from ...format.layout import LayersLevel, Origin
from ...geometry.subdivision import Level, checked
from ...types import Placement
from .fields import EncodedField, FieldValues, Rate, encode_field, read_field
from .graph import Connectivity, Siblings, siblings

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
    record: LayersLevel,
    near: Connectivity,
    known: Float64[np.ndarray, "V 3 T"],
    previous: Float64[np.ndarray, " E"] | None,
) -> tuple[Float64[np.ndarray, "W 3 T"], Float64[np.ndarray, " E"]]:
    """Rows of the level's vertices from those of the coarser one's, and the last frame's scalars.

    Raises FormatError on damaged records, or where they need a group that is not there.
    """
    scalars = _scalars(record, near.siblings, known.shape[2], previous)
    return _core.refine_field(known, near.level.coarse, near.level.edges, scalars.arrays, record.curvature)


def decode_last(
    record: LayersLevel,
    near: Connectivity,
    known: Float64[np.ndarray, "V 3 T"],
    previous: Float64[np.ndarray, " E"] | None,
    shown: Shown,
) -> Float64[np.ndarray, " E"]:
    """As `decode_level`, of a last level, whose vertices it places. FormatError where they are not finite, too."""
    scalars = _scalars(record, near.siblings, known.shape[2], previous)
    place = None if shown.place is None else shown.place.numbers
    arrays = (known, near.level.coarse, near.level.edges, scalars.arrays)
    finite, last = _core.refine_field_frames(*arrays, record.curvature, place, shown.positions)
    checked(shown.positions, finite)
    return last


def _scalars(
    record: LayersLevel, near: Siblings, frames: int, previous: Float64[np.ndarray, " E"] | None
) -> FieldValues:
    scalars = read_field(record.scalars, near.graph(record.sibling_weight), frames, False)
    if record.origin == Origin.ALONE:
        return scalars
    if previous is None or len(previous) != len(near.starts) - 1:
        raise FormatError("a level that is counted from a group which is not at hand, or not to this level")
    return replace(scalars, before=previous)


def _cost(field: EncodedField, offsets: Float64[np.ndarray, "E T"], rate: Rate) -> float:
    error = float(((field.decoded.T - offsets.T) ** 2).sum())
    return error + rate.price * rate.step**2 * (field.basis_bits + field.symbol_bits)
