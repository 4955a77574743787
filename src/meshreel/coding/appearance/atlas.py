"""Encode an atlas: the places of a base mesh's face corners in a texture, in whole texels.

In -> out: a decoded base mesh and the places of its corners <-> bytes. Subdivisions halve the sides of faces in the
texture as they do in space.
"""

from __future__ import annotations

from ... import _core
from ...errors import FormatError, InputError
from ...format.layout import Atlas, Form
from ...format.records import pack, unpack_all
from ...geometry.atlas import MOST_SIDE, Layout
from ...types import Mesh
from ..entropy import decode_integers, encode_integers


def encode_atlas(base: Mesh, layout: Layout) -> bytes:
    """Encode the places of a base mesh's corners. Raises InputError for a texture that readers would refuse."""
    if not _is_size(layout.width, layout.height):
        raise InputError(f"a texture of {layout.width} x {layout.height}: give even sides of at most {MOST_SIDE}")
    joins, starts, rests = _core.encode_places(base.vertices, base.faces, layout.places)
    packed = (encode_integers(joins), encode_integers(starts), encode_integers(rests))
    return pack(Atlas(Form.PLACES, layout.width, layout.height, len(joins), len(starts), len(rests), *packed))


def decode_atlas(data: bytes, base: Mesh) -> Layout:
    """Decode the places of a base mesh's corners. Raises FormatError on damaged bytes, or those of another mesh."""
    record = unpack_all(Atlas, data)
    if record.form != Form.PLACES or not _is_size(record.width, record.height):
        raise FormatError(f"an atlas of form {record.form}, {record.width} x {record.height} texels")
    most = 4 * len(base.faces), 6 * len(base.faces), 2 * len(base.faces)
    counts = record.join_count, record.start_count, record.rest_count
    if any(count > limit for count, limit in zip(counts, most, strict=True)):
        raise FormatError(f"an atlas of {counts} symbols for {len(base.faces)} faces")
    streams = zip((record.joins, record.starts, record.rests), counts, strict=True)
    places = _core.decode_places(base.vertices, base.faces, *(decode_integers(data, count) for data, count in streams))
    if places.size and (places.min() < 0 or (places.reshape(-1, 2).max(axis=0) > [record.width, record.height]).any()):
        raise FormatError(f"an atlas with places beyond its {record.width} x {record.height} texels")
    return Layout(record.width, record.height, places)


def _is_size(width: int, height: int) -> bool:
    return all(0 < side <= MOST_SIDE and side % 2 == 0 for side in (width, height))
