"""Encode a group in the form `layers`: a coarse mesh with its motion, then details of each midpoint subdivision.

In -> out: a coded base mesh and the desired positions of its subdivided vertices in every frame <-> bytes. A level has
one scalar per new vertex and frame; every prefix of layers decodes to a coarser mesh. A group may be predicted from the
previous one (docs/decisions/0012-layers-coder.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np

from ... import _core
from ...errors import FormatError, InputError
from ...format.budget import LIMITS, Size, check_cost, layers_cost
from ...format.layout import Form, LayersGroup, LayersLevel, LayersPatches, Origin
from ...format.records import pack, unpack, unpack_all
from ...geometry.topology import Level, heights, refine, subdivide
from ...shapes import Float64, Int32
from ...types import Mesh
from ..mesh import CodedReference, check_growth, check_step, decode_mesh
from ..steps import rung_of
from .fields import EncodedField, Rate, encode_field
from .graph import connectivity, siblings
from .patches import Patches, decode_patches
from .trajectories import decode_trajectories, encode_trajectories

NOISY_STEP = 0.8  # RMS distances of the noise by which a step is widened (decision 16)
NOISY_DETAIL = 1.25  # RMS distances of the noise, least RMS of a column of detail: noise has 1 (decision 28)
MOST_FRAMES = 255  # of a group: a byte in the head
SIBLING_WEIGHTS = (36, 16)  # weights of the siblings' mean that the encoder tries, 64ths: guesses


@dataclass(frozen=True, slots=True)
class LayerCodingOptions:
    """Options of the form `layers`; lengths relative to the sequence's diagonal (decisions 12 and 14)."""

    step: float = 1.8e-3  # quantiser step of the base's motion
    detail_ratios: tuple[float, ...] = (0.6, 0.8)  # steps of the levels, in base steps; the last for all further levels
    curvatures: tuple[int, ...] = (48, 58)  # lift of the levels' midpoints, 64ths; the last for all further levels
    price: float = 0.08  # price of a bit, in squared steps
    tangential: float = 0.4  # weight of squared errors of the base's vertices along the surface, 0 to 1

    def step_above(self, noise: float) -> float:
        """Return the step for frames at this RMS distance from the truth: below the noise there is nothing to code."""
        return math.hypot(self.step, NOISY_STEP * noise)

    def rate(self, level: int, noise: float) -> Rate:
        """Return step and price of a level; 0 is the base."""
        ratio = 1.0 if level == 0 else self.detail_ratios[min(level, len(self.detail_ratios)) - 1]
        return Rate(rung_of(self.step_above(noise) * ratio), self.price, NOISY_DETAIL * noise if level else 0.0)


@dataclass(frozen=True, slots=True)
class LayersState:
    """State after a group, from which the next group may be predicted."""

    faces: Int32[np.ndarray, "F 3"]  # of the base
    base: Float64[np.ndarray, "V 3"]  # the base's vertices in the last frame
    scalars: tuple[Float64[np.ndarray, " _"], ...]  # of the last frame, for each decoded level
    colors: Float64[np.ndarray, "W 3"] | None = None  # of all decoded vertices (appearance.colors)


@dataclass(frozen=True, slots=True)
class EncodedLayers:
    """Payload of a group, and the group as it decodes."""

    payload: bytes
    layers: tuple[int, ...]  # offset at which each layer ends
    positions: Float64[np.ndarray, "T V 3"]
    state: LayersState


def encode_layers(
    reference: CodedReference,
    positions: Float64[np.ndarray, "T V 3"],
    options: LayerCodingOptions = LayerCodingOptions(),
    previous: LayersState | None = None,
    noise: float = 0.0,
) -> EncodedLayers:
    """Encode a group whose subdivided base should lie at `positions`; predicted from `previous` if given.

    With `previous`, the base mesh is that of its last frame, and only the number of levels of `reference` is used: give
    the reference of the group whose base mesh was coded. Raises InputError for positions that cannot be coded, and
    CostlyError if they take so few bytes that readers would refuse them.
    """
    frames, levels = len(positions), reference.levels
    base = reference.mesh if previous is None else Mesh(previous.base, previous.faces)
    _check_input(positions, base)
    shared, motion = encode_trajectories(
        positions[:, : len(base.vertices)], base, options.rate(0, noise), options.tangential
    )
    origin = Origin.ALONE if previous is None else Origin.PREVIOUS
    data = reference.data if previous is None else b""
    layers = [pack(LayersGroup(Form.LAYERS, origin, frames, levels, reference.step, data, shared, motion))]
    decoded = np.ascontiguousarray(np.moveaxis(decode_trajectories(layers[0], base, frames), 2, 0))
    scalars: list[Float64[np.ndarray, "T _"]] = []
    faces = base.faces
    for number in range(1, levels + 1):
        level = subdivide(faces, decoded.shape[1])
        if positions.shape[1] < level.count:
            raise InputError(f"{positions.shape[1]} vertices where level {number} has {level.count}")
        curvature = options.curvatures[min(number, len(options.curvatures)) - 1]
        aim = heights(positions[:, : level.count], decoded, level, curvature)
        record, offsets = _encode_level(aim, level, options.rate(number, noise), curvature, _before(previous, number))
        layers.append(pack(record))
        scalars.append(offsets)
        decoded, faces = refine(decoded, level, offsets, curvature), level.faces
    ends = tuple(accumulate(map(len, layers)))
    for count, end in enumerate(ends):
        check_cost(layers_cost(Size.of(base, count), frames), end, "layers")
    last = decoded[-1, : len(base.vertices)].copy()
    state = LayersState(base.faces, last, tuple(level[-1].copy() for level in scalars))
    return EncodedLayers(b"".join(layers), ends, decoded, state)


@dataclass(frozen=True, slots=True)
class LayersRecords:
    """The records of a payload, or those of its first levels."""

    head: LayersGroup
    layers: tuple[bytes, ...]  # the packed LayersGroup, then a packed LayersLevel for each level
    end: int  # offset behind them


def read_layers(data: bytes, levels: int | None = None) -> LayersRecords:
    """Read the records of a payload, or only those of the first `levels` levels. FormatError on damaged bytes."""
    head, offset = unpack(LayersGroup, data)
    ends = [0, offset]
    for _ in range(head.levels if levels is None else min(levels, head.levels)):
        ends.append(unpack(LayersLevel, data, ends[-1])[1])
    return LayersRecords(head, tuple(data[start:end] for start, end in pairwise(ends)), ends[-1])


def decode_records(
    records: LayersRecords, previous: LayersState | None
) -> tuple[Int32[np.ndarray, "F 3"], Float64[np.ndarray, "T V 3"], LayersState]:
    """Decode the faces, the positions in every frame, and the state that predicts the next group.

    Raises FormatError if the records are damaged, or predicted from a missing group.
    """
    frames, base = records.head.frames, base_of(records, previous)
    previous = previous if records.head.origin == Origin.PREVIOUS else None
    rows = decode_trajectories(records.layers[0], base, frames)
    last, faces = np.ascontiguousarray(rows[:, :, -1]), base.faces
    scalars: list[Float64[np.ndarray, " _"]] = []
    for number, record in enumerate(records.layers[1:], 1):
        near = connectivity(faces, len(rows))
        if 3 * frames * near.level.count > LIMITS.numbers:
            raise FormatError(f"{frames} frames of {len(near.level.faces)} faces exceed {LIMITS.numbers} numbers")
        rows, offsets = _core.decode_level(record, near.core, rows, _before(previous, number))
        faces = near.level.faces
        scalars.append(offsets)
    if not np.isfinite(rows).all():
        raise FormatError("layers: positions are not finite")
    positions = np.ascontiguousarray(np.moveaxis(rows, 2, 0))
    return faces, positions, LayersState(base.faces, last, tuple(scalars))


def layers_bytes_by_purpose(data: bytes) -> dict[str, int]:
    """Return the bytes of a payload by purpose. Raises FormatError on damaged bytes."""
    head, offset = unpack(LayersGroup, data)
    sizes = {"base mesh": len(head.base), "base motion": len(head.motion.basis) + len(head.motion.symbols)}
    for number in range(1, head.levels + 1):
        start = offset
        _, offset = unpack(LayersLevel, data, offset)
        sizes[f"level {number}"] = offset - start
    if offset < len(data):
        patches = unpack_all(LayersPatches, data[offset:])
        sizes |= {"dropped faces": len(patches.dropped), "patches": len(patches.mesh)}
    return sizes


def patches_of(data: bytes, records: LayersRecords, levels: int | None, faces: int) -> Patches | None:
    """Decode the patches of a payload whose finest level has `faces` faces; None if it has none, or they are off."""
    if records.end == len(data) or (levels is not None and levels <= records.head.levels):
        return None
    return decode_patches(unpack_all(LayersPatches, data[records.end :]), records.head.frames, faces)


def base_of(records: LayersRecords, previous: LayersState | None) -> Mesh:
    """Return the base mesh of a group. Raises FormatError as `decode_records` does."""
    head = records.head
    check_step(head.step)
    if head.frames == 0:
        raise FormatError("layers: a group of 0 frames")
    if head.origin == Origin.ALONE:
        base = decode_mesh(head.base, head.step)
    elif previous is None:
        raise FormatError("layers: a group that is predicted from one which is not at hand")
    elif head.base:
        raise FormatError(f"layers: a base mesh of {len(head.base)} bytes in a group that has another's")
    else:
        base = Mesh(previous.base, previous.faces)
    check_growth(base, head.levels, head.frames)
    check_cost(layers_cost(Size.of(base, len(records.layers) - 1), head.frames), records.end, "layers")
    return base


def _check_input(positions: Float64[np.ndarray, "T V 3"], base: Mesh) -> None:
    if not 0 < len(positions) <= MOST_FRAMES:
        raise InputError(f"a group of {len(positions)} frames: give 1 to {MOST_FRAMES}")
    if positions.shape[1] < len(base.vertices):
        raise InputError(f"{positions.shape[1]} places for the {len(base.vertices)} vertices of the base mesh")
    if not np.isfinite(positions).all() or np.abs(positions).max(initial=0.0) > 1e3:
        raise InputError("places must be finite and in units of the diagonal; normalise the sequence first")


def _before(previous: LayersState | None, number: int) -> Float64[np.ndarray, " E"] | None:
    """Return the last frame's scalars of a level of the previous group, or None if it has none."""
    return previous.scalars[number - 1] if previous is not None and number <= len(previous.scalars) else None


def _encode_level(
    scalars: Float64[np.ndarray, "T E"],
    level: Level,
    rate: Rate,
    curvature: int,
    previous: Float64[np.ndarray, " E"] | None,
) -> tuple[LayersLevel, Float64[np.ndarray, "T E"]]:
    """Encode the scalars of a level, alone or from the previous group; return its record, and them as they decode.

    A scalar is the distance of a new vertex along the decoded normal there (geometry.subdivision). The cheaper sibling
    weight is taken.
    """
    follows = previous is not None and ((scalars - previous) ** 2).sum() < (scalars**2).sum()
    offsets = np.ascontiguousarray((scalars - previous if follows else scalars).T)
    near = siblings(level)
    tried = [(weight, encode_field(offsets, near.graph(weight), rate)) for weight in SIBLING_WEIGHTS]
    weight, field = min(tried, key=lambda pair: _cost(pair[1], offsets, rate))
    record = LayersLevel(Origin.PREVIOUS if follows else Origin.ALONE, curvature, weight, field.record)
    return record, field.decoded.T + previous if follows else field.decoded.T


def _cost(field: EncodedField, offsets: Float64[np.ndarray, "E T"], rate: Rate) -> float:
    error = float(((field.decoded.T - offsets.T) ** 2).sum())
    bits = 8 * (len(field.record.basis) + len(field.record.symbols))
    return error + rate.price * rate.step**2 * bits
