"""Golden record of a decoded frame: counts, digests of all bits, and the first vertices for a reader."""

from __future__ import annotations

import hashlib
from pathlib import Path

from meshreel.types import Mesh

GOLDEN = Path(__file__).resolve().parents[1] / "conformance" / "v1"


def frame_record(mesh: Mesh) -> dict[str, object]:
    """Digests are SHA-256 of little-endian float64 positions and int32 faces, row by row."""
    return {
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "vertices_sha256": hashlib.sha256(mesh.vertices.astype("<f8").tobytes()).hexdigest(),
        "faces_sha256": hashlib.sha256(mesh.faces.astype("<i4").tobytes()).hexdigest(),
        "first_vertices": [[x.hex() for x in row] for row in mesh.vertices[:2].tolist()],
    }
