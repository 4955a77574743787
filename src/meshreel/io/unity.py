"""Folders of Unity's player of geometry sequences: `sequence.json` beside a PLY, and perhaps a texture, for each frame.

Their axes are Unity's, left-handed, so that x is mirrored here. The player's converter names no frames a second; `fps`
counts where it is there. Textures are .png or .dds, one for all frames or one each, in the order of their names.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..types import Mesh
from .file_names import Order, listed, ordered
from .files import Place, read_json

RECORD = "sequence.json"
POINTS, MESHES, TEXTURED = range(3)  # values of `geometryType`
PICTURES = (".png", ".dds")
FLIP = np.array([-1.0, 1.0, 1.0])


def record_of(folder: Place) -> dict[str, Any] | None:
    """Return the record of such a folder; None for others. Raises InputError for damage and for wrong values."""
    if not isinstance(folder, Path) or not (folder / RECORD).is_file():
        return None
    record = read_json(folder / RECORD, "copy it again")
    if type(kind := record.get("geometryType")) is not int:
        return None
    if kind not in (POINTS, MESHES, TEXTURED):
        raise InputError(f"{folder / RECORD}: geometryType {kind}; give 0 for points, 1 for meshes, 2 with textures")
    rate = record.get("fps")
    if rate is not None and (type(rate) not in (int, float) or not 1e-9 <= rate <= 1e9):
        raise InputError(f"{folder / RECORD}: fps {rate!r:.40}; give frames a second, as 30, or leave it out")
    return record


def pictures_of(
    folder: Path, record: dict[str, Any], frames: int, order: Order
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the name of each frame's texture, none where there are no textures that can be read, and warnings."""
    if record["geometryType"] != TEXTURED:
        return (), ()
    found = next((files for kind in PICTURES if (files := listed(folder, (kind,)))), [])
    if len(found) == 1:
        return (found[0].name,) * frames, ()
    if len(found) == frames:
        return tuple(str(path.name) for path in ordered(folder, folder, found, order)[0]), ()
    if not found and (packed := sorted(listed(folder, (".astc",)))):
        text = f"{packed[0]}: ASTC is not read, and no texture is kept"
        return (), (f"{text}; write each as .png beside it, as astcenc -ds {packed[0].name} {packed[0].stem}.png does",)
    return (), (
        f"{folder}: has {len(found)} textures for {frames} frames, and none is kept; give one, or one for each",
    )


def mirrored(mesh: Mesh) -> Mesh:
    """Return a mesh in right-handed axes, with faces counter-clockwise from outside; the way back is the same."""
    turned = [0, 2, 1]
    uv = None if mesh.uv is None else mesh.uv[:, turned]
    return replace(mesh, vertices=mesh.vertices * FLIP, faces=mesh.faces[:, turned], uv=uv)
