"""TVMC*'s clouds of points: they come back in order, in few bytes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meshreel_bench.codecs.tvmc.stream import MOST_CELLS, decode_cloud, encode_cloud, surface_order

from meshreel.coding.reference_mesh import code_reference
from meshreel.errors import InputError
from meshreel.types import Mesh
from tests.spheres import sliding_sphere


@settings(max_examples=60)
@given(
    count=st.integers(1, 300),
    spread=st.sampled_from([0, 1, 15, 16383]),
    offset=st.sampled_from([0.0, -3.7, 1e4]),
    seed=st.integers(0, 1000),
)
def test_points_come_back_in_their_order_to_within_half_a_step(count, spread, offset, seed):
    random, step = np.random.default_rng(seed), 3e-4
    points = step * (offset + spread * random.random((count, 3)))
    points[random.integers(0, count, count // 2)] = points[0]  # what a k-d tree or a table of points would merge
    found = decode_cloud(encode_cloud(points, step), step)
    assert np.abs(found - points).max() <= step / 2 * (1 + 1e-9)
    assert np.array_equal(found, np.rint(points / step) * step)  # to the bit, on every platform


def test_the_surface_order_names_every_vertex_once_neighbours_together():
    mesh = Mesh.of(np.zeros((6, 3)), [[4, 2, 0], [2, 3, 4]])  # 1 and 5 are in no face
    assert surface_order(mesh).tolist() == [4, 2, 0, 3, 1, 5]


def test_along_the_surface_displacements_take_fewer_bytes():
    reference = code_reference(sliding_sphere(1, levels=3)[0], 14, 1)
    field = 0.1 * np.sin(3 * reference.base.vertices)
    along = field[surface_order(reference.base)]
    assert len(encode_cloud(along, 1e-3)) < 0.85 * len(encode_cloud(field, 1e-3))


@pytest.mark.parametrize("points", [np.full((3, 3), np.nan), np.full((3, 3), 2.0 * MOST_CELLS)])
def test_points_that_no_lattice_holds_are_refused(points):
    with pytest.raises(InputError, match="steps"):
        encode_cloud(points, 1.0)
