"""One level of subdivision <-> CodedField: a scalar for each new vertex and frame, along the decoded normal there.

In: the decoded vertices of the coarser level, and what the new ones should be. Out: the scalars as decoded, from which
both sides place the new vertices: midpoint of the edge + scalar x unit sum of its ends' vertex normals.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32

from .. import _core
from ..errors import FormatError, InputError
from ..format.layout import LayersLevel, Origin
from ..geometry.topology import vertex_normals
from ..types import Mesh
from .fields import EncodedField, Rate, decode_field, encode_field
from .graph import Level

MOST_SLANT = 0.3  # cosine between direction and surface below which the tangent plane says nothing
SIBLING_WEIGHTS = (36, 16)  # tried, 64ths

Hook = Callable[
    [int, int, Float64[np.ndarray, "E 3"], Float64[np.ndarray, "E 3"]], Float64[np.ndarray, " E"]
]  # level, frame, midpoints, directions -> scalars


@dataclass(frozen=True, slots=True)
class EncodedLevel:
    """A level's record and what both sides know of it."""

    record: LayersLevel
    field: EncodedField
    scalars: Float64[np.ndarray, "T E"]


def encode_level(
    scalars: Float64[np.ndarray, "T E"], level: Level, rate: Rate, previous: Float64[np.ndarray, " E"] | None
) -> EncodedLevel:
    """The cheapest way to code the scalars of a level: alone or from the frame before; more or less of siblings."""
    follows = previous is not None and ((scalars - previous) ** 2).sum() < (scalars**2).sum()
    offsets = np.ascontiguousarray((scalars - previous if follows else scalars).T)
    tried = [(weight, encode_field(offsets, level.graph(weight), rate)) for weight in SIBLING_WEIGHTS]
    weight, field = min(tried, key=lambda pair: _cost(pair[1], offsets, rate))
    record = LayersLevel(Origin.PREVIOUS if follows else Origin.ALONE, weight, field.record)
    return EncodedLevel(record, field, field.decoded + previous if follows else field.decoded)


def decode_level(
    record: LayersLevel, level: Level, frames: int, previous: Float64[np.ndarray, " E"] | None
) -> Float64[np.ndarray, "T E"]:
    """The scalars of a level. Raises FormatError on damaged records, or where they need a group that is not there."""
    scalars = decode_field(record.scalars, level.graph(record.sibling_weight), frames, False)
    if record.origin == Origin.ALONE:
        return scalars
    if previous is None or len(previous) != scalars.shape[1]:
        raise FormatError("a level that is counted from a group which is not at hand, or not to this level")
    return scalars + previous


def wanted_scalars(
    wanted: Float64[np.ndarray, "T V 3"],
    decoded: Float64[np.ndarray, "T W 3"],
    level: Level,
    hook: tuple[int, Hook] | None = None,
) -> Float64[np.ndarray, "T E"]:
    """Where each new vertex's line meets the wanted surface, from the midpoints; at most an edge's length away.

    `decoded` are the places of the coarser level's vertices, `wanted` those of this level's. A hook, with the level's
    number, replaces the tangent planes of the wanted mesh.
    """
    scalars = np.empty((len(wanted), len(level.edges)))
    for t, (target, coarse) in enumerate(zip(wanted, decoded, strict=True)):
        coarse = np.ascontiguousarray(coarse)
        midpoints, directions = _core.edge_frames(coarse, level.coarse, level.edges)
        if hook is not None:
            found = np.asarray(hook[1](hook[0], t, midpoints, directions), dtype=np.float64)
            if found.shape != (len(level.edges),) or not np.isfinite(found).all():
                raise InputError(f"the hook gave {found.shape} scalars at level {hook[0]}, or some not finite")
        else:
            found = _to_tangent_planes(target, midpoints, directions, level)
        ends = coarse[level.edges]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        scalars[t] = np.clip(found, -length, length)
    return scalars


def refine(positions: Float64[np.ndarray, "T V 3"], level: Level, scalars: Float64[np.ndarray, "T E"]) -> None:
    """Places a level's new vertices behind those of the coarser one, in every frame of `positions`."""
    _core.refine(positions, level.vertices, level.coarse, level.edges, scalars)


def _to_tangent_planes(
    target: Float64[np.ndarray, "V 3"],
    midpoints: Float64[np.ndarray, "E 3"],
    directions: Float64[np.ndarray, "E 3"],
    level: Level,
) -> Float64[np.ndarray, " E"]:
    faces: Int32[np.ndarray, "F 3"] = level.faces
    normals = vertex_normals(Mesh(np.ascontiguousarray(target), faces))[level.vertices :]
    away = target[level.vertices :] - midpoints
    slant = (directions * normals).sum(axis=1)
    steep = slant >= MOST_SLANT
    return np.where(steep, (away * normals).sum(axis=1) / np.where(steep, slant, 1.0), (away * directions).sum(axis=1))


def _cost(field: EncodedField, offsets: Float64[np.ndarray, "E T"], rate: Rate) -> float:
    error = float(((field.decoded - offsets.T) ** 2).sum())
    return error + rate.price * rate.step**2 * (field.basis_bits + field.symbol_bits)
