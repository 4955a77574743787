"""Laws of connectivity on which decoder and encoder rely."""

from collections.abc import Callable
from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel import _core
from meshreel.geometry.topology import (
    blend,
    clean,
    components,
    concatenate,
    drop_unreferenced,
    face_means,
    face_normals,
    subdivide_midpoint,
    unique_edges,
    vertex_normals,
    weld,
    with_neighbours,
)
from meshreel.types import Mesh
from tests.geometry import topology_formulas as formulas

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
SOLID = Mesh.of(CORNERS, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
FACES = st.integers(1, 12).flatmap(
    lambda count: st.tuples(
        st.just(count), st.lists(st.lists(st.integers(0, count - 1), min_size=3, max_size=3), max_size=20)
    )
)


def area(mesh: Mesh) -> float:
    return float(face_normals(mesh)[1].sum())


@pytest.mark.parametrize("levels", [0, 1, 3])
def test_subdivision_keeps_the_surface_its_sides_and_its_vertices(levels: int) -> None:
    fine = subdivide_midpoint(SOLID, levels)
    assert len(fine.faces) == 4 * 4**levels
    assert len(fine.vertices) - len(unique_edges(fine.faces)[0]) + len(fine.faces) == 2  # Euler: still a sphere
    np.testing.assert_array_equal(fine.vertices[:4], SOLID.vertices)
    assert area(fine) == pytest.approx(area(SOLID), rel=1e-12)
    coarse = np.repeat(face_normals(SOLID)[0], 4**levels, axis=0)
    np.testing.assert_allclose(face_normals(fine)[0], coarse, atol=1e-12)


def test_new_vertices_are_midpoints_in_the_order_of_their_edges() -> None:
    edges, _ = unique_edges(SOLID.faces)
    midpoints = (CORNERS[edges[:, 0]] + CORNERS[edges[:, 1]]) / 2
    np.testing.assert_array_equal(subdivide_midpoint(SOLID).vertices[4:], midpoints)


NUMBERS = st.sampled_from([0.0, -0.0, 1.0, -1.0, 0.1, 3e-160, 1e-170, 1e12, 1 + 2**-52])
MESHES = st.integers(1, 9).flatmap(
    lambda count: st.builds(
        Mesh.of,
        st.lists(st.tuples(*[NUMBERS] * 3), min_size=count, max_size=count),
        st.lists(st.tuples(*[st.integers(0, count - 1)] * 3), max_size=30),
    )
)


def assert_same_bits(found: Mesh | tuple, expected: Mesh | tuple) -> None:
    for one, other in zip(
        *(astuple(each)[:2] if isinstance(each, Mesh) else each for each in (found, expected)), strict=True
    ):
        assert one.shape == other.shape and one.dtype == other.dtype and one.tobytes() == other.tobytes()


def assert_as_formulas(mesh: Mesh) -> None:
    assert_same_bits(weld(mesh), formulas.weld(mesh))
    assert_same_bits(clean(mesh), formulas.clean(mesh))
    assert_same_bits(drop_unreferenced(mesh), formulas.drop_unreferenced(mesh))
    assert_same_bits(face_normals(mesh), formulas.face_normals(mesh))
    assert_same_bits((vertex_normals(mesh),), (formulas.vertex_normals(mesh),))
    assert_same_bits((face_means(mesh.vertices, mesh.faces),), (formulas.face_means(mesh.vertices, mesh.faces),))
    shares = np.linspace(-1.0, 2.0, 3 * len(mesh.faces)).reshape(-1, 3)
    mixed = blend(mesh.vertices, mesh.faces, shares)
    assert_same_bits((mixed,), (formulas.blend(mesh.vertices, mesh.faces, shares),))
    for one, other in zip(unique_edges(mesh.faces), formulas.unique_edges(mesh.faces), strict=True):
        np.testing.assert_array_equal(one, other)


@settings(max_examples=300)
@given(MESHES)
def test_small_meshes_with_everything_twice_are_treated_as_numpys_formulas_say(mesh: Mesh) -> None:
    assert_as_formulas(mesh)


def test_large_meshes_are_treated_as_numpys_formulas_say() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(200, 3)) * 10.0 ** rng.integers(-6, 6, (200, 1))
    assert_as_formulas(Mesh.of(points, rng.integers(0, 200, (2000, 3))))
    assert_as_formulas(Mesh.of(points.round(0), rng.integers(0, 200, (20000, 3))))
    assert_as_formulas(Mesh.of(np.zeros((2000, 3)), np.tile(np.arange(3), (3000, 1))))  # one bucket has all
    assert_as_formulas(Mesh.of(points, np.zeros((0, 3))))


def test_a_position_that_is_no_number_is_equal_to_none() -> None:
    points = np.array([[0, 0, np.nan], [0, 0, np.nan], [-0.0, 0, np.inf], [0.0, 0, np.inf]])
    mesh = Mesh.of(points, [[0, 1, 2], [0, 1, 3]])
    assert_same_bits(weld(mesh), Mesh.of(points[:3], [[0, 1, 2], [0, 1, 2]]))
    assert np.signbit(weld(mesh).vertices[2, 0])
    assert clean(mesh).is_empty
    assert_same_bits(weld(mesh), formulas.weld(mesh))


@pytest.mark.parametrize("call", [weld, clean, drop_unreferenced, face_normals, vertex_normals, subdivide_midpoint])
@pytest.mark.parametrize("wrong", [-1, 4, 2**31 - 1, -(2**31)])
def test_a_face_that_refers_to_a_missing_vertex_is_refused(call: Callable[[Mesh], object], wrong: int) -> None:
    for points in (CORNERS, CORNERS[:0]):
        with pytest.raises(ValueError, match="an index is out of range"):
            call(Mesh.of(points, [[0, 1, 2], [2, wrong, 1]]))
        with pytest.raises(ValueError, match="an index is out of range"):
            face_means(points, np.array([[0, 1, 2], [2, wrong, 1]], np.int32))
    with pytest.raises(ValueError, match="sizes do not fit"):
        _core.blend(CORNERS, SOLID.faces, np.zeros((3, 3)))
    with pytest.raises(ValueError, match="an index is out of range"):
        components(np.array([[0, 1, wrong]], np.int32), 4)


def test_a_blend_of_corners_is_the_corner_the_middle_or_any_affine_field_between() -> None:
    rng = np.random.default_rng(0)
    weights = np.concatenate([np.eye(3), np.full((1, 3), 1 / 3), rng.dirichlet(np.ones(3), 100)])
    corners = np.concatenate([SOLID.faces[:1]] * 4 + [SOLID.faces[rng.integers(0, 4, 100)]])
    points = blend(CORNERS, corners, weights)
    np.testing.assert_array_equal(points[:3], CORNERS[SOLID.faces[0]])
    np.testing.assert_allclose(points[3], CORNERS[SOLID.faces[0]].mean(axis=0), rtol=1e-15)
    turn, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
    np.testing.assert_allclose(blend(CORNERS @ turn + shift, corners, weights), points @ turn + shift, atol=1e-12)
    assert blend(CORNERS, np.zeros((0, 3), np.int32), np.zeros((0, 3))).shape == (0, 3)


@settings(max_examples=100)
@given(FACES)
def test_components_are_those_of_a_search_in_the_order_of_their_first_vertex(
    drawn: tuple[int, list[list[int]]],
) -> None:
    count, faces = drawn
    expected, label = [-1] * count, 0
    for first in range(count):
        if expected[first] >= 0:
            continue
        found = {first}
        while more := {v for face in faces if found & set(face) for v in face} - found:
            found |= more
        for v in found:
            expected[v] = label
        label += 1
    assert components(np.array(faces, dtype=np.int32).reshape(-1, 3), count).tolist() == expected


def test_meshes_that_are_concatenated_keep_their_vertices_and_faces_in_order():
    one, two = (Mesh.of(np.random.default_rng(k).normal(size=(5, 3)), [[0, 1, 2], [4, 3, 2]]) for k in (1, 2))
    loose = Mesh.of(np.ones((2, 3)), np.zeros((0, 3)))  # vertices without faces count
    both = concatenate([Mesh.empty(), one, loose, Mesh.empty(), two])
    np.testing.assert_array_equal(both.vertices, np.concatenate([one.vertices, loose.vertices, two.vertices]))
    np.testing.assert_array_equal(both.faces, np.concatenate([one.faces, two.faces + 7]))
    assert both.vertices.dtype == np.float64 and both.faces.dtype == np.int32


def test_one_mesh_among_empty_ones_is_returned_itself():
    one, nothing = Mesh.of(np.eye(3), [[0, 1, 2]]), Mesh.empty()
    assert concatenate([nothing, one, Mesh.empty()]) is one
    assert concatenate([nothing, Mesh.empty()]) is nothing
    assert concatenate([]).is_empty


def test_neighbours_share_a_vertex_with_a_chosen_face() -> None:
    strip = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4], [4, 5, 6], [8, 9, 7]], np.int32)
    first = np.arange(6) == 0
    assert with_neighbours(strip, first).tolist() == [True, True, True, False, False, False]
    assert with_neighbours(strip, with_neighbours(strip, first)).tolist() == [True] * 5 + [False]
    assert not with_neighbours(strip, np.zeros(6, bool)).any()
    assert len(with_neighbours(np.zeros((0, 3), np.int32), np.zeros(0, bool))) == 0
