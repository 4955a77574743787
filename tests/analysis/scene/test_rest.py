"""Things at rest: a box carried across a room is background before, a body on the way, and background after."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Int64

from meshreel.analysis.scene import cut
from meshreel.analysis.scene.cut import NEVER, Rest, find_rest
from meshreel.analysis.scene.labelling import ByPlace
from meshreel.analysis.scene.places import Places, Tally
from meshreel.analysis.scene.segmentation import segment
from meshreel.analysis.scene.standing import Standing
from meshreel.analysis.scene.views import place_views
from meshreel.analysis.survey import survey_sequence
from meshreel.coding.background import decode_background, decode_change
from meshreel.encoder.scene.parts import Parts, take_apart
from meshreel.encoder.scene.static import encode_static
from meshreel.encoder.settings.options import SceneOptions
from meshreel.format.budget import CostlyError
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.derived_sequences import captured
from meshreel.geometry.topology import concatenate, subdivide_midpoint, weld
from meshreel.geometry.voxels import Lattice, neighbours, spread
from meshreel.types import Mesh, MeshList, Placement

FRAMES, LIFTED, PUT = 28, 9, 18  # at 4 frames a second


@pytest.fixture(autouse=True, scope="module")
def noisy() -> Iterator[None]:
    """Scenes without noise are taken apart otherwise, and know no changes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Standing, "same", 0.0)
        yield


def sheet(corner: tuple[float, ...], along: tuple[float, ...], across: tuple[float, ...], levels: int) -> Mesh:
    """A parallelogram of triangles."""
    a, b, c = (np.array(v, dtype=float) for v in (corner, along, across))
    square = Mesh.of([a, a + b, a + b + c, a + c], [(0, 1, 2), (0, 2, 3)])
    return subdivide_midpoint(square, levels)


def box(middle: tuple[float, float, float], size: float = 0.4) -> Mesh:
    """The five sides of a box that stands on the floor, seen from outside."""
    x, y, z = (value - size / 2 for value in middle)
    s = size
    sides = [
        sheet((x, y + s, z), (0, 0, s), (s, 0, 0), 3),
        sheet((x, y, z), (0, s, 0), (s, 0, 0), 3),
        sheet((x, y, z + s), (s, 0, 0), (0, s, 0), 3),
        sheet((x, y, z), (0, 0, s), (0, s, 0), 3),
        sheet((x + s, y, z), (0, s, 0), (0, 0, s), 3),
    ]
    return weld(concatenate(sides))


def frame(number: int) -> Mesh:
    floor = sheet((0, 0, 0), (0, 0, 2), (2.4, 0, 0), 6)
    wall = sheet((0, 0, 0), (2.4, 0, 0), (0, 1.4, 0), 6)
    share = np.clip((number - LIFTED) / (PUT - LIFTED), 0, 1)
    lifted = 0.4 * np.sin(np.pi * share)
    return concatenate([floor, wall, box((0.5 + 1.3 * share, 0.2 + lifted, 1.0))])


CAMERAS = place_views([frame(0), frame(FRAMES // 2), frame(FRAMES - 1)], "y", 8, 160, 120)
OPTIONS = SceneOptions(CAMERAS)


@pytest.fixture(scope="module", autouse=True)
def of_seconds() -> Iterator[None]:
    """Small areas count, and all frames are looked at: the scene has few."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("meshreel.analysis.scene.places._FRAMES", FRAMES)
        patch.setattr(cut, "_LEAST", 0.1)
        patch.setattr(cut, "_LEAST_CHANGE", 0.1)
        patch.setattr(cut, "_REST", 1.5)
        yield


@pytest.fixture(scope="module")
def scene() -> MeshList:
    return MeshList(tuple(frame(number) for number in range(FRAMES)), 4.0)


@pytest.fixture(scope="module")
def parts(scene: MeshList) -> Parts:
    return take_apart(captured(scene), survey_sequence(scene), OPTIONS)


@pytest.fixture(scope="module")
def found(scene: MeshList) -> ByPlace:
    return segment(scene, CAMERAS)


BOX = len(box((0, 0, 0)).vertices)
ROOM = 2 * 8192  # faces of floor and wall, which come first


def test_a_box_moves_only_while_it_is_carried(scene: MeshList, found: ByPlace) -> None:
    shares = [found.moving(number, scene[number])[ROOM:].mean() for number in range(FRAMES)]
    assert max(shares[: LIFTED - 1] + shares[PUT + 2 :]) < 0.08  # what touches the floor is never seen free
    assert min(shares[LIFTED + 2 : PUT - 1]) > 0.95
    assert all(found.moving(number, scene[number])[:ROOM].mean() < 0.05 for number in range(0, FRAMES, 5))


def test_without_enough_rest_it_moves_always(scene: MeshList, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cut, "_REST", 20.0)
    monkeypatch.setattr(cut, "_SHORT_REST", 20.0)
    found = segment(scene, CAMERAS)
    assert found.rest.changes == []
    assert found.moving(0, scene[0])[ROOM:].mean() > 0.9


def test_what_stands_still_as_a_thing_does_needs_no_long_rest(scene: MeshList, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cut, "_REST", 20.0)
    found = segment(scene, CAMERAS)
    assert len(found.rest.changes) == 2


def test_a_person_who_waves_is_not_at_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    """Most of a person who stands there and waves is as still as a thing."""
    monkeypatch.setattr(cut, "_REST", 20.0)

    def swaying(number: int) -> Mesh:
        mesh = frame(number)
        top = (np.arange(len(mesh.vertices)) >= len(frame(0).vertices) - BOX) & (mesh.vertices[:, 1] > 0.34)
        return replace(mesh, vertices=mesh.vertices + 0.01 * np.cos(2 * number) * top[:, None])

    scene = MeshList(tuple(swaying(number) for number in range(FRAMES)), 4.0)
    assert segment(scene, CAMERAS).rest.changes == []


def test_changes_are_two_of_the_frames(found: ByPlace) -> None:
    gone, came = found.rest.changes
    assert LIFTED - 1 <= gone <= LIFTED + 3
    assert PUT - 2 <= came <= PUT + 1
    assert (found.rest.since[~found.chosen] == NEVER).all()


def test_the_background_has_a_patch_for_each_change(parts: Parts) -> None:
    states = encode_static(parts, FRAMES, 4.0, OPTIONS)
    assert [state.is_patch for state in states] == [False, True, True]
    place, rooms = Placement(parts.survey.unit, tuple(parts.survey.center)), [decode_background(states[0].payload)]
    for state in states[1:]:
        rooms.append(decode_change(state.payload, rooms[-1]))
    first, between, last = (place.of(room) for room in rooms)
    here, there = (np.array([x, 0.4, 1.0]) for x in (0.5, 1.8))  # the middle of the box's lid
    assert distance_to(first, here) < 0.03 < 0.15 < distance_to(first, there)
    assert min(distance_to(between, here), distance_to(between, there)) > 0.15
    assert distance_to(last, there) < 0.03 < 0.15 < distance_to(last, here)
    assert max(distance_to(room, np.array([1.2, 0.0, 1.5])) for room in (first, between, last)) < 0.01


def test_a_change_that_costs_more_than_its_bytes_may_is_a_whole_background(parts: Parts, monkeypatch) -> None:
    def costly(payload: bytes, before: Mesh) -> Mesh:
        raise CostlyError(f"{len(payload)} bytes for {len(before.faces)} faces")

    monkeypatch.setattr("meshreel.encoder.scene.static.decode_change", costly)
    states = encode_static(parts, FRAMES, 4.0, OPTIONS)
    assert [state.is_patch for state in states] == [False, False, False]
    place = Placement(parts.survey.unit, tuple(parts.survey.center))
    here, there = (np.array([x, 0.4, 1.0]) for x in (0.5, 1.8))
    _, between, last = (place.of(decode_background(state.payload)) for state in states)
    assert min(distance_to(between, here), distance_to(between, there)) > 0.15
    assert distance_to(last, there) < 0.03 < 0.15 < distance_to(last, here)


def test_a_background_repeated_at_a_change_is_complete(parts: Parts, found: ByPlace) -> None:
    """A viewer who joins in between waits for the next whole background; patches after it refer to its faces."""
    gone, came = found.rest.changes
    states = encode_static(parts, FRAMES, 4.0, replace(OPTIONS, refresh=gone / 4.0))
    whole = {frame: frame % gone == 0 for frame in sorted({*range(0, FRAMES, gone), came})}
    assert {state.frame: not state.is_patch for state in states} == whole
    place, mesh = Placement(parts.survey.unit, tuple(parts.survey.center)), Mesh.empty()
    here, there = (np.array([x, 0.4, 1.0]) for x in (0.5, 1.8))
    for state in states:
        mesh = decode_change(state.payload, mesh) if state.is_patch else decode_background(state.payload)
        assert (distance_to(place.of(mesh), here) < 0.03) == (state.frame < gone)
        assert (distance_to(place.of(mesh), there) < 0.03) == (state.frame >= came)
        assert distance_to(place.of(mesh), np.array([1.2, 0.0, 1.5])) < 0.01


def test_surface_that_settles_without_a_background_is_a_whole_background(parts: Parts) -> None:
    states = encode_static(replace(parts, background=Mesh.empty()), FRAMES, 4.0, OPTIONS)
    came = parts.changes[-1].frame
    assert [(state.frame, state.is_patch) for state in states] == [(came, False)]
    assert not decode_background(states[0].payload).is_empty


def distance_to(mesh: Mesh, point: np.ndarray) -> float:
    return float(np.linalg.norm(Surface(mesh).closest(point[None]).points - point))


WALL, HIDDEN = (20, 20), 5  # places of a side of a crate; so many columns are hidden when it comes to rest


def stand(frames: int, seen_from: int, patch: slice) -> Places:
    """A side of a crate that comes to rest in frame 6; some columns are passed in frame 2 and seen late again."""
    lattice = Lattice(np.zeros(3), 0.02)
    keys = np.sort(lattice.keys((np.argwhere(np.ones((*WALL, 1))) + 0.5) * 0.02))
    column = lattice.cells(keys)[:, 0]
    late = (column >= WALL[0] - HIDDEN) & np.isin(lattice.cells(keys)[:, 1], np.arange(*patch.indices(WALL[1])))
    tally = Tally(len(keys))
    for number in range(frames):
        there = np.where(late, (number >= seen_from) | (number == 2), number >= 6)
        tally.add(there, np.full(len(keys), number < 2))
    return Places(lattice, keys, neighbours(keys), np.zeros((len(keys), 3)), tally)


def rests(places: Places, holds: bool) -> list[int]:
    every = np.ones(len(places.keys), bool)

    def stands(groups: list[Int64[np.ndarray, " C"]], _numbers: list[int], *_: float) -> list[bool]:
        return [holds or len(group) > 200 for group in groups]

    rest = find_rest(places, every, range(16), 4.0, stands)
    return np.bincount(np.minimum(rest.since, 99), minlength=100)[[7, 99]].tolist()


def test_a_side_that_is_seen_late_rests_with_what_it_belongs_to() -> None:
    all_of_it, small = WALL[0] * WALL[1], HIDDEN * 4
    assert rests(stand(16, 12, slice(0, 4)), holds=True) == [all_of_it, 0]
    assert rests(stand(16, 12, slice(0, 4)), holds=False) == [all_of_it - small, small]  # it moves: a person's hand
    assert rests(stand(16, 15, slice(0, 4)), holds=True) == [all_of_it - small, small]  # two frames tell nothing


@pytest.mark.parametrize(("away", "side", "moves"), [(0.04, 0.2, False), (0.04, 0.5, True), (0.3, 0.2, True)])
def test_a_small_bit_beside_what_has_come_to_rest_is_flicker(away: float, side: float, moves: bool) -> None:
    door = sheet((0, 0, 0), (1, 0, 0), (0, 1, 0), 5)
    bit = sheet((0.2, 0.2, away), (side, 0, 0), (0, side, 0), 3)
    both = concatenate([door, bit])
    lattice = Lattice(np.full(3, -1.0), 0.02)
    keys = np.unique(lattice.keys(spread(both, 0.01)[0]))
    own = np.isin(keys, lattice.keys(spread(door, 0.01)[0]))
    rest = replace(Rest.none(len(keys)), since=np.where(own, 5, NEVER).astype(np.int32))
    by = ByPlace(0.02, lattice, keys, np.ones(len(keys), bool), rest, 0.0)
    assert by.moving(4, both).all()
    assert not by.moving(5, both)[: len(door.faces)].any()
    assert (by.moving(5, both)[len(door.faces) :] == moves).all()
