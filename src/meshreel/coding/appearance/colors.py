"""Encode the colours of vertices: fields of luma and colour differences over the connectivity of positions.

In: subdivided meshes, and the colours of their vertices in every frame. Out: the payload of a COLORS chunk, and the
decoded colours. Base vertices are predicted in their hierarchy, those of a level from the ends of their edges; all of a
group's frames are one field, in a separate basis, so that constant colours cost nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from ... import _core
from ...errors import FormatError
from ...format.layout import CodedField, ColorsLevel, Form, Origin, VertexColors
from ...format.records import pack, unpack
from ...shapes import Float64, UInt8
from ...types import Mesh
from ..layers.fields import Rate, encode_field
from ..layers.graph import connectivity, hierarchy
from ..steps import rung_of

SIBLINGS = 24  # weight of the siblings' mean, 64ths: with 8 or 40, 1 to 3 % more bytes on basketball_player
FINER = 0.65  # step of the base, on which all others rest, in steps (guess)
PRICE = 0.12  # price of a bit, in squared steps (guess)
CHROMA = 64  # factor of colour differences, 64ths (guess)


@dataclass(frozen=True, slots=True)
class ColoredMesh:
    """A mesh whose vertices, after `levels` subdivisions, have colours in `frames` frames."""

    base: Mesh
    levels: int
    frames: int
    vertices: int  # after the subdivisions


@dataclass(frozen=True, slots=True)
class EncodedColors:
    """Payload of colours, and the decoded colours."""

    payload: bytes
    layers: tuple[int, ...]  # offset at which each layer ends
    colors: tuple[UInt8[np.ndarray, "_ _ 3"], ...]  # of each mesh
    state: Float64[np.ndarray, "V 3"] | None  # of the first mesh, from which the next group may be predicted


def encode_colors(
    meshes: Sequence[ColoredMesh],
    colors: Sequence[UInt8[np.ndarray, "_ _ 3"]],
    step: float,
    before: Float64[np.ndarray, "V 3"] | None = None,
    layered: bool = False,
) -> EncodedColors:
    """Encode the colours of the vertices of meshes, the first of them predicted from `before` if given.

    `step` is the quantiser step, in units of the whole range. With `layered`, each level of the first mesh is a
    separate layer, and the other meshes together are one.
    """
    head = VertexColors(Form.VERTEX_COLORS, Origin.ALONE if before is None else Origin.PREVIOUS, CHROMA)
    parts, decoded_colors, state = [pack(head)], list[UInt8[np.ndarray, "_ _ 3"]](), None
    for number, (mesh, target) in enumerate(zip(meshes, colors, strict=True)):
        records = _encode_mesh(mesh, target, step, None if number else before)
        decoded, last = _decode_mesh(b"".join(records), mesh, head, None if number else before)
        state = last if number == 0 else state
        decoded_colors.append(decoded)
        if number == 0 and layered:
            parts = [parts[0] + records[0], *records[1:]]
        elif number <= 1 and layered:
            parts.append(b"".join(records))
        else:
            parts[-1] += b"".join(records)
    return EncodedColors(b"".join(parts), tuple(accumulate(map(len, parts))), tuple(decoded_colors), state)


def decode_colors(
    data: bytes, meshes: Sequence[ColoredMesh], before: Float64[np.ndarray, "V 3"] | None = None
) -> tuple[list[UInt8[np.ndarray, "_ _ 3"]], Float64[np.ndarray, "V 3"] | None]:
    """Decode the colours of the vertices of meshes, and the state from which the next group may be predicted.

    `data` ends with the records of these meshes; the first may have fewer levels than were coded, others may be left
    out. Raises FormatError if it is damaged, or predicted from a missing group.
    """
    head, offset = unpack(VertexColors, data)
    if head.form != Form.VERTEX_COLORS or head.chroma == 0:
        raise FormatError(f"colours of form {head.form} and chroma {head.chroma}")
    if head.origin == Origin.PREVIOUS and before is None:
        raise FormatError("colours that are predicted from those of a group which is not at hand")
    decoded, state = list[UInt8[np.ndarray, "_ _ 3"]](), None
    for number, mesh in enumerate(meshes):
        start = offset
        _, offset = unpack(CodedField, data, offset)
        for _ in range(mesh.levels):
            _, offset = unpack(ColorsLevel, data, offset)
        predicting = before if number == 0 and head.origin == Origin.PREVIOUS else None
        colors, last = _decode_mesh(data[start:offset], mesh, head, predicting)
        state = last if number == 0 else state
        decoded.append(colors)
    if offset != len(data):
        raise FormatError(f"colours: {len(data) - offset} bytes too many")
    return decoded, state


def _encode_mesh(
    mesh: ColoredMesh, colors: UInt8[np.ndarray, "T V 3"], step: float, before: Float64[np.ndarray, "V 3"] | None
) -> list[bytes]:
    """Return the records of a mesh: one for its base, and one for each level."""
    frames, count, faces = mesh.frames, len(mesh.base.vertices), mesh.base.faces
    values = _core.color_values(np.ascontiguousarray(colors.reshape(-1, 3)), CHROMA / 64)
    rows = np.moveaxis(values.reshape(frames, -1, 3), 0, 2).reshape(mesh.vertices, 3 * frames)
    prediction = np.zeros((mesh.vertices, 3)) if before is None else before
    start = np.repeat(prediction, frames, axis=1)  # luma of all frames, then one difference, then the other
    order, graph = hierarchy(mesh.base)
    field = encode_field((rows[:count] - start[:count])[order], graph, Rate(rung_of(step * FINER), PRICE))
    decoded = np.empty((count, 3 * frames))
    decoded[order] = field.decoded
    decoded += start[:count]
    records = [pack(field.record)]
    for _ in range(mesh.levels):
        near = connectivity(faces, count)
        more = slice(count, count + len(near.level.edges))
        middles = (decoded[near.level.edges[:, 0]] + decoded[near.level.edges[:, 1]]) / 2
        rate = Rate(rung_of(step), PRICE)
        field = encode_field(rows[more] - middles - start[more], near.siblings.graph(SIBLINGS), rate)
        records.append(pack(ColorsLevel(SIBLINGS, field.record)))
        decoded = np.concatenate([decoded, middles + (field.decoded + start[more])])
        count, faces = near.level.count, near.level.faces
    return records


def _decode_mesh(
    records: bytes, mesh: ColoredMesh, head: VertexColors, before: Float64[np.ndarray, "V 3"] | None
) -> tuple[UInt8[np.ndarray, "_ _ 3"], Float64[np.ndarray, "V 3"]]:
    if before is not None and len(before) != mesh.vertices:
        raise FormatError(f"colours of {mesh.vertices} vertices, predicted from those of {len(before)}")
    base = mesh.base
    return _core.decode_colors(
        records, base.vertices, base.faces, mesh.levels, mesh.vertices, mesh.frames, head.chroma / 64, before
    )
