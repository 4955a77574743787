"""A reference mesh as the decoder will have it: coded by Draco, decoded, subdivided."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.topology import subdivide_midpoint
from ..types import Mesh
from .mesh import decode_mesh, encode_mesh


@dataclass(frozen=True, slots=True)
class CodedReference:
    """A reference mesh as the decoder will have it."""

    data: bytes  # Draco
    step: float  # spacing of its lattice, normalised units
    levels: int  # midpoint subdivisions after decoding
    mesh: Mesh  # decoded
    base: Mesh  # decoded and subdivided


def code_reference(mesh: Mesh, bits: int, levels: int) -> CodedReference:
    """The reference on a lattice of 2^bits cells along its longest side (the paper: 14 bits), coded and decoded."""
    extent = float((mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)).max())
    return code_on_lattice(mesh, extent / (2**bits - 1), levels)


def code_on_lattice(mesh: Mesh, step: float, levels: int) -> CodedReference:
    """The reference on a lattice of about this spacing (rounded to float32), coded and decoded."""
    step = float(np.float32(step))
    data = encode_mesh(mesh, step)
    decoded = decode_mesh(data, step)
    return CodedReference(data, step, levels, decoded, subdivide_midpoint(decoded, levels))
