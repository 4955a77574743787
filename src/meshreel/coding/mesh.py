"""Encode meshes with Draco on a lattice that is in the stream (paper, section 3.3.3; decision 2).

In -> out: Mesh <-> bytes. Draco reorders vertices, drops degenerate faces and splits non-manifold vertices, so an
encoder must continue from its decoded bytes. The empty mesh is the empty string. A group has the form `draco`, each
frame a mesh, if no reference follows its motion, or if it is cheaper (docs/decisions/0007-draco-as-the-floor.md).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import _core
from ..errors import FormatError, InputError
from ..format.budget import LIMITS, Size, check_cost, draco_cost
from ..format.layout import DracoGroup, EmptyGroup, Form
from ..format.records import pack, unpack_all
from ..geometry.topology import subdivide_midpoint
from ..types import Mesh

MAX_BITS = 21  # bits per coordinate that Draco's float32 positions can hold
COMPRESSION_LEVEL = 7  # from the paper
PLAIN_LEVEL = 5  # the highest level at which each face costs a bit, whatever the mesh


def encode_mesh(mesh: Mesh, step: float) -> bytes:
    """Encode a mesh with its vertices rounded to multiples of `step` (in the unit of the vertices).

    Raises InputError if the extent needs more than 21 bits at that step.
    """
    return encode_meshes([mesh], step)[0]


def encode_meshes(meshes: Sequence[Mesh], step: float) -> tuple[bytes, ...]:
    """Encode meshes that are decoded together, as `encode_mesh` does.

    Large, flat, regular meshes take so few bytes that readers would refuse them (`check_claims`); they are coded
    plainly. Also raises InputError if tens of thousands of faces meet at one vertex, with holes between them.
    """
    for level in (COMPRESSION_LEVEL, PLAIN_LEVEL):
        coded = tuple(_encode_draco(mesh, step, level) for mesh in meshes)
        try:
            check_claims(coded)
            return coded
        except FormatError as error:
            refused = error.__cause__
    faces = sum(len(mesh.faces) for mesh in meshes)
    raise InputError(f"{faces} faces that no reader would decode: {refused}; simplify the mesh")


def _encode_draco(mesh: Mesh, step: float, level: int) -> bytes:
    if mesh.is_empty:
        return b""
    import DracoPy

    with np.errstate(all="ignore"):  # a step near 0 or not a number is refused below
        low = np.floor(mesh.vertices.min(axis=0) / np.float64(step)) * step
        cells = float((mesh.vertices.max(axis=0) - low).max() / np.float64(step))
    if not (step > 0 and cells + 2 <= 2**MAX_BITS):
        width = float(np.ptp(mesh.vertices, axis=0).max())
        raise InputError(
            f"a mesh {width:g} wide has {cells:.4g} cells at step {step:g}; at most {MAX_BITS} bits: raise the step"
        )
    bits = max(1, math.ceil(math.log2(cells + 2)))
    return bytes(
        DracoPy.encode(
            mesh.vertices,
            mesh.faces,
            quantization_bits=bits,
            compression_level=level,
            quantization_range=float((2**bits - 1) * step),
            quantization_origin=low,
        )
    )


def decode_mesh(data: bytes, step: float) -> Mesh:
    """Decode Draco bytes to a mesh whose vertices are exact multiples of `step`. Raises FormatError on damaged bytes.

    The last bits of Draco's float32 positions depend on its build; those of the lattice do not.
    """
    if not data:
        return Mesh.empty()
    import DracoPy

    check_claims([data])
    try:
        decoded = DracoPy.decode(bytes(data))
        with np.errstate(all="ignore"):  # a step near 0, which no encoder uses, is refused below
            points = np.round(np.asarray(decoded.points, dtype=np.float64) / step) * step
        mesh = Mesh.of(points, decoded.faces)
    except Exception as error:  # DracoPy raises its own types, and others, on damaged bytes
        raise FormatError(f"damaged Draco data ({len(data)} bytes): {error}") from error
    if not np.isfinite(mesh.vertices).all():
        raise FormatError(f"damaged Draco data ({len(data)} bytes): positions are not finite")
    if len(mesh.faces) and (mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices)):
        raise FormatError(f"damaged Draco data ({len(data)} bytes): a face names vertex {mesh.faces.max()}")
    return mesh


def check_claims(meshes: Sequence[bytes]) -> None:
    """Raise FormatError for Draco meshes of kinds that no encoder writes, or that claim more than their bytes allow.

    Draco allocates memory for claimed counts before it has checked them. The rules are in FORMAT.md ("A mesh").
    """
    try:
        _core.check_draco([bytes(mesh) for mesh in meshes])
    except FormatError as error:
        raise FormatError(f"damaged Draco data ({sum(map(len, meshes))} bytes): {error}") from error


def check_growth(mesh: Mesh, levels: int, frames: int = 1) -> None:
    """Raise FormatError if subdivision in all frames would make over 64 million faces or vertices."""
    if frames * max(len(mesh.faces) * 4**levels, len(mesh.vertices)) > LIMITS.faces:
        raise FormatError(
            f"{len(mesh.faces)} faces of {len(mesh.vertices)} vertices, subdivided {levels} times, "
            f"in {frames} frames: over {LIMITS.faces}"
        )


def check_step(step: float) -> None:
    """Raise FormatError if the spacing of a lattice is not above 0."""
    if not step > 0:
        raise FormatError(f"lattice spacing {step:g} is not above 0")


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
