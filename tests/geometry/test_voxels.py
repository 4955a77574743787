"""Laws of cells and their keys; no face and no crossed cell is left out."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshreel.geometry.voxels import Lattice, around, contains, distinct, moved, neighbours, spread
from meshreel.types import Mesh
from tests.metrics.shapes import moved as shifted
from tests.metrics.shapes import sphere

HALF = 1 << 19
ROOM = st.integers(4 - HALF, HALF - 4)
CELLS = st.lists(st.tuples(ROOM, ROOM, ROOM), max_size=30)
NEAR = st.lists(st.tuples(*[st.integers(-3, 3)] * 3), max_size=60)
PLACES = st.floats(-2e6, 2e6)


def keys_of(cells: list[tuple[int, int, int]]) -> np.ndarray:
    return Lattice(np.zeros(3), 1.0).keys(np.array(cells, float).reshape(-1, 3) + 0.5)


@given(CELLS)
def test_keys_and_cells_invert_each_other(cells):
    lattice, wanted = Lattice(np.array([0.3, -7.0, 1e3]), 0.02), np.array(cells, np.int64).reshape(-1, 3)
    keys = keys_of(cells)
    assert np.array_equal(lattice.cells(keys), wanted)
    assert np.array_equal(lattice.keys(lattice.centers(keys)), keys)


@given(CELLS)
def test_keys_are_ordered_by_position(cells):
    assert [*map(tuple, Lattice(np.zeros(3), 1.0).cells(np.sort(keys_of(cells))).tolist())] == sorted(cells)


@given(st.tuples(PLACES, PLACES, PLACES), st.floats(0.005, 0.1))
def test_a_lattice_near_a_mesh_has_room_for_kilometres_around_it(place, size):
    mesh = shifted(sphere(1.0, 1), place)
    lattice = Lattice.near(mesh, size)
    assert np.abs(lattice.origin - place).max() < 2048.5 * size + 1
    points = mesh.vertices[:, None] + 2000 * np.eye(3)
    away = lattice.centers(lattice.keys(points.reshape(-1, 3))) - points.reshape(-1, 3)
    assert np.abs(away).max() <= size * 0.5001


def test_a_lattice_near_the_origin_starts_at_the_origin():
    for mesh in (sphere(1.0, 1), shifted(sphere(1.0, 1), (20, -20, 3)), Mesh.empty()):
        assert not Lattice.near(mesh, 0.02).origin.any()
    stray = Mesh.of([[1e9, 0, 0], *sphere(1.0, 1).vertices], sphere(1.0, 1).faces + 1)
    assert not Lattice.near(stray, 0.02).origin.any()  # a vertex that no face has says nothing


def test_points_beyond_all_keys_are_at_the_border():
    lattice = Lattice(np.zeros(3), 1.0)
    cells = lattice.cells(lattice.keys(np.array([[1e9, 0.5, -1e9]])))
    assert cells.tolist() == [[HALF - 2, 0, 2 - HALF]]


@given(NEAR, st.tuples(*[st.integers(-3, 3)] * 3))
def test_moved_cells_differ_by_the_offset(cells, offset):
    lattice = Lattice(np.zeros(3), 1.0)
    found = lattice.cells(moved(keys_of(cells), np.array(offset)))
    assert np.array_equal(found, np.array(cells, np.int64).reshape(-1, 3) + offset)


@given(st.lists(st.integers(0, 50)))
def test_distinct_keys_are_those_of_unique(keys):
    assert np.array_equal(distinct(np.array(keys, np.int64)), np.unique(np.array(keys, np.int64)))


@given(st.lists(st.integers(0, 50), min_size=1), st.lists(st.integers(-9, 60)))
def test_keys_that_are_contained_are_those_of_isin(keys, wanted):
    keys, wanted = distinct(np.array(keys, np.int64)), np.array(wanted, np.int64)
    assert np.array_equal(contains(keys, wanted), np.isin(wanted, keys))


@given(NEAR)
def test_around_gives_exactly_the_cells_beside(cells):
    steps = list(itertools.product((-1, 0, 1), repeat=3))
    wanted = {(x + i, y + j, z + k) for x, y, z in cells for i, j, k in steps}
    assert np.array_equal(around(distinct(keys_of(cells))), np.sort(keys_of(sorted(wanted))))


@given(NEAR)
def test_neighbours_are_beside_each_other_and_mutual(cells):
    keys = distinct(keys_of(cells))
    beside, places = neighbours(keys), Lattice(np.zeros(3), 1.0).cells(keys)
    assert beside.shape == (len(keys), 26)
    pairs = {(a, int(b)) for a, row in enumerate(beside) for b in row if b != a}
    near = np.abs(places[:, None] - places).max(axis=2) == 1
    assert pairs == {(int(a), int(b)) for a, b in np.argwhere(near)} == {(b, a) for a, b in pairs}


triangles = st.lists(st.tuples(*[st.floats(-1, 1)] * 9), min_size=1, max_size=6)


@given(triangles, st.floats(0.05, 3.0))
def test_points_are_spread_over_every_face_and_leave_no_part_of_it_out(corners, spacing):
    mesh = Mesh.of(np.array(corners).reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    points, faces = spread(mesh, spacing)
    assert (np.diff(faces) >= 0).all() and set(faces.tolist()) == set(range(len(corners)))
    random = np.random.default_rng(0)
    weights = random.dirichlet((0.5, 0.5, 0.5), 50)
    for face, triangle in enumerate(mesh.vertices[mesh.faces]):
        own, anywhere = points[faces == face], np.concatenate([weights @ triangle, triangle])
        gaps = np.linalg.norm(anywhere[:, None] - own, axis=2).min(axis=1)
        assert gaps.max() <= 2 / 3 * spacing * (1 + 1e-9)
        np.testing.assert_allclose(own.mean(axis=0), triangle.mean(axis=0), atol=1e-9)


def test_no_cell_that_a_surface_goes_through_the_middle_of_is_missed():
    lattice, ball = Lattice(np.full(3, 0.013), 0.05), sphere(1.0, 3)
    wanted = distinct(lattice.keys(spread(ball, 0.005)[0]))
    apart = np.abs(np.linalg.norm(lattice.centers(wanted), axis=1) - 1)
    found = distinct(lattice.keys(spread(ball, lattice.size)[0]))
    assert np.isin(wanted[apart < 0.2 * lattice.size], found).mean() > 0.98
    assert np.isin(wanted, around(found)).all()


@pytest.mark.parametrize("mesh", [Mesh.empty(), Mesh.of(np.zeros((3, 3)), np.zeros((0, 3)))])
def test_an_empty_mesh_has_no_points(mesh):
    points, faces = spread(mesh, 1.0)
    assert points.shape == (0, 3) and faces.shape == (0,)


def test_a_face_without_area_has_a_point():
    points, faces = spread(Mesh.of(np.ones((3, 3)), [[0, 1, 2]]), 0.1)
    assert points.tolist() == [[1, 1, 1]] and faces.tolist() == [0]
