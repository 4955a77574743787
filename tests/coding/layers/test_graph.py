import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.coding.layers.graph import Graph, hierarchy, siblings
from meshreel.errors import FormatError
from meshreel.geometry.topology import subdivide, subdivide_midpoint, unique_edges
from meshreel.types import Mesh

from ..bodies import ball, sheet


def row(graph: Graph, place: int) -> tuple[np.ndarray, np.ndarray]:
    span = slice(graph.starts[place], graph.starts[place + 1])
    return graph.near[span], graph.weights[span]


@st.composite
def any_mesh(draw: st.DrawFn) -> Mesh:
    """Any faces at all: degenerate, repeated, non-manifold, on vertices that may coincide or be alone."""
    count = draw(st.integers(1, 30))
    faces = draw(st.lists(st.tuples(*[st.integers(0, count - 1)] * 3), max_size=60))
    places = draw(st.lists(st.tuples(*[st.integers(0, 3)] * 3), min_size=count, max_size=count))
    return Mesh.of(0.1 * np.array(places), np.array(faces).reshape(-1, 3))


@settings(max_examples=150)
@given(any_mesh())
def test_every_vertex_has_one_place_and_is_predicted_by_earlier_ones(mesh: Mesh) -> None:
    order, graph = hierarchy(mesh)
    assert sorted(order.tolist()) == list(range(len(mesh.vertices)))
    for place in range(len(order)):
        near, weights = row(graph, place)
        assert (near < place).all() and (near >= 0).all()
        assert len(near) <= 24 and np.isfinite(weights).all()
        assert place == 0 or abs(weights.sum() - 1) < 1e-9


def test_prediction_in_the_hierarchy_is_better_than_in_any_one_pass_order() -> None:
    reference = ball(0)
    order, graph = hierarchy(reference.mesh)
    values = np.sin(8 * reference.mesh.vertices[order])
    errors = [values[p] - row(graph, p)[1] @ values[row(graph, p)[0]] for p in range(50, len(values))]
    assert np.abs(errors).mean() < 0.25 * np.abs(values - values.mean(axis=0)).mean()


def test_an_affine_field_is_predicted_almost_exactly_inside_a_flat_sheet() -> None:
    reference = sheet(levels=0)
    order, graph = hierarchy(reference.mesh)
    plane = reference.mesh.vertices[order][:, 0]
    guesses = [row(graph, p)[1] @ plane[row(graph, p)[0]] for p in range(len(plane))]
    late = slice(len(plane) // 2, None)
    assert np.median(np.abs(plane - guesses)[late]) < 0.015


def test_a_fan_of_many_leaves_and_a_complete_graph_take_no_time() -> None:
    leaves = np.arange(1, 200_000)
    star = Mesh.of(np.random.default_rng(0).normal(size=(200_001, 3)), np.stack([0 * leaves, leaves, leaves + 1], 1))
    assert len(hierarchy(star)[0]) == 200_001
    a, b = np.triu_indices(300, 1)
    complete = Mesh.of(np.random.default_rng(0).normal(size=(300, 3)), np.stack([a, b, a], 1))
    assert len(hierarchy(complete)[0]) == 300


@settings(max_examples=100)
@given(any_mesh())
def test_subdivision_is_that_of_the_topology_module(mesh: Mesh) -> None:
    level = subdivide(mesh.faces, len(mesh.vertices))
    finer = subdivide_midpoint(mesh)
    np.testing.assert_array_equal(level.faces, finer.faces)
    np.testing.assert_array_equal(level.edges, unique_edges(mesh.faces)[0].reshape(-1, 2))
    sides = unique_edges(mesh.faces)[1]
    found = siblings(level)
    for edge in range(len(level.edges)):
        near = found.near[found.starts[edge] : found.starts[edge + 1]]
        together = set(sides[(sides == edge).any(axis=1)].reshape(-1).tolist())
        assert near.tolist() == sorted(other for other in together if other < edge)


def test_faces_that_name_no_vertex_are_refused() -> None:
    for bad in ([[0, 1, 3]], [[-1, 0, 1]]):
        mesh = Mesh.of(np.eye(3), bad)
        with pytest.raises(FormatError):
            hierarchy(mesh)
        with pytest.raises(FormatError):
            subdivide(mesh.faces, 3)
