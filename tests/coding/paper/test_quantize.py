"""Uniform quantisation: error bound, halves, dead zone, overflow."""

import hypothesis.extra.numpy as hnp
import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from meshreel.coding.paper import quantize
from meshreel.errors import InputError


@given(
    values=hnp.arrays(np.float64, st.tuples(st.integers(0, 9), st.just(3)), elements=st.floats(-1e3, 1e3)),
    steps=hnp.arrays(np.float64, 3, elements=st.floats(1e-4, 10)),
)
def test_the_error_is_at_most_half_a_step(values: np.ndarray, steps: np.ndarray) -> None:
    error = np.abs(quantize.inverse(quantize.forward(values, steps), steps) - values)
    assert np.all(error <= steps / 2 * (1 + 1e-6))


@given(symbols=hnp.arrays(np.int32, (5, 2)), step=st.floats(1e-4, 10))
def test_symbols_survive_inverse_then_forward(symbols: np.ndarray, step: float) -> None:
    symbols = np.maximum(symbols, -quantize.LARGEST)
    steps = np.array([step, 2 * step])
    assert np.array_equal(quantize.forward(quantize.inverse(symbols, steps), steps), symbols)


def test_halves_round_away_from_zero() -> None:
    symbols = quantize.forward(np.array([[0.5], [-0.5], [1.5], [-2.5], [0.49]]), np.ones(1))
    assert symbols.ravel().tolist() == [1, -1, 2, -3, 0]


def test_a_dead_zone_rounds_towards_zero() -> None:
    symbols = quantize.forward(np.array([[0.6], [0.7], [-1.6], [-1.7]]), np.ones(1), dead_zone=0.65)
    assert symbols.ravel().tolist() == [0, 1, -1, -2]


@pytest.mark.parametrize(
    ("value", "step", "dead_zone", "words"),
    [
        *((value, 1.0, 0.5, "int32") for value in (2.0**31, -(2.0**40), np.inf, np.nan)),
        *((0.0, step, 0.5, "step") for step in (0.0, -1.0, np.nan, np.inf)),
        *((0.0, 1.0, dead_zone, "dead zone") for dead_zone in (0.4, 1.0, np.nan)),
    ],
)
def test_numbers_that_cannot_be_are_refused(value: float, step: float, dead_zone: float, words: str) -> None:
    with pytest.raises(InputError, match=words):
        quantize.forward(np.array([[value]]), np.array([step]), dead_zone)


def test_no_values_and_no_columns_are_legal() -> None:
    assert quantize.forward(np.zeros((0, 2)), np.ones(2)).shape == (0, 2)
    assert quantize.forward(np.zeros((4, 0)), np.ones(0)).shape == (4, 0)
