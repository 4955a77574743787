"""Bodies are connected pieces tracked over time; small bits join a body or are counted as dropped."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.analysis.scene.bodies import at_most, beyond, find_bodies, ring, same_bodies, with_ring
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.topology import concatenate, part_of
from meshreel.types import Mesh
from tests.metrics.shapes import moved, plane, sphere

CELL = 0.05
BALL = sphere(0.3, 3)  # 1.1 m^2
BIT = sphere(0.05, 1)  # 0.03 m^2
NONE = Mesh.empty()


def at(x: float, y: float = 0.0, z: float = 0.0, mesh: Mesh = BALL) -> Mesh:
    return moved(mesh, (x, y, z))


def walls(meshes) -> list[list[float]]:
    """For each body, of each frame, its middle along x; NaN where it is not there."""
    return [[np.nan if m.is_empty else round(float(m.vertices[:, 0].mean()), 2) for m in body] for body in meshes]


def test_two_separate_pieces_are_two_bodies_with_one_number_in_every_frame():
    frames = [concatenate([at(0.1 * t), at(3 - 0.1 * t)]) for t in range(4)]
    found = find_bodies(frames, CELL)
    assert walls(found.meshes) == [[0.0, 0.1, 0.2, 0.3], [3.0, 2.9, 2.8, 2.7]] and found.dropped == 0
    assert sum(len(body[0].faces) for body in found.meshes) == len(frames[0].faces)


def test_pieces_that_touch_in_one_frame_are_one_body_in_the_whole_interval():
    frames = [concatenate([at(0), at(x)]) for x in (2.0, 1.4, 0.8, 0.62, 0.8, 1.4, 2.0)]
    assert len(find_bodies(frames, CELL).meshes) == 1
    assert len(find_bodies(frames[:2], CELL).meshes) == 2


def test_a_body_that_leaves_and_one_that_comes_later_are_two_bodies():
    frames = [at(0), at(0.1), NONE, at(5), at(5.1)]
    assert str(walls(find_bodies(frames, CELL).meshes)) == str([[0.0, 0.1, *[np.nan] * 3], [*[np.nan] * 3, 5.0, 5.1]])


def test_a_body_that_jumps_is_two_bodies():
    assert len(find_bodies([at(0), at(3)], CELL).meshes) == 2


@pytest.mark.parametrize("where", [0.0, 4.0])
def test_bits_go_to_the_nearest_body(where):
    side = 0.4 if where == 0 else -0.4
    frames = [concatenate([at(0), at(4), at(where + side, mesh=BIT)])] * 2
    found = find_bodies(frames, CELL)
    sizes = [len(body[0].faces) - len(BALL.faces) for body in found.meshes]
    assert sizes == ([len(BIT.faces), 0] if where == 0 else [0, len(BIT.faces)]) and found.dropped == 0


def test_the_smallest_of_too_many_bodies_become_part_of_the_nearest():
    bodies = [[at(0), at(0.1)], [at(4.5, mesh=BIT), NONE], [at(5), at(5)], [NONE, at(1, mesh=BIT)]]
    found = at_most(bodies, 2)
    assert [[len(mesh.faces) for mesh in body] for body in found] == [
        [len(BALL.faces), len(BALL.faces) + len(BIT.faces)],
        [len(BALL.faces) + len(BIT.faces), len(BALL.faces)],
    ]
    assert at_most(bodies, 4) == bodies and at_most([], 4) == []


def test_bits_far_from_all_bodies_are_dropped_and_counted():
    frames = [concatenate([at(0), at(4, mesh=BIT)]), at(0), at(0), concatenate([at(0), at(0, 4, mesh=BIT)])]
    found = find_bodies(frames, CELL)
    assert len(found.meshes) == 1 and found.dropped == 2 * len(BIT.faces)
    assert [len(mesh.faces) for mesh in found.meshes[0]] == [len(BALL.faces)] * 4


def test_bits_that_last_are_a_body_of_their_own():
    frames = [concatenate([at(0), at(4 + 0.01 * t, mesh=BIT)]) for t in range(5)]
    found = find_bodies(frames, CELL)
    assert len(found.meshes) == 2 and found.dropped == 0
    assert len(find_bodies(frames[:4], CELL).meshes) == 1


def test_bits_alone_without_any_body_are_kept_where_they_last():
    assert find_bodies([at(0, mesh=BIT)] * 4, CELL).dropped == 4 * len(BIT.faces)
    assert find_bodies([at(0, mesh=BIT)] * 5, CELL).dropped == 0


@settings(max_examples=30)
@given(
    st.lists(
        st.lists(st.tuples(st.sampled_from([BALL, BIT]), st.floats(-3, 3), st.floats(-3, 3)), max_size=4),
        min_size=1,
        max_size=5,
    )
)
def test_no_face_is_lost_without_being_counted(frames):
    meshes = [concatenate([at(x, y, mesh=mesh) for mesh, x, y in frame]) if frame else NONE for frame in frames]
    found = find_bodies(meshes, CELL)
    assert all(len(body) == len(frames) for body in found.meshes)
    kept = sum(len(mesh.faces) for body in found.meshes for mesh in body)
    assert kept + found.dropped == sum(len(mesh.faces) for mesh in meshes)


def test_a_body_is_continued_by_that_which_shares_most_with_it():
    before = [at(0), NONE, at(3)]
    assert same_bodies(before, [at(3.1), at(0.05), at(8)], CELL) == [2, 0, -1]
    both = [at(0.2), at(0.05)]
    assert same_bodies([at(0)], both, CELL) == [-1, 0]
    assert same_bodies([], [at(0)], CELL) == [-1]
    assert same_bodies([at(0)], [], CELL) == []
    assert same_bodies([NONE], [NONE], CELL) == [-1]


def test_a_ring_surrounds_moving_faces_without_large_ones():
    floor = plane(1.0, 10)
    middles = floor.vertices[floor.faces].mean(axis=1)[:, :2]
    moves = np.abs(middles - 0.5).max(axis=1) < 0.1  # 2 x 2 cells
    found = ring(floor, moves, 0.1)
    assert moves.sum() == 8 and not (found & moves).any()
    around = np.ptp(floor.vertices[floor.faces[found | moves]].reshape(-1, 3), axis=0)[:2]
    assert (
        around == pytest.approx(0.4) and found.sum() == 4 * 4 * 2 - 8 - 2
    )  # two corners only touch by their far halves
    assert not ring(floor, moves, 0.05).any() and not ring(floor, np.zeros_like(moves), 0.1).any()
    assert len(ring(NONE, np.zeros(0, bool), 0.1)) == 0


def test_a_ring_goes_on_to_where_the_background_begins_but_not_without_end():
    """A hole in the background is filled up to its border, not beyond; where there is nothing at all, four faces."""
    floor, cell = plane(1.0, 20), 0.1
    middles = floor.vertices[floor.faces].mean(axis=1)[:, :2] - 0.5
    moves = np.abs(middles).max(axis=1) < 0.05
    for hole, side in ((0.1, 0.2), (0.15, 0.3), (0.25, 0.5), (0.45, 0.5)):
        rest = part_of(floor, np.abs(middles).max(axis=1) > hole)
        found = with_ring(floor, moves, cell, Surface(rest))
        assert np.ptp(found.vertices, axis=0)[:2] == pytest.approx(side), hole
    narrow = part_of(floor, moves | ring(floor, moves, cell))
    for background in (Surface(floor), None):
        assert len(with_ring(floor, moves, cell, background).faces) == len(narrow.faces)
    assert with_ring(floor, np.zeros_like(moves), cell, Surface(rest)).is_empty


@pytest.mark.parametrize(("side", "away", "is_coded"), [(0.2, 3.0, True), (0.06, 3.0, False), (0.06, 0.3, True)])
def test_what_the_room_lacks_is_coded_where_it_is_large_or_beside_a_body(side, away, is_coded):
    body, piece = moved(sphere(0.3, 2), (0, 0, 1)), moved(plane(side, 4), (away, 0, 1))
    mesh = concatenate([plane(8.0, 20), body, piece])
    first = len(mesh.faces) - len(piece.faces)
    moves = np.zeros(len(mesh.faces), bool)
    moves[first - len(body.faces) : first] = True
    off = np.arange(len(mesh.vertices)) >= len(mesh.vertices) - len(piece.vertices)
    found = beyond(mesh, moves, off)
    assert found[:first].tolist() == moves[:first].tolist() and found[first:].all() == found[first:].any() == is_coded
