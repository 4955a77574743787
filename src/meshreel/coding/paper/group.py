"""Encode a group in the form `laplacian` (paper, section 3.3).

In -> out: reference mesh + displacement field <-> bytes. Displacements are coded relative to the decoded and subdivided
reference, which both sides have.
"""

from __future__ import annotations

from itertools import accumulate

import numpy as np

from ...format.budget import Size, check_cost, laplacian_cost
from ...format.layout import Form, LaplacianGroup
from ...format.records import pack, unpack_all
from ...geometry.topology import subdivide_midpoint
from ...shapes import Float64
from ...types import Mesh
from ..mesh import check_growth, check_step, decode_mesh
from ..reference_mesh import CodedReference
from .displacements import DisplacementOptions, claims_of, decode_displacements, encode_displacements, layer_sizes


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
    frames, components = claims_of(record.displacements)
    check_growth(reference, record.levels, frames)
    corners = np.bincount(reference.faces.reshape(-1)).astype(np.float64)
    cost = laplacian_cost(Size.of(reference, record.levels), frames, components, int(corners @ corners))
    check_cost(cost, size, "laplacian")
