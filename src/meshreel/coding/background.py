"""The background of a scene, which is in the file once, and what changes of it: payloads of STATIC chunks.

In -> out: a mesh on a lattice <-> bytes; faces to drop from a background as decoded, and a mesh to add <-> bytes. The
mask is runs, in the order of Draco's faces, which is coherent on the surface.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from ..errors import FormatError
from ..format.layout import Form, StaticPatch
from ..format.records import pack, unpack_all
from ..geometry.topology import concatenate, part_of
from ..types import Mesh, Placement
from . import entropy
from .intra import decode_intra, encode_intra
from .layers.patches import fill_runs, run_lengths
from .mesh import check_growth, check_step, decode_mesh, encode_mesh


def encode_background(mesh: Mesh, step: float) -> bytes:
    """The payload of a whole background, on the lattice of `step` (normalised units).

    Raises InputError where the extent needs more than 21 bits at that step.
    """
    return encode_intra([mesh], step, 0)


def decode_background(data: bytes, place: Placement | None = None) -> Mesh:
    """The background, in normalised units or, with `place`, in metres. FormatError on anything but one mesh."""
    meshes = decode_intra(data)
    if len(meshes) != 1:
        raise FormatError(f"background: {len(meshes)} meshes, a state has one")
    return meshes[0] if place is None else place.of(meshes[0])


def encode_change(before: Mesh, dropped: Bool[np.ndarray, " F"], added: Mesh, step: float) -> bytes:
    """The payload of a patch: faces of the background before that go, and a mesh on the lattice of `step` that comes.

    `before` is the background as decoded. Raises InputError where the mesh needs more than 21 bits at that step.
    """
    assert len(dropped) == len(before.faces)
    runs = run_lengths(dropped) if dropped.any() else np.zeros(0, np.int32)
    coded = entropy.encode_integers(runs)
    return pack(StaticPatch(Form.PATCH, step, len(runs), coded, encode_mesh(added, step)))


def decode_change(data: bytes, before: Mesh, place: Placement | None = None) -> Mesh:
    """The background after the change: what is left of that before, its vertices first, and behind it what is added.

    Where faces go, so do vertices that no other uses. With `place`, `before` is in metres, and so is what comes back.
    Raises FormatError on anything but a patch of this background.
    """
    record = unpack_all(StaticPatch, data)
    if record.form != Form.PATCH:
        raise FormatError(f"background: a patch of form {record.form.name}")
    check_step(record.step)
    dropped = _dropped(record, len(before.faces))
    kept = part_of(before, ~dropped) if dropped.any() else before
    added = decode_mesh(record.mesh, record.step)
    check_growth(added, 0)
    after = concatenate([kept, added if place is None else place.of(added)])
    check_growth(after, 0)
    return after


def _dropped(record: StaticPatch, faces: int) -> Bool[np.ndarray, " F"]:
    """Which of so many faces go."""
    if record.runs == 0 and not record.dropped:
        return np.zeros(faces, bool)
    if record.runs > faces + 1:
        raise FormatError(f"background: {record.runs} runs over {faces} faces")
    dropped, rest = fill_runs(entropy.decode_integers(record.dropped, record.runs), faces)
    if len(rest) or not dropped.any():
        raise FormatError(f"background: {record.runs} runs over {faces} faces, of which {int(dropped.sum())} go")
    return dropped
