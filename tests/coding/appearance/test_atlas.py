"""Atlases: places come back, finer faces lie where subdivision puts them, and damage (FORMAT.md has a decoder)."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.coding.appearance.atlas import decode_atlas, encode_atlas
from meshreel.errors import FormatError, InputError
from meshreel.format.layout import Atlas
from meshreel.format.records import pack, unpack_all
from meshreel.geometry.atlas import Layout
from meshreel.geometry.topology import subdivide_midpoint
from meshreel.types import Mesh
from tests.metrics.shapes import sphere

BALL = sphere(levels=2)
FLAT = np.rint((BALL.vertices[:, :2] / np.abs(BALL.vertices).max() + 1) * 500).astype(np.int32)
LAYOUT = Layout(1024, 1008, np.ascontiguousarray(FLAT[BALL.faces]))
DATA = encode_atlas(BALL, LAYOUT)


def test_places_come_back() -> None:
    found = decode_atlas(DATA, BALL)
    assert (found.width, found.height) == (1024, 1008)
    np.testing.assert_array_equal(found.places, LAYOUT.places)


def test_places_of_one_chart_cost_less_than_two_bytes_a_face() -> None:
    assert len(DATA) < 2 * len(BALL.faces)


def test_finer_faces_are_where_their_corners_are() -> None:
    points = np.concatenate([FLAT / [1024, 1008], np.zeros((len(FLAT), 1))], axis=1)
    fine = subdivide_midpoint(Mesh.of(points, BALL.faces), 2)
    wanted = fine.vertices[fine.faces][..., :2]
    np.testing.assert_allclose(LAYOUT.uv(2), np.stack([wanted[..., 0], 1 - wanted[..., 1]], axis=2), atol=1e-6)


def test_a_face_in_one_place_has_none() -> None:
    places = LAYOUT.places.copy()
    places[3] = 7
    found = decode_atlas(encode_atlas(BALL, replace(LAYOUT, places=places)), BALL).uv(1)
    assert np.isnan(found[12:16]).all() and np.isfinite(np.delete(found, range(12, 16), axis=0)).all()


def test_damaged_atlases_are_refused() -> None:
    record = unpack_all(Atlas, DATA)
    beyond = [
        replace(record, width=16),
        replace(record, width=1023),
        replace(record, height=0),
        replace(record, height=4096),
        replace(record, join_count=record.join_count - 1),
        replace(record, rest_count=2**40),
        replace(record, start_count=record.start_count + 1),
        replace(record, joins=b"", join_count=0),
    ]
    for bad in [*map(pack, beyond), *(DATA[:length] for length in range(len(DATA)))]:
        with pytest.raises(FormatError):
            decode_atlas(bad, BALL)
    with pytest.raises(FormatError):  # of another mesh
        decode_atlas(DATA, sphere(levels=1))
    with pytest.raises(InputError, match="texture of 1023"):
        encode_atlas(BALL, replace(LAYOUT, width=1023))
