"""Encode a reference mesh, then decode and subdivide it, so that the encoder continues from the decoder's base.

In: a mesh. Out: a CodedReference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.topology import subdivide_midpoint
from ..types import Mesh
from .mesh import decode_mesh, encode_mesh


@dataclass(frozen=True, slots=True)
class CodedReference:
    """Reference mesh as the decoder reconstructs it, with its bytes."""

    data: bytes  # Draco
    step: float  # spacing of its lattice, normalised units
    levels: int  # midpoint subdivisions after decoding
    mesh: Mesh  # decoded
    base: Mesh  # decoded and subdivided


def code_reference(mesh: Mesh, bits: int, levels: int) -> CodedReference:
    """Code a reference on a lattice of 2^bits cells along its longest side (the paper: 14 bits)."""
    extent = float((mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)).max())
    return code_on_lattice(mesh, extent / (2**bits - 1), levels)


def code_on_lattice(mesh: Mesh, step: float, levels: int) -> CodedReference:
    """Code a reference on a lattice of spacing `step`, rounded to float32."""
    step = float(np.float32(step))
    data = encode_mesh(mesh, step)
    decoded = decode_mesh(data, step)
    return CodedReference(data, step, levels, decoded, subdivide_midpoint(decoded, levels))
