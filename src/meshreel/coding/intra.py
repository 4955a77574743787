"""Encode each frame of a group separately with Draco (form `draco`), with midpoint subdivisions in the decoder.

In -> out: decimated meshes <-> bytes. A group has this form if no reference follows its motion, or if it is cheaper, so
that meshreel is never worse than per-frame Draco (docs/decisions/0007-draco-as-the-floor.md).
"""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import FormatError
from ..format.budget import Size, check_cost, draco_cost
from ..format.layout import DracoGroup, EmptyGroup, Form
from ..format.records import pack, unpack_all
from ..geometry.topology import subdivide_midpoint
from ..types import Mesh
from .mesh import check_claims, check_growth, check_step, decode_mesh, encode_meshes


def encode_intra(meshes: Sequence[Mesh], step: float, levels: int) -> bytes:
    """Encode the frames of a group as Draco meshes on a lattice of spacing `step` (normalised units)."""
    return pack(DracoGroup(Form.DRACO, levels, step, encode_meshes(meshes, step)))


def decode_intra(data: bytes) -> list[Mesh]:
    """Decode the frames of a `draco` group, in normalised units. Raises FormatError on any other or damaged payload."""
    record = unpack_all(DracoGroup, data)
    check_step(record.step)
    check_claims(record.meshes)  # of all frames together
    meshes = [decode_mesh(frame, record.step) for frame in record.meshes]
    for mesh in meshes:
        check_growth(mesh, record.levels, len(meshes))
    check_cost(draco_cost([Size.of(mesh, record.levels) for mesh in meshes]), len(data), "draco")
    return [subdivide_midpoint(mesh, record.levels) for mesh in meshes]


def encode_empty() -> bytes:
    """Encode a group whose frames have no surface; their number is in the index."""
    return pack(EmptyGroup(Form.EMPTY))


def decode_empty(data: bytes, frame_count: int) -> list[Mesh]:
    """Return `frame_count` empty meshes. Raises FormatError on any payload that is not an empty group."""
    if unpack_all(EmptyGroup, data).form != Form.EMPTY:
        raise FormatError("a payload that is not an empty group")
    return [Mesh.empty()] * frame_count
