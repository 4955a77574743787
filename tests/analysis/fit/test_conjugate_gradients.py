"""Conjugate gradients: exact after as many steps as there are unknowns, and never past their limits."""

from __future__ import annotations

import numpy as np

from meshreel.analysis.fit.conjugate_gradients import Limits, conjugate_gradients

ROWS = np.random.default_rng(1).normal(size=(12, 6))
MATRIX = ROWS.T @ ROWS + 0.1 * np.eye(6)
RIGHT = np.arange(1.0, 7.0)


def solved(limits: Limits, right: np.ndarray = RIGHT) -> tuple[np.ndarray, int]:
    """x, and how often the matrix was applied."""
    calls = [0]

    def multiply(x: np.ndarray) -> np.ndarray:
        calls[0] += 1
        return (MATRIX @ x.reshape(-1)).reshape(x.shape)

    diagonal = np.diag(MATRIX)
    return conjugate_gradients(multiply, lambda r: r / diagonal.reshape(r.shape), right, limits), calls[0]


def test_as_many_iterations_as_unknowns_solve_exactly_in_any_shape() -> None:
    for right in (RIGHT, RIGHT.reshape(2, 3)):
        x, _ = solved(Limits(6, 0.0), right)
        assert x.shape == right.shape
        np.testing.assert_allclose(x.reshape(-1), np.linalg.solve(MATRIX, RIGHT), rtol=1e-9)


def test_they_end_at_the_limit_or_where_the_residual_is_small_enough() -> None:
    assert solved(Limits(3, 0.0))[1] == 3
    rough, fine = (solved(Limits(6, tolerance))[1] for tolerance in (0.5, 1e-6))
    assert rough < fine <= 6


def test_nothing_asked_for_is_nothing_done() -> None:
    x, calls = solved(Limits(6, 1e-3), np.zeros(6))
    assert calls == 0 and not x.any()
