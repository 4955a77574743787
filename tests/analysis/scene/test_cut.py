"""The minimum cut is the least of all cuts; places seen free, and the places that belong to them, move."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.analysis.scene import cut
from meshreel.analysis.scene.cut import _UNIT, _continued, _cut, _hollow, _left_together, moving_places
from meshreel.analysis.scene.places import Places, Tally
from meshreel.geometry.voxels import Lattice, neighbours

COUNT = 7
PAIRS = list(itertools.combinations(range(COUNT), 2))
COSTS = st.lists(st.integers(0, 60), min_size=COUNT, max_size=COUNT)


def cost(moving, moves, rests, links, weights) -> int:
    cut = moving[links[0]] != moving[links[1]]
    return int(moves[~moving].sum() + rests[moving].sum() + weights[cut].sum())


@settings(max_examples=60)
@given(COSTS, COSTS, st.dictionaries(st.sampled_from(PAIRS), st.integers(1, 40), max_size=12))
def test_the_cut_is_the_least_of_all(moves, rests, links):
    moves, rests = np.array(moves), np.array(rests)
    pairs, weights = np.array(list(links), np.int64).reshape(-1, 2).T, np.array(list(links.values()), np.int64)
    found = _cut(moves / _UNIT, rests / _UNIT, pairs, weights / _UNIT)
    all_cuts = (np.array(bits) for bits in itertools.product((False, True), repeat=COUNT))
    least = min(cost(bits, moves, rests, pairs, weights) for bits in all_cuts)
    assert cost(found, moves, rests, pairs, weights) == least


def test_a_link_that_would_round_to_nothing_still_holds():
    pairs = np.array([[0], [1]])
    assert _cut(np.array([1.0, 0]), np.array([0.0, 0]), pairs, np.array([1e-6])).all()


def test_an_edge_is_hollow_where_normals_turn_towards_each_other():
    middles = np.array([[0.0, 0, 0], [1, 0, 0]])
    leaning = np.array([[1.0, 0, 1], [-1, 0, 1]]) / np.sqrt(2)
    first, second = np.array([0]), np.array([1])
    assert _hollow(middles, leaning, first, second)[0] == pytest.approx(np.sqrt(2))
    assert _hollow(middles, leaning[::-1], first, second)[0] == 0  # it bulges
    assert _hollow(middles, np.array([[0.0, 0, 1]] * 2), first, second)[0] == 0  # it is flat


SIZE = 0.1


@pytest.fixture(autouse=True)
def flat(monkeypatch):
    """Costs for a flat sheet of few places: a place has 8 neighbours, 3 across a border."""
    for name, value in {"_FEWEST": 9, "_LEAST": 0.2, "_REACH": 0.45, "_STILL": (3.0, 0.0)}.items():
        monkeypatch.setattr(cut, name, value)


def sheet(free: np.ndarray, normals=(0.0, 0.0, 1.0)) -> Places:
    """A flat sheet of 20 x 20 places in ten frames; how many of them see each place free."""
    lattice = Lattice(np.zeros(3), SIZE)
    cells = np.stack([*np.mgrid[:20, :20], np.zeros((20, 20), int)], axis=-1).reshape(-1, 3)
    keys = lattice.keys(SIZE * (cells + 0.5))
    assert (np.diff(keys) > 0).all()
    seen = np.arange(10)[:, None] < np.broadcast_to(free, (20, 20)).reshape(-1)
    tally = Tally(len(keys))
    for row in seen:
        tally.add(~row, row)
    return Places(lattice, keys, neighbours(keys), np.broadcast_to(np.array(normals), (400, 3)).copy(), tally)


def square(start: int, stop: int, count: int = 9) -> np.ndarray:
    found = np.zeros((20, 20), int)
    found[start:stop, start:stop] = count
    return found


def test_places_that_are_always_occupied_rest():
    assert not moving_places(sheet(np.zeros((20, 20), int))).any()


def test_places_seen_free_move_and_those_around_them_do_not():
    free = square(5, 12)
    assert np.array_equal(moving_places(sheet(free)).reshape(20, 20), free > 0)


def test_a_part_that_is_never_seen_free_but_enclosed_moves_as_well():
    free = square(5, 12)
    free[7:10, 7:10] = 0
    assert np.array_equal(moving_places(sheet(free)).reshape(20, 20), square(5, 12) > 0)


def test_no_place_moves_beyond_reach_of_places_seen_free(monkeypatch):
    monkeypatch.setattr(cut, "_REACH", 0.15)
    monkeypatch.setattr(cut, "_STILL", (0.0, 0.0))
    free = square(2, 18)
    free[5:15, 5:15] = 0
    found = moving_places(sheet(free)).reshape(20, 20)
    assert not found[7:13, 7:13].any() and found[2, 2]


def test_few_places_seen_free_are_noise_and_small_ones_flicker():
    assert not moving_places(sheet(square(5, 7))).any()  # 4 places
    assert not moving_places(sheet(square(5, 9))).any()  # 16 places, 0.16 m^2
    assert moving_places(sheet(square(5, 10))).sum() == 25
    scattered = np.zeros((20, 20), int)
    scattered[::3, ::3] = 9
    assert not moving_places(sheet(scattered)).any()


def test_a_place_seen_free_too_seldom_is_no_evidence(monkeypatch):
    monkeypatch.setattr(cut, "_STILL", (0.2, 0.3))
    assert moving_places(sheet(square(5, 12, 1))).any()
    monkeypatch.setattr(cut, "_SHARE", 0.15)
    assert not moving_places(sheet(square(5, 12, 1))).any()


def test_a_still_plane_goes_on_where_it_was_never_seen_free():
    free, wide = square(5, 12), square(5, 14) > 0
    found = _continued(sheet(free), wide.reshape(-1)).reshape(20, 20)
    assert np.array_equal(found, wide & (free == 0))
    bent = np.where(wide.reshape(-1, 1), [0.0, 1, 0], [0.0, 0, 1])
    assert not _continued(sheet(free, bent), wide.reshape(-1)).any()  # another plane ends there


@pytest.mark.parametrize("together", [True, False])
def test_what_vanishes_with_a_plane_that_left_has_left_though_it_is_hidden(together):
    left, hidden = square(5, 12) > 0, np.zeros((20, 20), bool)
    hidden[5:12, 12:16] = True
    places = sheet(np.zeros((20, 20), int))
    places.tally.__init__(400)
    for frame in range(10):
        there = ~(left & (frame >= 3)) & ~(hidden & (frame >= (3 if together else 6)))
        places.tally.add(there.reshape(-1), (left & (frame >= 3)).reshape(-1))
    found = _left_together(places, left.reshape(-1)).reshape(20, 20)
    assert np.array_equal(found, hidden if together else np.zeros_like(hidden))
