"""The `draco` form: every frame of a group on its own, decimated, with free midpoint subdivisions in the decoder.

In -> out: simplified meshes <-> bytes. It is what a group falls back to where no reference follows the motion, and what
keeps meshreel from ever being worse than the cheap anchor.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import FormatError
from ..format.layout import DracoGroup, Form
from ..format.records import pack, unpack
from ..geometry.topology import subdivide_midpoint
from ..types import Mesh
from .mesh import check_growth, decode_mesh, encode_mesh


def encode_intra(meshes: Sequence[Mesh], step: float, levels: int) -> bytes:
    """The payload of a group whose frames are Draco meshes on the lattice of `step` (normalised units)."""
    frames = tuple(encode_mesh(mesh, step) for mesh in meshes)
    return pack(DracoGroup(form=Form.DRACO, levels=levels, step=step, frames=frames))


def decode_intra(data: bytes) -> list[Mesh]:
    """The frames of a group, in normalised units. Raises FormatError on anything but a payload of this form."""
    record, end = unpack(DracoGroup, data)
    if end != len(data):
        raise FormatError(f"draco group: {len(data) - end} bytes too many")
    meshes = []
    for frame in record.frames:
        mesh = decode_mesh(frame, record.step)
        check_growth(mesh, record.levels)
        meshes.append(subdivide_midpoint(mesh, record.levels))
    return meshes
