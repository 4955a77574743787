"""Uniform quantisation: error bound, halves, dead zone, overflow."""

from __future__ import annotations

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


@pytest.mark.parametrize("value", [2.0**31, -(2.0**40), np.inf, np.nan])
def test_values_beyond_int32_are_an_input_error(value: float) -> None:
    with pytest.raises(InputError, match="int32"):
        quantize.forward(np.array([[value]]), np.ones(1))


@pytest.mark.parametrize("step", [0.0, -1.0, np.nan, np.inf])
def test_a_step_must_be_positive(step: float) -> None:
    with pytest.raises(InputError, match="step"):
        quantize.forward(np.zeros((1, 1)), np.array([step]))


@pytest.mark.parametrize("dead_zone", [0.4, 1.0, np.nan])
def test_a_dead_zone_outside_its_range_is_named(dead_zone: float) -> None:
    with pytest.raises(InputError, match="dead zone"):
        quantize.forward(np.zeros((1, 1)), np.ones(1), dead_zone)


def test_no_values_and_no_columns_are_legal() -> None:
    assert quantize.forward(np.zeros((0, 2)), np.ones(2)).shape == (0, 2)
    assert quantize.forward(np.zeros((4, 0)), np.ones(0)).shape == (4, 0)
