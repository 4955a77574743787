import numpy as np
import pytest

from meshreel.coding import klt


def field_of(rank: int, vertices: int = 200, frames: int = 6) -> np.ndarray:
    rng = np.random.default_rng(rank)
    scale = 0.1 * 0.5 ** np.arange(rank)
    flat = rng.normal(size=(vertices, rank)) * scale @ rng.normal(size=(rank, 3 * frames)) + rng.normal(size=3 * frames)
    return flat.reshape(vertices, frames, 3)


def first(basis: klt.Basis, count: int) -> klt.Basis:
    return klt.Basis(basis.mean, np.ascontiguousarray(basis.vectors[:, :count]), basis.energies[:count])


def test_inverse_after_forward_is_the_identity_with_the_whole_basis() -> None:
    field = field_of(18)
    basis = klt.fit(field)
    np.testing.assert_allclose(klt.inverse(klt.forward(field, basis), basis), field, atol=1e-12)


def test_a_field_of_rank_three_needs_three_components() -> None:
    field = field_of(3)
    basis = klt.fit(field)
    assert basis.energies[3] < 1e-12 < basis.energies[2]
    three = first(basis, 3)
    np.testing.assert_allclose(klt.inverse(klt.forward(field, three), three), field, atol=1e-12)


def test_energies_are_the_weights_mean_squares_in_falling_order() -> None:
    field = field_of(10)
    basis = klt.fit(field)
    np.testing.assert_allclose((klt.forward(field, basis) ** 2).mean(axis=0), basis.energies, atol=1e-14)
    assert (np.diff(basis.energies) <= 0).all()


def test_signs_do_not_depend_on_the_order_of_the_vertices() -> None:
    field = field_of(4)
    a, b = klt.fit(field), klt.fit(field[::-1].copy())
    np.testing.assert_allclose(a.vectors[:, :4], b.vectors[:, :4], atol=1e-9)


@pytest.mark.parametrize("step", [1e-2, 1e-3, 1e-4])
def test_the_rounded_basis_loses_less_than_the_quantiser(step: float) -> None:
    field = field_of(8)
    rounded = klt.dequantize(klt.quantize(klt.fit(field), 8, step))
    loss = klt.inverse(klt.forward(field, rounded), rounded) - field
    assert np.sqrt((loss**2).sum(axis=(1, 2)).mean()) < 0.2 * step
    np.testing.assert_allclose(rounded.vectors.T @ rounded.vectors, np.eye(8), atol=0.3)


def test_the_decoded_basis_is_exactly_the_integers() -> None:
    symbols = klt.quantize(klt.fit(field_of(5)), 5, 1e-3)
    again = klt.dequantize(symbols)
    np.testing.assert_array_equal(again.vectors.T * 2.0 ** symbols.bits[1:, None], symbols.vectors)


def test_no_vertices_and_no_motion_are_legal() -> None:
    for field in (np.zeros((0, 4, 3)), np.zeros((5, 4, 3)), np.zeros((5, 1, 3))):
        basis = klt.fit(field)
        np.testing.assert_array_equal(klt.inverse(klt.forward(field, basis), basis), field)
        klt.dequantize(klt.quantize(basis, 2, 1e-3))
