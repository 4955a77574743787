"""Encode static meshes with Draco on a lattice that is in the stream (paper, section 3.3.3; decision 2).

In -> out: Mesh <-> bytes. Draco reorders vertices, drops degenerate faces and splits non-manifold vertices, so an
encoder must continue from its decoded bytes. The empty mesh is the empty string.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .. import _core
from ..errors import FormatError, InputError
from ..format.budget import LIMITS
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
