"""Plans: the cheapest of all ways to share frames among templates, found also by trying every way."""

from itertools import groupby, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.analysis.plan import CODED, NOBODY, POP, REACHED, PlanOptions, best_plan, next_key, rival

OPTIONS = PlanOptions()
GOOD, BAD = 0.6, 1.9


def groups(*rows: list[float], onward: tuple[int, ...] = (), **changes: float) -> list[tuple[int, int, int]]:
    known = [k in onward for k in range(len(rows))]
    plan = best_plan(np.array(rows), known, PlanOptions(**changes))
    return [(group.template, group.first, group.stop) for group in plan.groups]


def test_one_template_that_follows_all_frames_is_enough():
    assert groups([GOOD] * 10, [0.5] * 4 + [np.inf] * 6) == [(0, 0, 10)]


def test_a_cut_is_where_one_template_is_lost_and_another_begins():
    assert groups([GOOD] * 6 + [np.inf] * 4, [np.inf] * 3 + [GOOD] * 7) == [(0, 0, 6), (1, 6, 10)]


def test_a_good_key_beats_every_cut():
    thirds = [GOOD] * 6 + [np.inf] * 4, [np.inf] * 3 + [GOOD] * 7, [1.2] * 10
    assert groups(*thirds) == [(2, 0, 10)]


def test_a_cut_must_be_worth_a_template_more(monkeypatch):
    rows = [GOOD] * 8 + [BAD] * 8, [BAD] * 8 + [GOOD] * 8
    saved = 8 * (BAD**2 - GOOD**2)
    monkeypatch.setattr("meshreel.analysis.plan.POP", 100.0)
    assert len(groups(*rows, worth=0.9 * saved)) == 2
    assert len(groups(*rows, worth=1.1 * saved)) == 1


def test_frames_that_no_template_follows_are_coded_one_by_one():
    assert groups([np.inf] * 3 + [GOOD] * 5) == [(NOBODY, 0, 3), (0, 3, 8)]
    assert [group.template for group in best_plan(np.zeros((0, 4)), [], OPTIONS).groups] == [NOBODY]


def test_the_template_of_the_group_before_costs_nothing_but_can_only_begin():
    assert groups([0.9] * 10, [GOOD] * 10, onward=(0,)) == [(0, 0, 10)]
    assert groups([np.inf] + [0.9] * 9, [GOOD] * 10, onward=(0,)) == [(1, 0, 10)]


def test_a_step_of_the_quality_at_a_cut_has_a_price(monkeypatch):
    early, late = [GOOD] * 5 + [1.8] * 3 + [np.inf] * 2, [np.inf] * 2 + [1.7] * 5 + [GOOD] * 3
    monkeypatch.setattr("meshreel.analysis.plan.POP", 100.0)
    [first, _] = groups(early, late)
    assert first == (0, 0, 5)  # where the sum is least: from .6 to 1.7
    monkeypatch.setattr("meshreel.analysis.plan.POP", 0.5)
    [first, _] = groups(early, late)
    assert first[2] in (6, 7)  # from 1.8 to 1.7


@settings(max_examples=60)
@given(st.integers(1, 3), st.integers(1, 5), st.randoms(use_true_random=False))
def test_no_other_way_is_cheaper(count, frames, random):
    residuals = np.array([[random.choice([0.3, 0.9, 1.6, np.inf]) for _ in range(frames)] for _ in range(count)])
    onward = [random.random() < 0.3 for _ in range(count)]
    plan = best_plan(residuals, onward, OPTIONS)
    costs = [cost_of(path, residuals, onward) for path in product(range(-1, count), repeat=frames)]
    assert plan.cost == pytest.approx(min(costs))
    path = [group.template for group in plan.groups for _ in range(group.stop - group.first)]
    assert cost_of(tuple(path), residuals, onward) == pytest.approx(plan.cost)


def cost_of(path: tuple[int, ...], residuals: np.ndarray, onward: list[bool]) -> float:
    """The cost as the docstring says it."""
    squares = [residuals[c, t] ** 2 if c != NOBODY else OPTIONS.alone * OPTIONS.worth for t, c in enumerate(path)]
    total, at, error = sum(squares), 0, None
    for template, same in groupby(path):
        stop = at + len(list(same))
        if template != NOBODY and not onward[template]:
            total += OPTIONS.worth
        if template != NOBODY and onward[template] and at > 0:
            return np.inf
        errors = [squares[t] + CODED if template != NOBODY else REACHED for t in (at, stop - 1)]
        if error is not None and np.isfinite(errors[0]) and np.isfinite(error):
            total += OPTIONS.worth * max(abs(10 * np.log10(errors[0] / error)) / POP - 1, 0)
        at, error = stop, errors[1]
    return total


def test_the_next_key_is_in_the_middle_of_the_frames_that_cost_most():
    plan = best_plan(np.array([[GOOD] * 5 + [np.inf] * 5]), [False], OPTIONS)
    assert next_key(plan, {2}) == 7 and next_key(plan, {2, 7}) in (6, 8)
    assert next_key(plan, set(range(10))) is None
    nothing = best_plan(np.zeros((0, 9)), [], OPTIONS)
    assert next_key(nothing, set()) == 4


def test_plans_are_coded_for_comparison_only_where_they_are_close():
    rows = np.array([[GOOD] * 8 + [BAD] * 8, [BAD] * 8 + [GOOD] * 8])
    saved = 8 * (BAD**2 - GOOD**2)
    for worth, is_close in ((0.95 * saved, True), (0.1 * saved, False)):
        options = PlanOptions(worth=worth)
        other = rival(best_plan(rows, [False] * 2, options), rows, [False] * 2, options)
        assert (other is not None) == is_close
