"""The form `laplacian`: a displacement field by KLT, Laplacian coordinates and entropy coding (paper, section 3.3.3).

In: a field of V x T displacements of a base mesh as decoded, in units of the sequence's diagonal. Out: one payload:
DisplacementHead, then for each component, strongest first, the stream of its anchors and the stream of its deltas. The
head and the first k components decode without the rest. A group is such a payload behind its reference mesh.
"""

from __future__ import annotations

from itertools import accumulate

import numpy as np

from ...errors import FormatError, InputError
from ...format import records
from ...format.budget import LIMITS, Size, check_cost, laplacian_cost
from ...format.layout import AnchorRule, Component, DisplacementHead, Form, LaplacianGroup
from ...format.records import pack, unpack_all
from ...geometry.topology import subdivide_midpoint
from ...shapes import Float64
from ...types import Mesh
from .. import entropy, klt
from ..mesh import CodedReference, check_growth, check_step, decode_mesh
from ..steps import RUNGS
from . import laplacian, quantize
from .allocation import DisplacementOptions, allocate, alternatives, cost, round_deltas, steps_of

ANCHORS = AnchorRule.FARTHEST  # where they lie (decision 5)
MOST_FRAMES = 65_535  # of a group: a uint16 in the head
MOST_BITS = 30  # fraction bits of the mean and of a basis vector, so that values fit int32


def encode_displacements(field: Float64[np.ndarray, "V T 3"], base: Mesh, options: DisplacementOptions) -> bytes:
    """Encode a field; decoding needs the same base, bit for bit."""
    vertices, frames, _ = field.shape
    if not np.isfinite(field).all() or np.abs(field).max(initial=0.0) > 1e3:
        raise InputError("displacements must be finite and in units of the diagonal; normalise the sequence first")
    if not 0 < frames <= MOST_FRAMES:
        raise InputError(f"a group of {frames} frames: give 1 to {MOST_FRAMES}")
    coded = [_encode(field, base, choice) for choice in alternatives(base.faces, vertices, options)]
    return min(coded, key=lambda pair: cost(pair[1], len(pair[0]), options))[0]


def decode_displacements(data: bytes, base: Mesh, components: int | None = None) -> Float64[np.ndarray, "V T 3"]:
    """Decode a field; with `components`, only that many, in which case `data` may end after them."""
    head, offset = _read_head(data)
    count = len(head.components) if components is None else min(components, len(head.components))
    if components is None and offset + sum(map(_size, head.components)) != len(data):
        raise FormatError(f"displacements: {len(data)} bytes do not fit the sizes in their head; damaged or truncated")
    vertices = len(base.vertices)
    if head.anchor_count > vertices or not np.isfinite(base.vertices).all():
        raise FormatError(f"displacements: {head.anchor_count} anchors among {vertices} vertices, or a base not finite")
    if 3 * head.frames * vertices > LIMITS.numbers:
        raise FormatError(f"displacements: {head.frames} frames of {vertices} vertices exceed {LIMITS.numbers} numbers")
    neighbours = entropy.causal_neighbours(base.faces, vertices)
    anchors = laplacian.anchors(head.anchor_rule, head.anchor_count, base.faces, vertices)
    streams = _streams(data, offset, head.components[:count])
    rounded = entropy.decode_weights([stream for _, stream in streams], vertices, neighbours)
    fixed = [entropy.decode_integers(stream, len(anchors)) for stream, _ in streams]
    symbols = np.concatenate([rounded, np.array(fixed, dtype=np.int32).reshape(count, len(anchors)).T])
    steps = steps_of(np.array([component.step_level for component in head.components[:count]], dtype=np.int64))
    try:
        system = laplacian.System(base, anchors, head.anchor_weight)
        deltas = quantize.inverse(symbols, steps)
        weights = system.inverse(deltas)  # eq. 13
    except ValueError as error:  # collapsed faces, which no encoder's Draco keeps, tie parts that have no anchor
        raise FormatError(f"displacements: the base's least squares have no solution: {error}") from error
    return klt.inverse(weights, _read_basis(head, count))  # eq. 9


def layer_sizes(data: bytes) -> list[int]:
    """Return the bytes of the head and of each component: the first k + 1 form a prefix that decodes k components."""
    head, offset = _read_head(data)
    return [offset] + [_size(component) for component in head.components]


def _encode(field: Float64[np.ndarray, "V T 3"], base: Mesh, options: DisplacementOptions) -> tuple[bytes, float]:
    """Return the payload for one number of anchors, and its squared error.

    Components and steps are chosen before the chain, which `decode_displacements` undoes line by line.
    """
    vertices = len(field)
    anchors = laplacian.anchors(ANCHORS, options.anchor_count or 0, base.faces, vertices)
    system = laplacian.System(base, anchors, options.anchor_weight)
    neighbours = entropy.causal_neighbours(base.faces, vertices)
    sent, rungs = allocate(field, system, neighbours, options)
    basis, steps = klt.dequantize(sent), steps_of(rungs)

    weights = klt.forward(field, basis)  # eq. 8
    deltas = system.forward(weights)  # eq. 12
    symbols = round_deltas(deltas, rungs, system, options)
    rounded, fixed = symbols[:vertices], symbols[vertices:]
    anchor_streams = [entropy.encode_integers(column) for column in fixed.T]
    streams = list(zip(anchor_streams, entropy.encode_weights(rounded, neighbours), strict=True))

    error = klt.inverse(system.inverse(quantize.inverse(symbols, steps)), basis) - field
    coded = zip(sent.bits[1:].tolist(), rungs.tolist(), streams, strict=True)
    head = DisplacementHead(
        frames=field.shape[1],
        anchor_rule=ANCHORS,
        anchor_count=options.anchor_count or 0,
        anchor_weight=options.anchor_weight,
        mean_bits=int(sent.bits[0]),
        components=tuple(Component(bits, rung, len(fixed), len(deltas)) for bits, rung, (fixed, deltas) in coded),
        basis=entropy.encode_integers(np.append(sent.mean, sent.vectors).astype(np.int32)),
    )
    payload = records.pack(head) + b"".join(map(b"".join, streams))
    return payload, float((error**2).sum())


def _read_head(data: bytes) -> tuple[DisplacementHead, int]:
    """Read and check the head; return it and the offset of the first stream."""
    head, offset = records.unpack(DisplacementHead, data)
    if not 0 < head.frames <= MOST_FRAMES or len(head.components) > 3 * head.frames:
        raise FormatError(f"displacements: {len(head.components)} components of {head.frames} frames")
    if head.anchor_weight < 1 or head.mean_bits > MOST_BITS:
        raise FormatError(f"displacements: anchor weight {head.anchor_weight}, {head.mean_bits} bits for the mean")
    for component in head.components:
        if component.basis_bits > MOST_BITS or component.step_level >= RUNGS:
            raise FormatError(f"displacements: {component.basis_bits} bits, step level {component.step_level}")
    return head, offset


def _read_basis(head: DisplacementHead, count: int) -> klt.Basis:
    width = 3 * head.frames
    values = entropy.decode_integers(head.basis, width * (1 + len(head.components))).astype(np.int64)
    bits = np.array([head.mean_bits, *(component.basis_bits for component in head.components[:count])], dtype=np.int64)
    return klt.dequantize(
        klt.BasisSymbols(values[:width], values[width : width * (1 + count)].reshape(count, width), bits)
    )


def _streams(data: bytes, offset: int, components: tuple[Component, ...]) -> list[tuple[bytes, bytes]]:
    """Cut the streams of each component's anchors and deltas out of a payload."""
    streams = []
    for number, component in enumerate(components):
        middle = offset + component.anchors_size
        end = middle + component.deltas_size
        if end > len(data):
            raise FormatError(f"displacements: component {number} ends at byte {end} of {len(data)}; truncated")
        streams.append((data[offset:middle], data[middle:end]))
        offset = end
    return streams


def _size(component: Component) -> int:
    return component.anchors_size + component.deltas_size


def encode_laplacian(
    reference: CodedReference, field: Float64[np.ndarray, "V T 3"], options: DisplacementOptions
) -> tuple[bytes, tuple[int, ...]]:
    """Encode a `laplacian` group; return its payload and its layer ends: k + 1 layers decode with k components.

    Raises CostlyError if it takes so few bytes that readers would refuse them.
    """
    displacements = encode_displacements(field, reference.base, options)
    record = LaplacianGroup(Form.LAPLACIAN, reference.levels, reference.step, reference.data, displacements)
    payload = pack(record)
    sizes = layer_sizes(displacements)
    layers = tuple(accumulate(sizes[1:], initial=len(payload) - sum(sizes[1:])))
    _check_growth(record, reference.mesh, layers[0])
    return payload, layers


def decode_laplacian(data: bytes, components: int | None = None) -> list[Mesh]:
    """Decode the frames of a group from at most `components` components. Raises FormatError on damaged bytes."""
    record = unpack_all(LaplacianGroup, data)
    check_step(record.step)
    reference = decode_mesh(record.reference, record.step)
    _check_growth(record, reference, len(data))
    base = subdivide_midpoint(reference, record.levels)
    field = decode_displacements(record.displacements, base, components)
    return [Mesh(np.ascontiguousarray(base.vertices + field[:, t]), base.faces) for t in range(field.shape[1])]


def laplacian_bytes_by_purpose(data: bytes) -> dict[str, int]:
    """Return the bytes of a payload by purpose. Raises FormatError on damaged bytes."""
    record = unpack_all(LaplacianGroup, data)
    head, *components = layer_sizes(record.displacements)
    return {"reference": len(record.reference), "basis": head, "displacements": sum(components)}


def _check_growth(record: LaplacianGroup, reference: Mesh, size: int) -> None:
    """Raise FormatError if a group, of which `size` bytes are at hand, grows beyond the limits."""
    head = _read_head(record.displacements)[0]
    frames, components = head.frames, len(head.components)
    check_growth(reference, record.levels, frames)
    corners = np.bincount(reference.faces.reshape(-1)).astype(np.float64)
    cost = laplacian_cost(Size.of(reference, record.levels), frames, components, int(corners @ corners))
    check_cost(cost, size, "laplacian")
