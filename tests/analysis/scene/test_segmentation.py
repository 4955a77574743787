"""Segmentation: moving faces are found, still ones are not, and labels are clean."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.analysis.scene import labelling
from meshreel.analysis.scene.cut import Rest
from meshreel.analysis.scene.labelling import ByPlace, without_islands
from meshreel.analysis.scene.masks import Masker
from meshreel.analysis.scene.segmentation import segment, segment_by
from meshreel.geometry.topology import components, concatenate, face_normals
from meshreel.geometry.voxels import Lattice
from meshreel.types import Mesh, MeshList
from tests.metrics.shapes import moved, plane
from tests.scenes import CELL, ball, figure, of_body, overlap, room, with_room

NONE = Mesh.empty()
pytestmark = pytest.mark.usefixtures("small_views")
ROLLING = with_room([ball(0.5 + 0.25 * t) for t in range(6)])


def overlaps(frames: list[Mesh], found: ByPlace) -> list[float]:
    return [overlap(found.moving(number, mesh), of_body(mesh)) for number, mesh in enumerate(frames)]


@pytest.fixture(scope="module")
def rolling() -> ByPlace:
    return segment(MeshList(tuple(ROLLING)))


def test_a_ball_that_rolls_is_found_and_the_room_rests(rolling):
    assert min(overlaps(ROLLING, rolling)) > 0.9
    for number, mesh in enumerate(ROLLING):
        on_wall = ~of_body(mesh) & (mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > 0.2)
        assert not rolling.moving(number, mesh)[on_wall].any()


def test_a_scene_whose_faces_are_inside_out_is_segmented_too(rolling):
    inside_out = [Mesh(mesh.vertices, np.ascontiguousarray(mesh.faces[:, ::-1])) for mesh in ROLLING]
    found = segment(MeshList(tuple(inside_out)))
    assert min(overlaps(inside_out, found)) > 0.9
    assert np.array_equal(found.chosen, rolling.chosen)


def test_frames_that_were_not_looked_at_are_labelled_as_well(monkeypatch):
    monkeypatch.setattr("meshreel.analysis.scene.places._FRAMES", 3)
    few = segment(MeshList(tuple(ROLLING)))
    assert overlaps(ROLLING, few)[2] > 0.9  # where it was looked at; between, it is where nobody has looked
    assert min(overlaps(ROLLING, few)) > 0.3


def test_a_body_present_only_between_inspected_frames_moves(monkeypatch):
    """A ball that comes after a look and is gone before the next; but for its foot, two cells above the floor."""
    frames = with_room([NONE] * 4 + [ball(1.2)] * 2 + [NONE])
    monkeypatch.setattr("meshreel.analysis.scene.places._FRAMES", 3)
    found = segment(MeshList(tuple(frames)))
    assert not found.chosen.any()  # nothing is known of it
    for number in (4, 5):
        moves = found.moving(number, frames[number])
        assert overlap(moves, of_body(frames[number])) > 0.75
        assert (moves & found.still_at_first(number, frames[number])).mean() < 0.01  # faces that are half and half
    assert not found.moving(1, frames[1]).any()


@pytest.mark.parametrize("body", [NONE, ball(1.2)], ids=["alone", "with a ball that lies"])
def test_a_still_room_with_noise_has_no_moving_places(body):
    frames = with_room([body] * 6)
    found = segment(MeshList(tuple(frames)))
    assert not found.chosen.any() and not found.moving(0, frames[0]).any()


def waving(mesh: Mesh, seed: int, height: float) -> Mesh:
    """The mesh with noise that is alike nearby, as that of a depth camera: edges stay as long as they are; m."""
    generator = np.random.default_rng(seed)
    waves, phases = generator.normal(size=(3, 4, 3)) * 6, generator.uniform(0, 2 * np.pi, (3, 4))
    noise = np.sin(np.einsum("vd,akd->vak", mesh.vertices, waves) + phases).sum(axis=2) / 2
    return Mesh(mesh.vertices + height * noise, mesh.faces)


@pytest.mark.parametrize(("height", "least"), [(0.8, 0.7), (1.3, 0.0)])
def test_noise_as_high_as_cells_does_not_make_a_room_move(height, least):
    """Cells are as wide as noise: with those of the edges' length 3 % and 91 % of the room would move here."""
    frames = [waving(mesh, seed, height * CELL) for seed, mesh in enumerate(ROLLING)]
    found = segment(MeshList(tuple(frames)))
    assert found.cell < 1.3 * CELL and found.noise > 2 * CELL
    assert min(overlaps(frames, found)) >= least
    for number, mesh in enumerate(frames):
        assert not (found.moving(number, mesh) & ~of_body(mesh)).mean() > 0.002


def test_a_standing_person_who_swings_the_arms_is_found_whole():
    frames = with_room([figure(0.5 * t) for t in range(6)])
    assert min(overlaps(frames, segment(MeshList(tuple(frames))))) > 0.9


def test_moving_surface_below_the_least_area_is_not_found():
    frames = with_room([ball(0.5 + 0.25 * t, radius=0.06) for t in range(6)])
    assert not segment(MeshList(tuple(frames))).chosen.any()


def test_a_ball_that_rests_for_half_of_the_time_is_found_there_too():
    frames = with_room([ball(0.5)] * 3 + [ball(0.5 + 0.3 * t) for t in range(1, 4)])
    assert min(overlaps(frames, segment(MeshList(tuple(frames))))) > 0.9


def test_empty_frames_are_passed_over_and_nothing_moves_where_there_is_nothing():
    frames = [ROLLING[0], NONE, *ROLLING[1:]]
    found = segment(MeshList(tuple(frames)))
    assert overlap(found.moving(0, ROLLING[0]), of_body(ROLLING[0])) > 0.9
    assert found.moving(1, NONE).shape == (0,)
    for empty in ([NONE], [NONE] * 3):
        assert not segment(MeshList(tuple(empty))).moving(0, ROLLING[0]).any()
    assert not segment(MeshList((ROLLING[0],))).chosen.any()  # one frame: nothing can be said to move


def test_edges_without_length_do_not_say_how_large_cells_are():
    flat = Mesh.of(np.zeros((3, 3)), [[0, 1, 2]])
    many = concatenate([*[flat] * 8000, room()])
    assert 0.05 < segment(MeshList((many,) * 3)).cell < 0.1
    assert not segment(MeshList((flat,) * 3)).moving(0, flat).any()


# a square of 8 x 8 cells of 1 cm, as two faces each
SHEET = plane(0.08, 8)
COLUMN = np.floor(SHEET.vertices[SHEET.faces].mean(axis=1) / 0.01).astype(int)


def area(mesh: Mesh, chosen: np.ndarray) -> dict[int, float]:
    """Area of the connected chosen pieces by their label."""
    label = components(mesh.faces[chosen], len(mesh.vertices))[mesh.faces[chosen][:, 0]]
    return {int(n): float(face_normals(mesh)[1][chosen][label == n].sum()) for n in np.unique(label)}


def test_an_island_takes_the_label_of_the_faces_around_it():
    spot = (COLUMN[:, 0] == 4) & (COLUMN[:, 1] == 4)
    assert not without_islands(SHEET, spot, 2e-4).any() and without_islands(SHEET, ~spot, 2e-4).all()
    assert np.array_equal(without_islands(SHEET, spot, 0.5e-4), spot)
    assert np.array_equal(without_islands(SHEET, ~spot, 0.5e-4), ~spot)


def test_a_piece_that_rests_alone_keeps_its_label_and_one_that_moves_alone_does_not():
    both = concatenate([SHEET, moved(SHEET, (1, 0, 0), 0.1)])
    large = np.arange(len(both.faces)) < len(SHEET.faces)
    assert np.array_equal(without_islands(both, large, 1e-3), large)
    assert not without_islands(both, ~large, 1e-3).any()


@settings(max_examples=40)
@given(st.lists(st.booleans(), min_size=128, max_size=128), st.floats(0, 1e-3))
def test_no_island_that_something_else_surrounds_is_left_of_those_that_move(bits, least):
    chosen = np.array(bits)
    clean = without_islands(SHEET, chosen, least)
    assert all(size >= least * (1 - 1e-9) for size in area(SHEET, clean).values())
    if clean.any():
        assert all(size >= least * (1 - 1e-9) for size in area(SHEET, ~clean).values())
    assert np.array_equal(without_islands(SHEET, clean, least), clean)  # and once is enough


def test_no_faces_have_no_labels():
    assert without_islands(NONE, np.zeros(0, bool), 1.0).shape == (0,)
    assert ByPlace(1.0, Lattice(np.zeros(3), 1.0), np.zeros(1, np.int64), np.ones(1, bool), Rest.none(1), 0.01).moving(
        0, NONE
    ).shape == (0,)


def test_labels_of_a_frame_are_found_once_and_only_the_last_are_kept(rolling, monkeypatch):
    asked, find = [], labelling.without_islands
    monkeypatch.setattr(labelling, "without_islands", lambda *given: asked.append(given) or find(*given))
    monkeypatch.setattr(labelling, "_REMEMBERED", 2)
    found = replace(rolling)  # which remembers nothing
    first = found.moving(0, ROLLING[0])
    assert first.any() and np.array_equal(found.moving(0, ROLLING[0]), first) and len(asked) == 1
    other = found.moving(0, ROLLING[5])  # another mesh is no answer known
    assert (
        len(other) == len(ROLLING[5].faces)
        and len(asked) == 2
        and np.array_equal(other, find(ROLLING[5], other, rolling.island))
    )
    found.moving(1, ROLLING[1])
    assert np.array_equal(found.moving(0, ROLLING[0]), first) and len(asked) == 4  # forgotten for the third


class Right(Masker):
    """A masker that calls what is at x > 1.2 m moving; it must see all frames first."""

    observes = True

    def __init__(self) -> None:
        self.observed: list[int] = []

    def observe(self, frame, seen, views):
        self.observed.append(frame)
        assert len(seen) == len(views)

    def masks(self, frame, seen, views):
        del views
        middle = ROLLING[frame].vertices[ROLLING[frame].faces].mean(axis=1)
        return np.stack([(one.faces >= 0) & (middle[one.faces][..., 0] > 1.2) for one in seen])


def test_masks_become_labels_and_unseen_faces_take_those_of_their_neighbours():
    masker = Right()
    found = segment_by(masker, MeshList(tuple(ROLLING[:2])))
    assert masker.observed == [0, 1]
    wanted = ROLLING[1].vertices[ROLLING[1].faces].mean(axis=1)[:, 0] > 1.2
    assert (found.moving(1, ROLLING[1]) == wanted).mean() > 0.97
