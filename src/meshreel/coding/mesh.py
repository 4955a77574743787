"""Encode static meshes with Draco on a lattice that is in the stream (paper, section 3.3.3; decision 2).

In -> out: Mesh <-> bytes. Draco reorders vertices, drops degenerate faces and splits non-manifold vertices, so an
encoder must continue from its decoded bytes. The empty mesh is the empty string.
"""

from __future__ import annotations

import math

import numpy as np

from ..errors import FormatError, InputError
from ..types import Mesh

MAX_BITS = 21  # bits per coordinate that Draco's float32 positions can hold
COMPRESSION_LEVEL = 7  # from the paper
EDGEBREAKER = 1  # Draco's number of the method
MOST_PER_BYTE = 20_000  # vertices or faces per byte; a flat, regular grid reaches a thousand: a guess with a margin
MAX_FACES = 64_000_000  # faces or vertices of a group: a limit of memory, a guess


def encode_mesh(mesh: Mesh, step: float) -> bytes:
    """Encode a mesh with its vertices rounded to multiples of `step` (in the unit of the vertices).

    Raises InputError if the extent needs more than 21 bits at that step.
    """
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
            compression_level=COMPRESSION_LEVEL,
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

    _check_claims(data)
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


def _check_claims(data: bytes) -> None:
    """Raise FormatError if the head of Draco bytes claims more than they can hold, before Draco allocates memory.

    The head, by Draco's bitstream specification: "DRACO", version (2 bytes), geometry type, method, flags (2); then the
    traversal (edgebreaker only), and the numbers of vertices and faces as varints.
    """
    if len(data) > 10 and data[10] & 0x80:
        raise FormatError("damaged Draco data: it has metadata, which no mesh of a stream has")
    start = 12 if len(data) > 8 and data[8] == EDGEBREAKER else 11
    for _ in range(2):
        count, shift = 0, 0
        while start < len(data):
            count |= (data[start] & 0x7F) << shift
            shift, start = shift + 7, start + 1
            if not data[start - 1] & 0x80 or shift > 63:
                break
        if count > MOST_PER_BYTE * len(data):
            raise FormatError(f"damaged Draco data: {len(data)} bytes that claim {count} vertices or faces")


def check_growth(mesh: Mesh, levels: int, frames: int = 1) -> None:
    """Raise FormatError if subdivision in all frames would make over 64 million faces or vertices."""
    if frames * max(len(mesh.faces) * 4**levels, len(mesh.vertices)) > MAX_FACES:
        raise FormatError(
            f"{len(mesh.faces)} faces of {len(mesh.vertices)} vertices, subdivided {levels} times, "
            f"in {frames} frames: over {MAX_FACES}"
        )


def check_step(step: float) -> None:
    """Raise FormatError if the spacing of a lattice is not above 0."""
    if not step > 0:
        raise FormatError(f"lattice spacing {step:g} is not above 0")
