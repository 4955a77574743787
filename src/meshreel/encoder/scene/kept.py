"""The parts of a scene as one small file, so that an encode that was stopped does not take the scene apart again.

In: Parts, whose surface is segmented by place. Out: the bytes of an .npz, and the same parts from them. What is quickly
made again, as what the depth cameras saw through, is not in it.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from dataclasses import replace
from typing import Any

import numpy as np

from ...analysis.scene.color_looks import CHANGE_SIDE, ColorChange, ColorLooks
from ...analysis.scene.cut import Rest
from ...analysis.scene.labelling import ByPlace
from ...analysis.survey import Survey
from ...geometry.derived_sequences import CapturedSequence
from ...geometry.voxels import Lattice
from ...types import Mesh
from .parts import Change, Parts, free_space

_COLORS = ("depth", "hue", "limit")  # arrays of a ColorChange
_ODD = (KeyError, ValueError, TypeError, IndexError, OSError, EOFError, zipfile.BadZipFile, zlib.error)


def pack_parts(parts: Parts) -> bytes | None:
    """Pack the parts of a scene; None where masks segment it, whose source only the next run can open."""
    by = parts.segmentation
    if not isinstance(by, ByPlace):
        return None
    arrays: dict[str, Any] = {
        "numbers": [parts.seen.unit, parts.noise, parts.deviation, parts.astray, by.cell, by.lattice.size, by.island],
        "origin": by.lattice.origin,
        "keys": by.keys,
        "chosen": by.chosen,
        "until": by.rest.until,
        "since": by.rest.since,
        "changes": np.array([change.frame for change in parts.changes], np.int64),
    }
    for number, mesh in enumerate([parts.background, *(change.came for change in parts.changes)]):
        arrays |= {f"vertices {number}": mesh.vertices, f"faces {number}": mesh.faces}
        arrays |= {} if mesh.colors is None else {f"colors {number}": mesh.colors}
    if by.colors is not None:
        arrays |= {name: getattr(by.colors, name) for name in _COLORS}
        arrays |= {"looks": by.colors.looks.frame, "nearer": by.colors.nearer}
    packed = io.BytesIO()
    np.savez_compressed(packed, allow_pickle=False, **arrays)
    return packed.getvalue()


def unpack_parts(data: bytes, sequence: CapturedSequence, seen: Survey) -> Parts | None:
    """Return the parts of a surveyed scene, or None where no encoder packed them."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            unit, noise, deviation, astray, cell, size, island = arrays["numbers"].tolist()
            rest = Rest(arrays["until"], arrays["since"])
            places = Lattice(arrays["origin"], size), arrays["keys"], arrays["chosen"]
            by = ByPlace(cell, *places, rest, island, _colors(arrays, sequence))
            frames = arrays["changes"].tolist()
            background, *came = (_mesh(arrays, number) for number in range(1 + len(frames)))
    except _ODD:
        return None
    changes = [Change(frame, mesh) for frame, mesh in zip(frames, came, strict=True)]
    seen = replace(seen, scale=unit)
    return Parts(seen, by, background, changes, noise, deviation, astray, free_space(sequence))


def _mesh(arrays: Any, number: int) -> Mesh:
    return Mesh(arrays[f"vertices {number}"], arrays[f"faces {number}"], arrays.get(f"colors {number}"))


def _colors(arrays: Any, sequence: CapturedSequence) -> ColorChange | None:
    """Return the usual view of the colour cameras, or None if the scene has none."""
    if "looks" not in arrays or sequence.colors is None:
        return None
    looks = ColorLooks(sequence.colors, int(arrays["looks"]), CHANGE_SIDE)
    return ColorChange(looks, float(arrays["nearer"]), *(arrays[name] for name in _COLORS))
