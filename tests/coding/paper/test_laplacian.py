from collections.abc import Sequence

import numpy as np
import pytest

from meshreel import _core
from meshreel.coding.paper import laplacian
from meshreel.format.layout import AnchorRule
from meshreel.geometry.topology import components, subdivide_midpoint
from meshreel.types import Mesh


def forward(weights: np.ndarray, base: Mesh, anchors: np.ndarray) -> np.ndarray:
    return laplacian.System(base, anchors).forward(weights)


def inverse(deltas: np.ndarray, base: Mesh, anchors: np.ndarray) -> np.ndarray:
    return laplacian.System(base, anchors).inverse(deltas)


def icosahedron(levels: int = 2) -> Mesh:
    p = (1 + 5**0.5) / 2
    vertices = [[-1, p, 0], [1, p, 0], [-1, -p, 0], [1, -p, 0], [0, -1, p], [0, 1, p]]
    vertices += [[0, -1, -p], [0, 1, -p], [p, 0, -1], [p, 0, 1], [-p, 0, -1], [-p, 0, 1]]
    faces = [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2]]
    faces += [[10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11]]
    faces += [[6, 2, 10], [8, 6, 7], [9, 8, 1]]
    return subdivide_midpoint(Mesh.of(np.array(vertices) / 4, faces), levels)


def spoiled() -> Mesh:
    """Two bodies with zero-area faces, needles, duplicate positions, repeated and collapsed faces, lone vertices."""
    one = icosahedron(2)
    vertices = np.concatenate([one.vertices, one.vertices + [2.0, 0.0, 0.0], [[5.0, 5.0, 5.0], [0.0, 0.0, 0.0]]])
    faces = np.concatenate([one.faces, one.faces + len(one.vertices)])
    vertices[faces[3]] = vertices[faces[3, 0]]  # three vertices in one place
    vertices[faces[50, 2]] = (vertices[faces[50, 0]] + vertices[faces[50, 1]]) / 2  # on its opposite edge
    vertices[faces[90, 1]] = vertices[faces[90, 0]] + 1e-13  # a needle
    vertices[faces[200, 1]] = vertices[faces[200, 0]] + 1e-300
    extra = [faces[7], faces[7], [5, 5, 9], [8, 8, 8]]
    return Mesh.of(vertices, np.concatenate([faces, extra]))


def test_mean_value_weights_agree_with_their_trigonometric_definition() -> None:
    base = icosahedron(1)
    rows, columns, weights = _core.Laplacian(base.vertices, base.faces, np.zeros(0, np.int32), 1.0).weights()
    expected = np.zeros((len(base.vertices), len(base.vertices)))
    for face in base.faces:
        for c in range(3):
            i, j, k = face[c], face[(c + 1) % 3], face[(c + 2) % 3]
            u, w = base.vertices[j] - base.vertices[i], base.vertices[k] - base.vertices[i]
            angle = np.arccos(u @ w / np.linalg.norm(u) / np.linalg.norm(w))
            expected[i, j] += np.tan(angle / 2) / np.linalg.norm(u)
            expected[i, k] += np.tan(angle / 2) / np.linalg.norm(w)
    expected /= expected.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(weights, expected[rows, columns], rtol=1e-12)
    assert np.count_nonzero(expected) == len(rows)


def test_a_constant_has_no_deltas_but_at_the_anchors() -> None:
    base = icosahedron()
    deltas = forward(np.full((len(base.vertices), 2), 3.5), base, np.array([0, 9], np.int32))
    np.testing.assert_allclose(deltas[:-2], 0, atol=1e-14)
    np.testing.assert_array_equal(deltas[-2:], 3.5)


@pytest.mark.parametrize("base", [icosahedron(), spoiled()], ids=["sphere", "spoiled"])
@pytest.mark.parametrize("rule", list(AnchorRule))
def test_inverse_after_forward_is_the_identity(base: Mesh, rule: AnchorRule) -> None:
    indices = laplacian.anchors(rule, 7, base.faces, len(base.vertices))
    weights = np.random.default_rng(0).normal(size=(len(base.vertices), 5))
    back = inverse(forward(weights, base, indices), base, indices)
    np.testing.assert_allclose(back, weights, atol=1e-9)


LONE = len(spoiled().vertices) - 1  # a vertex without faces


@pytest.mark.parametrize("weight", [1, 4, 255])
@pytest.mark.parametrize(
    "anchors", [[0, 200], [5, 9, 77, 161, 162, 300], [2, 180, LONE], range(LONE)], ids=["two", "some", "lone", "all"]
)
def test_inverse_is_the_least_squares_solution(anchors: Sequence[int], weight: int) -> None:
    """Of two components: an anchor in each, several, one at a vertex without faces, and more than pay."""
    base = spoiled()
    system = laplacian.System(base, np.array(anchors, np.int32), weight)
    deltas = np.random.default_rng(1).normal(size=(len(base.vertices) + len(anchors), 3))
    matrix = system.forward(np.eye(len(base.vertices)))
    expected = np.linalg.lstsq(matrix, deltas, rcond=None)[0]
    np.testing.assert_allclose(system.inverse(deltas), expected, atol=1e-9)


def test_digits_do_not_run_out_on_many_vertices() -> None:
    base = icosahedron(6)
    indices = laplacian.anchors(AnchorRule.FARTHEST, 6, base.faces, len(base.vertices))
    weights = np.random.default_rng(4).normal(size=(len(base.vertices), 2))
    assert len(base.vertices) > 40_000
    np.testing.assert_allclose(inverse(forward(weights, base, indices), base, indices), weights, atol=2e-8)


@pytest.mark.parametrize("anchors", [[0, 5], [], [0, LONE], range(162)], ids=str)
def test_a_component_without_anchors_is_refused(anchors: Sequence[int]) -> None:
    base = spoiled()
    system = laplacian.System(base, np.array(anchors, np.int32))
    with pytest.raises(ValueError, match="anchor"):
        system.inverse(np.zeros((len(base.vertices) + len(anchors), 1)))


def test_a_column_does_not_depend_on_the_others() -> None:
    base = icosahedron()
    indices = laplacian.anchors(AnchorRule.FARTHEST, 5, base.faces, len(base.vertices))
    deltas = np.random.default_rng(2).normal(size=(len(base.vertices) + len(indices), 11))
    system = laplacian.System(base, indices)
    together = system.inverse(deltas)
    for k in (0, 7, 10):
        np.testing.assert_array_equal(system.inverse(np.ascontiguousarray(deltas[:, k : k + 1]))[:, 0], together[:, k])


def test_degenerate_faces_leave_all_weights_positive_finite_and_bounded() -> None:
    base = spoiled()
    rows, _, weights = _core.Laplacian(base.vertices, base.faces, np.zeros(0, np.int32), 1.0).weights()
    assert np.isfinite(weights).all()
    assert weights.min() > 0.0005
    np.testing.assert_allclose(np.bincount(rows, weights)[np.unique(rows)], 1, rtol=1e-12)


@pytest.mark.parametrize("base", [icosahedron(3), spoiled()], ids=["sphere", "spoiled"])
@pytest.mark.parametrize("step", [0.1, 0.001])
def test_shaped_rounding_keeps_the_error_in_proportion_to_the_step(base: Mesh, step: float) -> None:
    indices = laplacian.anchors(AnchorRule.FARTHEST, 1, base.faces, len(base.vertices))
    system = laplacian.System(base, indices, 4)
    rng = np.random.default_rng(3)
    weights = np.cumsum(rng.normal(size=(len(base.vertices), 4)), axis=0) * 0.01
    deltas = system.forward(weights)
    symbols = system.quantize(deltas, np.full(4, step), np.zeros(4))
    error = system.inverse(symbols * step) - weights
    plain = system.inverse(np.rint(deltas / step) * step) - weights
    assert np.sqrt((error**2).mean()) < 1.5 * step
    assert (error**2).mean() < (plain**2).mean()


def test_every_component_has_an_anchor_and_lone_vertices_none() -> None:
    base = spoiled()
    labels = components(base.faces, len(base.vertices))
    for rule in AnchorRule:
        for count in (0, 1, 40):
            indices = laplacian.anchors(rule, count, base.faces, len(base.vertices))
            assert set(labels[base.faces[:, 0]]) == set(labels[indices])
            assert (np.diff(indices) > 0).all()
            assert indices.max() < len(base.vertices) - 2


def test_meshes_without_faces_or_vertices_are_legal() -> None:
    for base in (Mesh.empty(), Mesh.of(np.eye(3), np.zeros((0, 3)))):
        for rule in AnchorRule:
            indices = laplacian.anchors(rule, 4, base.faces, len(base.vertices))
            weights = np.ones((len(base.vertices), 2))
            assert len(indices) == 0
            np.testing.assert_array_equal(inverse(forward(weights, base, indices), base, indices), weights)


def test_bad_indices_and_coordinates_are_refused() -> None:
    base = icosahedron(1)
    none = np.zeros(0, np.int32)
    with pytest.raises(ValueError, match="out of range"):
        laplacian.System(Mesh(base.vertices, base.faces + 1), none)
    with pytest.raises(ValueError, match="out of range"):
        laplacian.System(base, np.array([-1], np.int32))
    with pytest.raises(ValueError, match="ascend"):
        laplacian.System(base, np.array([3, 3], np.int32))
    with pytest.raises(ValueError, match="finite"):
        laplacian.System(Mesh(base.vertices * np.nan, base.faces), none)
    with pytest.raises(ValueError, match="anchor"):
        laplacian.System(base, none).inverse(np.zeros((len(base.vertices), 1)))
