"""Encode the background of a scene and its later changes: payloads of STATIC chunks.

In -> out: a mesh on a lattice <-> bytes; faces to drop from a decoded background, and a mesh to add <-> bytes. The mask
of dropped faces is run-length coded in the order of Draco's faces, which is coherent on the surface.
"""

from __future__ import annotations

import numpy as np

from ..errors import FormatError
from ..format.budget import Size, change_cost, check_cost
from ..format.layout import Form, StaticPatch
from ..format.records import pack, unpack_all
from ..geometry.topology import concatenate, part_of
from ..shapes import Bool
from ..types import Mesh
from . import entropy
from .layers.patches import fill_runs, run_lengths
from .mesh import check_growth, check_step, decode_intra, decode_mesh, encode_intra, encode_mesh


def encode_background(mesh: Mesh, step: float) -> bytes:
    """Encode a whole background on a lattice of spacing `step` (normalised units).

    Raises InputError if the extent needs more than 21 bits at that step.
    """
    return encode_intra([mesh], step, 0)


def decode_background(data: bytes) -> Mesh:
    """Decode a background, in normalised units. Raises FormatError on anything but one mesh."""
    meshes = decode_intra(data)
    if len(meshes) != 1:
        raise FormatError(f"background: {len(meshes)} meshes, a state has one")
    return meshes[0]


def encode_change(before: Mesh, dropped: Bool[np.ndarray, " F"], added: Mesh, step: float) -> bytes:
    """Encode a change of the background: faces to drop, and a mesh to add, on a lattice of spacing `step`.

    `before` is the decoded background. Raises InputError if the mesh needs more than 21 bits at that step.
    """
    assert len(dropped) == len(before.faces)
    runs = run_lengths(dropped) if dropped.any() else np.zeros(0, np.int32)
    coded = entropy.encode_integers(runs)
    return pack(StaticPatch(Form.PATCH, step, len(runs), coded, encode_mesh(added, step)))


def decode_change(data: bytes, before: Mesh) -> Mesh:
    """Decode the background after a change: the remaining vertices and faces of `before`, then the added ones.

    Vertices that no remaining face uses are dropped. Raises FormatError on anything but a change of this background.
    """
    record = unpack_all(StaticPatch, data)
    if record.form != Form.PATCH:
        raise FormatError(f"background: a patch of form {record.form.name}")
    check_step(record.step)
    dropped = _dropped(record, len(before.faces))
    added = decode_mesh(record.mesh, record.step)
    check_growth(added, 0)
    check_cost(change_cost(Size.of(before), Size.of(added)), len(data), "background")
    after = changed(before, dropped, added)
    check_growth(after, 0)
    return after


def changed(before: Mesh, dropped: Bool[np.ndarray, " F"], added: Mesh) -> Mesh:
    """Return a background without its dropped faces and the vertices that only they use, then the added mesh."""
    return concatenate([part_of(before, ~dropped) if dropped.any() else before, added])


def _dropped(record: StaticPatch, faces: int) -> Bool[np.ndarray, " F"]:
    """Decode the mask of dropped faces, `faces` long."""
    if record.runs == 0 and not record.dropped:
        return np.zeros(faces, bool)
    if record.runs > faces + 1:
        raise FormatError(f"background: {record.runs} runs over {faces} faces")
    dropped, rest = fill_runs(entropy.decode_integers(record.dropped, record.runs), faces)
    if len(rest) or not dropped.any():
        raise FormatError(f"background: {record.runs} runs over {faces} faces, of which {int(dropped.sum())} go")
    return dropped
