"""A tracked group <-> bytes: the reference as a Draco mesh, each frame's displacements as a Draco cloud of points.

Draco is given whole numbers, a displacement's multiples of the step, with an origin and a range that leave them as they
are: what decodes is the same on every platform, and no further than half a step from what was measured. Sequential
order, Draco's other choice for clouds, is the only one that keeps it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Float64, Int32, Int64

from meshreel.coding.mesh import COMPRESSION_LEVEL, check_growth, check_step, decode_mesh
from meshreel.coding.reference_mesh import CodedReference
from meshreel.errors import FormatError, InputError
from meshreel.format.kinds import U8, U16, U32, Bytes
from meshreel.format.records import pack, unpack_all
from meshreel.geometry.topology import subdivide_midpoint
from meshreel.types import Mesh

from .layout import TrackedPayload

MOST_CELLS = 1 << 22  # from 0: Draco's float32 hold these, and a frame's range on top


@dataclass(frozen=True, slots=True, kw_only=True)
class CloudHead:
    """How Draco's sequential clouds with one attribute begin, as its bitstream specification has it."""

    magic: Annotated[bytes, Bytes(5), "DRACO"] = b"DRACO"
    major: Annotated[int, U8, "version"] = 2
    minor: Annotated[int, U8, "version"] = 3
    geometry: Annotated[int, U8, "cloud of points"] = 0
    method: Annotated[int, U8, "sequential"] = 0
    flags: Annotated[int, U16, "no metadata"] = 0
    points: Annotated[int, U32, "number of points"]
    decoders: Annotated[int, U8, "of attributes"] = 1
    attributes: Annotated[int, U8, "of the decoder"] = 1
    meaning: Annotated[int, U8, "position"] = 0
    data_type: Annotated[int, U8, "float32"] = 9
    components: Annotated[int, U8, "of a point"] = 3
    normalised: Annotated[int, U8, "no"] = 0
    number: Annotated[int, U8, "of the attribute"] = 0
    coder: Annotated[int, U8, "quantised"] = 2


def encode_tracked(reference: CodedReference, field: Float64[np.ndarray, "V T 3"], step: float) -> bytes:
    """The payload of a group whose displacements are rounded to multiples of `step`, normalised units."""
    order = surface_order(reference.base)
    frames = tuple(encode_cloud(field[order, t], step) for t in range(field.shape[1]))
    return pack(TrackedPayload(reference.levels, reference.step, reference.data, frames))


def decode_tracked(data: bytes, frame_count: int, step: float) -> list[Mesh]:
    """The frames of a group, normalised. Raises FormatError where the bytes are damaged or of other frames."""
    record = unpack_all(TrackedPayload, data)
    if len(record.displacements) != frame_count:
        raise FormatError(f"displacements of {len(record.displacements)} frames in a group of {frame_count}")
    check_step(record.spacing)
    reference = decode_mesh(record.reference, record.spacing)
    check_growth(reference, record.levels, frame_count)
    base = subdivide_midpoint(reference, record.levels)
    order, meshes = surface_order(base), list[Mesh]()
    for frame in record.displacements:
        vertices = base.vertices.copy()
        vertices[order] += decode_cloud(frame, len(order), step)
        meshes.append(Mesh(vertices, base.faces))
    return meshes


def encode_cloud(points: Float64[np.ndarray, "V 3"], step: float) -> bytes:
    """Draco's cloud of some points as multiples of `step`, in their order; decodes to within half a step."""
    import DracoPy

    cells = np.rint(points / step)
    if not np.abs(cells).max(initial=0) <= MOST_CELLS:  # false for NaN, too
        raise InputError(f"displacements of {np.abs(cells).max():g} steps; give a larger step, and finite vertices")
    low = cells.min(axis=0)
    bits = max(1, int((cells - low).max()).bit_length())
    data = bytes(
        DracoPy.encode(
            cells,
            None,
            quantization_bits=bits,
            compression_level=COMPRESSION_LEVEL,
            quantization_range=float(2**bits - 1),  # a cell of Draco's is a cell of ours
            quantization_origin=low,
            preserve_order=True,
        )
    )
    assert data.startswith(_head(len(points))), "another version of Draco's bitstream"
    return data


def decode_cloud(data: bytes, count: int, step: float) -> Float64[np.ndarray, "V 3"]:
    """The points. Raises FormatError on anything but a cloud of `count` of them, before memory is taken for it."""
    import DracoPy

    if not data.startswith(_head(count)):
        raise FormatError(f"displacements: {len(data)} bytes are no sequential Draco cloud of {count} points")
    try:
        cells = np.asarray(DracoPy.decode(bytes(data)).points, dtype=np.float64)
    except Exception as error:  # DracoPy raises its own types, and others, on damaged bytes
        raise FormatError(f"displacements: damaged Draco data ({len(data)} bytes): {error}") from error
    if cells.shape != (count, 3) or not np.abs(cells).max(initial=0) <= 2 * MOST_CELLS:
        raise FormatError(f"displacements: {cells.shape} numbers for {count} vertices, or beyond {2 * MOST_CELLS}")
    return np.rint(cells) * step


def surface_order(mesh: Mesh) -> Int64[np.ndarray, " V"]:
    """The vertices as the faces name them first, those of no face behind: each is near the one before.

    Bytes fall by 11 to 47 % of those of the vertices' own order, which has all midpoints behind (dancer, qp 12 to 4).
    """
    names: Int32[np.ndarray, " N"] = np.append(mesh.faces.ravel(), np.arange(len(mesh.vertices), dtype=np.int32))
    return np.argsort(np.unique(names, return_index=True)[1], kind="stable").astype(np.int64)


def _head(count: int) -> bytes:
    return pack(CloudHead(points=count))
