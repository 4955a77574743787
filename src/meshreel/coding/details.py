"""One level of subdivision <-> CodedField: a scalar for each new vertex and frame, along the decoded normal there.

In: the scalars that would place the new vertices on the wanted surface (geometry.levels). Out: the scalars as decoded,
from which both sides place them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ..errors import FormatError
from ..format.layout import LayersLevel, Origin
from ..geometry.levels import Level
from .fields import EncodedField, Rate, decode_field, encode_field
from .graph import Siblings, siblings

SIBLING_WEIGHTS = (36, 16)  # tried, 64ths


@dataclass(frozen=True, slots=True)
class EncodedLevel:
    """A level's record and what both sides know of it."""

    record: LayersLevel
    field: EncodedField
    scalars: Float64[np.ndarray, "T E"]


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
    record: LayersLevel, near: Siblings, frames: int, previous: Float64[np.ndarray, " E"] | None
) -> Float64[np.ndarray, "E T"]:
    """The scalars of a level, a row for each new vertex.

    Raises FormatError on damaged records, or where they need a group that is not there.
    """
    scalars = decode_field(record.scalars, near.graph(record.sibling_weight), frames, False)
    if record.origin == Origin.ALONE:
        return scalars
    if previous is None or len(previous) != len(scalars):
        raise FormatError("a level that is counted from a group which is not at hand, or not to this level")
    return scalars + previous[:, None]


def _cost(field: EncodedField, offsets: Float64[np.ndarray, "E T"], rate: Rate) -> float:
    error = float(((field.decoded.T - offsets.T) ** 2).sum())
    return error + rate.price * rate.step**2 * (field.basis_bits + field.symbol_bits)
