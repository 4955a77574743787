"""The core's fit against the formulas that it computes."""

import numpy as np
import pytest

from meshreel import _core
from meshreel.analysis.fit.frame import FrameSurface
from meshreel.types import Mesh
from tests.analysis.fit.formulas import fitted, laplacian, turned_laplacian
from tests.analysis.fit.test_surface_fit import ball, sheet, stretched

GATE, SMOOTHING, ANCHOR, LEAST = 0.03, 0.7, 0.02, 0.3


def bumpy(mesh: Mesh, seed: int, size: float = 0.003) -> Mesh:
    return Mesh(mesh.vertices + np.random.default_rng(seed).normal(0, size, mesh.vertices.shape), mesh.faces)


def all_points(rounds: int) -> np.ndarray:
    """Strides of the rounds."""
    return np.ones(rounds, np.int32)


def in_the_core(
    mesh: Mesh, frame: Mesh, rest: np.ndarray, place: np.ndarray, turn: bool, rounds: int = 1
) -> np.ndarray:
    template = _core.FitTemplate(mesh.faces, len(mesh.vertices))
    gates, smoothing = np.full(rounds, GATE), np.full(rounds, SMOOTHING)
    target = FrameSurface(frame).target
    return template.fit(
        target, rest, place, mesh.vertices, gates, smoothing, all_points(len(gates)), LEAST, ANCHOR, 1e-7, 400, turn
    )


@pytest.mark.parametrize(
    ("template", "frame"),
    [
        (ball(3), stretched(ball(4))),
        (sheet(12), sheet(21, 0.004)),
        (sheet(9), bumpy(sheet(30), 1)),
        (ball(3), sheet(9)),
    ],
)
@pytest.mark.parametrize("turn", [False, True])
def test_a_round_solves_the_equations_of_its_rows(template: Mesh, frame: Mesh, turn: bool) -> None:
    start, rest = bumpy(template, 2), template.vertices
    found = in_the_core(start, frame, rest, template.vertices, turn)
    if turn:
        shape = turned_laplacian(template.faces, rest, start.vertices)
    else:
        shape = laplacian(template.faces, len(rest)) @ rest
    wanted = fitted(start, FrameSurface(frame), shape, template.vertices, GATE, SMOOTHING, ANCHOR, LEAST)
    assert np.abs(found - wanted).max() < 3e-6
    assert np.abs(wanted - start.vertices).max() > 1e-3


def test_the_shape_turns_as_the_best_rotation_of_each_neighbourhood() -> None:
    rest, angle = bumpy(ball(3), 4), np.pi * 0.9
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    template = _core.FitTemplate(rest.faces, len(rest.vertices))
    rigid = template.turned_laplacian(rest.vertices, rest.vertices @ turn.T + 0.3)
    assert np.abs(rigid - laplacian(rest.faces, len(rest.vertices)) @ rest.vertices @ turn.T).max() < 1e-7
    now = bumpy(Mesh(rest.vertices @ turn.T, rest.faces), 5)
    found = template.turned_laplacian(rest.vertices, now.vertices)
    assert np.abs(found - turned_laplacian(rest.faces, rest.vertices, now.vertices)).max() < 3e-6


def test_later_rounds_find_the_closest_points_that_a_first_one_would() -> None:
    template, frame = ball(3), stretched(ball(4))
    twice = in_the_core(template, frame, template.vertices, template.vertices, False, rounds=2)
    once = in_the_core(template, frame, template.vertices, template.vertices, False)
    again = in_the_core(Mesh(once, template.faces), frame, template.vertices, template.vertices, False)
    assert np.abs(again - twice).max() < 3e-6


def test_arrays_that_do_not_fit_are_refused() -> None:
    template, wrong = _core.FitTemplate(ball(1).faces, len(ball(1).vertices)), ball(2).vertices
    target, one = FrameSurface(ball(2)).target, np.ones(1)
    with pytest.raises(ValueError, match="sizes do not fit"):
        template.fit(target, wrong, wrong, wrong, one, one, all_points(1), 0.3, 0.1, 1e-3, 9, False)
    with pytest.raises(ValueError, match="out of range"):
        _core.FitTemplate(ball(1).faces + 999, 9)
    right = ball(1).vertices
    with pytest.raises(ValueError, match="not finite"):
        template.fit(target, right, right, right, np.zeros(1), one, all_points(1), 0.3, 0.1, 1e-3, 9, False)
