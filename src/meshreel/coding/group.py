"""A group of frames and its payload: the `laplacian` form, and the choice of the decoder by the first byte.

In -> out: reference mesh + displacement field <-> bytes (paper, section 3.3). The displacements are coded against the
reference as decoded and subdivided, which both sides have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ..errors import FormatError
from ..format.layout import Form, LaplacianGroup
from ..format.records import pack, unpack
from ..geometry.topology import subdivide_midpoint
from ..types import Mesh
from .displacements import DisplacementOptions, decode_displacements, encode_displacements, layer_ends
from .intra import decode_intra
from .mesh import check_growth, decode_mesh, encode_mesh


@dataclass(frozen=True, slots=True)
class CodedReference:
    """A reference mesh as the decoder will have it."""

    data: bytes  # Draco
    step: float  # spacing of its lattice, normalised units
    levels: int  # midpoint subdivisions after decoding
    base: Mesh  # decoded and subdivided


def code_reference(mesh: Mesh, bits: int, levels: int) -> CodedReference:
    """The reference on a lattice of 2^bits cells along its longest side (the paper: 14 bits), coded and decoded."""
    extent = float((mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)).max())
    step = float(np.float32(extent / (2**bits - 1)))
    data = encode_mesh(mesh, step)
    return CodedReference(data, step, levels, subdivide_midpoint(decode_mesh(data, step), levels))


def encode_group(
    reference: CodedReference, field: Float64[np.ndarray, "V T 3"], options: DisplacementOptions
) -> tuple[bytes, tuple[int, ...]]:
    """The payload of a `laplacian` group and its layer ends: a prefix of that length decodes with k components."""
    displacements = encode_displacements(field, reference.base, options)
    head = pack(
        LaplacianGroup(form=Form.LAPLACIAN, levels=reference.levels, step=reference.step, reference=reference.data)
    )
    return head + displacements, tuple(len(head) + end for end in layer_ends(displacements))


def decode_group(data: bytes, components: int | None = None) -> list[Mesh]:
    """The frames of a group in normalised units, of whatever form, from a whole payload or a prefix of its layers."""
    if not data:
        raise FormatError("a group of 0 bytes")
    if data[0] == Form.DRACO:
        return decode_intra(data)
    if data[0] == Form.LAPLACIAN:
        return _decode_laplacian(data, components)
    raise FormatError(f"group form {data[0]} is not known to this reader")


def _decode_laplacian(data: bytes, components: int | None) -> list[Mesh]:
    record, end = unpack(LaplacianGroup, data)
    reference = decode_mesh(record.reference, record.step)
    check_growth(reference, record.levels)
    base = subdivide_midpoint(reference, record.levels)
    field = decode_displacements(data[end:], base, components)
    return [Mesh(np.ascontiguousarray(base.vertices + field[:, t]), base.faces) for t in range(field.shape[1])]
