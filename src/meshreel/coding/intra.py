"""The `draco` form: every frame of a group on its own, decimated, with free midpoint subdivisions in the decoder.

In -> out: simplified meshes <-> bytes. It is what a group falls back to where no reference follows the motion, and what
keeps meshreel from ever being worse than the cheap anchor.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import FormatError
from ..format.layout import DracoGroup, EmptyGroup, Form
from ..format.records import pack, unpack_all
from ..geometry.topology import subdivide_midpoint
from ..types import Mesh
from .mesh import check_growth, check_step, decode_mesh, encode_mesh


def encode_intra(meshes: Sequence[Mesh], step: float, levels: int) -> bytes:
    """The payload of a group whose frames are Draco meshes on the lattice of `step` (normalised units)."""
    return pack(DracoGroup(Form.DRACO, levels, step, tuple(encode_mesh(mesh, step) for mesh in meshes)))


def decode_intra(data: bytes) -> list[Mesh]:
    """The frames of a group, in normalised units. Raises FormatError on anything but a payload of this form."""
    record = unpack_all(DracoGroup, data)
    check_step(record.step)
    meshes = []
    for frame in record.meshes:
        mesh = decode_mesh(frame, record.step)
        check_growth(mesh, record.levels, len(record.meshes))
        meshes.append(subdivide_midpoint(mesh, record.levels))
    return meshes


def encode_empty() -> bytes:
    """The payload of a group whose frames have no surface; their number is in the index."""
    return pack(EmptyGroup(Form.EMPTY))


def decode_empty(data: bytes, frame_count: int) -> list[Mesh]:
    """As many empty meshes. Raises FormatError on anything but a payload of this form."""
    if unpack_all(EmptyGroup, data).form != Form.EMPTY:
        raise FormatError("an empty group that is none")
    return [Mesh.empty()] * frame_count
