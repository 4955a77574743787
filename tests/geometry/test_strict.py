"""Strict algebra agrees with NumPy's to rounding, and its exp, log2 and angles are exact where they can be."""

import numpy as np
import pytest

from meshreel import _core
from meshreel.geometry import strict

RANDOM = np.random.default_rng(5)


@pytest.mark.parametrize(("rows", "inner", "columns"), [(1, 0, 1), (3, 5, 2), (48, 300, 48), (300, 48, 300)])
def test_products_are_those_of_numpy(rows: int, inner: int, columns: int):
    a, b = RANDOM.normal(size=(rows, inner)), RANDOM.normal(size=(inner, columns))
    assert np.allclose(strict.products(a, b), a @ b, rtol=1e-12, atol=1e-12)
    assert np.allclose(strict.products(np.stack([a, -a]), np.stack([b, b])), np.stack([a @ b, -a @ b]), atol=1e-12)


def test_both_orders_of_a_product_give_the_same_bits():
    a, b = RANDOM.normal(size=(300, 60)), RANDOM.normal(size=(60, 100))  # large: row by row; a row alone is small
    assert np.array_equal(strict.products(a, b)[7], strict.products(a[7:8], b)[0])


def test_arrays_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="do not fit"):
        strict.products(np.zeros((2, 3)), np.zeros((2, 3)))
    for function in (_core.inverses, _core.eigen):
        with pytest.raises(ValueError, match="do not fit"):
            function(np.zeros((1, 2, 3)))
    with pytest.raises(ValueError, match="do not fit"):
        _core.angle(np.zeros(2), np.zeros(3))


def test_inverses_undo_and_a_matrix_without_one_is_not_finite():
    matrices = RANDOM.normal(size=(50, 6, 6))
    assert np.allclose(strict.products(strict.inverses(matrices), matrices), np.eye(6), atol=1e-9)
    assert not np.isfinite(strict.inverses(np.zeros((1, 3, 3)))).any()
    assert np.allclose(strict.determinants(matrices[:, :3, :3]), np.linalg.det(matrices[:, :3, :3]))


@pytest.mark.parametrize("size", [0, 1, 2, 48])
def test_eigenvectors_are_orthonormal_and_only_scaled(size: int):
    matrix = RANDOM.normal(size=(size, size))
    matrix = matrix @ matrix.T
    values, vectors = strict.eigen(matrix)
    assert np.allclose(values, np.linalg.eigvalsh(matrix), atol=1e-10)
    assert np.allclose(vectors.T @ vectors, np.eye(size), atol=1e-12)
    assert np.allclose(matrix @ vectors, vectors * values, atol=1e-10)


def test_what_is_not_finite_has_no_eigenvalues_but_ends():
    assert not np.isfinite(strict.eigen(np.full((4, 4), np.nan))[0]).any()


def test_nearest_rotations_are_those_of_the_singular_value_decomposition():
    matrices = RANDOM.normal(size=(300, 3, 3))  # half of them mirror
    u, sizes, vt = np.linalg.svd(matrices)
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    found, two = strict.nearest_rotations(matrices)
    assert np.allclose(found, u @ vt, atol=1e-9)
    assert np.allclose(two, sizes[:, :2])


def test_functions_are_numpys_to_a_few_units_in_the_last_place():
    x = np.concatenate([RANDOM.uniform(-700, 700, 2000), RANDOM.uniform(-1, 1, 2000)])
    assert np.allclose(strict.exp(x), np.exp(x), rtol=1e-15, atol=0)
    assert np.allclose(strict.log2(np.abs(x)), np.log2(np.abs(x)), rtol=1e-15, atol=1e-15)
    y, x = np.abs(x).reshape(2, -1)
    assert np.allclose(strict.angle(y, x), np.arctan2(y, x), rtol=1e-15, atol=1e-16)


def test_functions_at_their_ends():
    assert strict.exp(np.array([0.0, -np.inf, -746.0, 710.0])).tolist() == [1.0, 0.0, 0.0, np.inf]
    assert strict.log2(2.0 ** np.arange(-1074, 1024)).tolist() == list(range(-1074, 1024))
    assert strict.log2(np.array([0.0, np.inf])).tolist() == [-np.inf, np.inf]
    assert np.isnan([*strict.exp(np.array([np.nan])), *strict.log2(np.array([-1.0, np.nan]))]).all()
    assert strict.angle(np.array([0.0, 2.0, 0.0]), np.array([0.0, 0.0, 3.0])).tolist() == [0.0, np.pi / 2, 0.0]
    assert np.isnan(strict.angle(np.array([np.nan]), np.array([1.0]))).all()


def test_nothing_to_turn_is_not_turned():
    assert np.array_equal(strict.nearest_rotations(np.zeros((1, 3, 3)))[0], np.eye(3)[None])


def test_decisions_on_powers_are_robust():
    assert [strict.ceil_log2(value) for value in (0.5, 1.0, 1.5, 8.0, np.nextafter(8.0, 9))] == [-1, 0, 1, 3, 4]
    assert strict.rounded(np.nextafter(0.1, 1)) == strict.rounded(0.1) == 0.1
