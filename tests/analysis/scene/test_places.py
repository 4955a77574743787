"""Places: cells that are occupied and cells that are seen free, in a room with a ball whose state is known."""

import tracemalloc
from dataclasses import dataclass, replace

import numpy as np
import pytest

from meshreel.analysis.scene import places as module
from meshreel.analysis.scene.cut import moving_places
from meshreel.analysis.scene.places import Observations, Places, find_places, inspected, states
from meshreel.analysis.scene.views import place_views
from meshreel.geometry.cameras import CameraPose
from meshreel.geometry.depth import DepthPicture
from meshreel.geometry.drawing import draw
from meshreel.geometry.voxels import Lattice
from meshreel.types import Frames, Mesh
from tests.metrics.shapes import moved, plane
from tests.scenes import CELL, RADIUS, ball, room, with_room

LATTICE = Lattice(np.zeros(3), CELL)
FROM, TO = 0.6, 1.6  # m, where the ball lies in the first half of the frames and in the second
FRAMES = with_room([ball(FROM)] * 2 + [ball(TO)] * 2)


VIEWS = (8, 96, 72)  # number and size, pixels


@pytest.fixture(scope="module")
def views():
    """Views that few samples of few frames place."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (("_PLACES", 4), ("_FRAMES", 2), ("_SAMPLES", 256)):
            patch.setattr(f"meshreel.analysis.scene.views.{name}", value)
        return place_views(FRAMES, "y", *VIEWS)


@dataclass(frozen=True)
class Seen:
    """What each frame says of each place."""

    occupied: np.ndarray
    free: np.ndarray


def each_frame(frames, views) -> Seen:
    found = find_places(Observations(frames, views), LATTICE)
    occupied, free = zip(*states(Observations(frames, views), range(len(frames)), found), strict=True)
    return Seen(np.stack(occupied), np.stack(free))


@pytest.fixture(scope="module")
def places(views) -> Places:
    return find_places(Observations(FRAMES, views), LATTICE)


@pytest.fixture(scope="module")
def seen(views) -> Seen:
    return each_frame(FRAMES, views)


def on_ball(places: Places, x: float) -> np.ndarray:
    """Places on a ball that lies there, well above the floor."""
    away = np.linalg.norm(places.middles - [x, 1.2, RADIUS + 0.5 * CELL], axis=1)
    return (np.abs(away - RADIUS) < 0.4 * CELL) & (places.middles[:, 2] > 3 * CELL)


def test_where_a_ball_was_it_is_free_before_and_after(places, seen):
    first, second = on_ball(places, FROM), on_ball(places, TO)
    assert first.sum() > 100
    assert seen.occupied[:2, first].mean() > 0.98 and seen.free[:2, first].mean() < 0.01
    assert seen.occupied[2:, first].mean() < 0.05 and seen.free[2:, first].mean() > 0.6  # the rest is hidden
    assert seen.occupied[2:, second].mean() > 0.98 and seen.free[:2, second].mean() > 0.6


def test_the_room_is_never_free(places, seen):
    of_room = (places.middles < 0.6 * CELL).any(axis=1) & ~seen.free.any(axis=0)
    assert (of_room.sum() / (places.middles < 0.6 * CELL).any(axis=1).sum()) > 0.97
    assert not (seen.occupied & seen.free).any()


def test_the_normal_of_a_place_is_that_of_its_surface(places):
    chosen = on_ball(places, FROM)
    outward = places.middles[chosen] - [FROM, 1.2, RADIUS + 0.5 * CELL]
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    assert np.median((places.normals[chosen] * outward).sum(axis=1)) > 0.95
    assert np.allclose(np.linalg.norm(places.normals, axis=1), 1, atol=1e-5)


def test_the_order_of_time_does_not_matter(places, views, seen):
    back = find_places(Observations(FRAMES[::-1], views), LATTICE)
    assert np.array_equal(back.keys, places.keys) and np.array_equal(back.beside, places.beside)
    rows = each_frame(FRAMES[::-1], views)
    assert np.array_equal(rows.free, seen.free[::-1]) and np.array_equal(rows.occupied, seen.occupied[::-1])
    assert np.array_equal(back.free_share, places.free_share)
    for one, other in ((back.tally.before, places.tally.after), (back.tally.after, places.tally.before)):
        assert np.array_equal(one.first, other.first) and (one.count == other.count)[one.first >= 0].all()
    np.testing.assert_allclose(back.normals, places.normals, atol=1e-4)
    assert np.array_equal(moving_places(back), moving_places(places))


def test_the_tally_counts_the_states_of_each_frame(places, seen):
    tally, rows = places.tally, np.arange(len(FRAMES))[:, None]
    assert tally.frames == len(FRAMES)
    assert np.array_equal(tally.free, seen.free.sum(axis=0)) and np.array_equal(
        tally.occupied, seen.occupied.sum(axis=0)
    )
    after = seen.occupied & (rows > np.where(seen.free, rows, -1).max(axis=0))
    stays = seen.free.any(axis=0) & after.any(axis=0)
    assert stays.sum() > 100 and np.array_equal(tally.after.first >= 0, stays)
    assert np.array_equal(tally.after.first[stays], np.argmax(after, axis=0)[stays])
    assert np.array_equal(tally.after.count[stays], after.sum(axis=0)[stays])


def test_places_do_not_depend_on_how_many_frames_are_in_memory_together(places, views, monkeypatch):
    monkeypatch.setattr(module, "_TOGETHER", 1)
    alone = find_places(Observations(FRAMES, views), LATTICE)
    for name in ("keys", "beside", "normals", "free_share"):
        assert getattr(alone, name).tobytes() == getattr(places, name).tobytes()
    for name in ("before", "after"):
        assert getattr(alone.tally, name).first.tobytes() == getattr(places.tally, name).first.tobytes()


def test_memory_does_not_grow_with_the_number_of_frames(views, monkeypatch):
    """Frames that are read when they are asked for, and more of them than are in memory together."""
    monkeypatch.setattr(module, "_TOGETHER", 8)

    def peak(count: int) -> int:
        tracemalloc.start()
        find_places(Observations(Again(count), views), LATTICE)
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    assert peak(72) < 1.02 * peak(24)


class Again(Frames):
    """Four frames again and again, each new when it is read."""

    def __init__(self, count: int) -> None:
        self._count = count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: int) -> Mesh:
        if index >= self._count:
            raise IndexError(index)
        mesh = FRAMES[index % len(FRAMES)]
        return Mesh(mesh.vertices.copy(), mesh.faces.copy())


@pytest.mark.parametrize(
    ("count", "rate", "least"), [(20, 30.0, 16), (60, 30.0, 16), (240, 30.0, 32), (900, 30.0, 120), (5, 0.1, 5)]
)
def test_some_frames_of_each_second_are_looked_at_however_long_a_recording_is(count, rate, least):
    numbers = inspected(count, rate)
    assert least <= len(numbers) <= least + 2 and numbers[0] == 0 and numbers[-1] == count - 1
    assert max(np.diff(numbers)) <= max(1, 0.25 * rate + 1)


def test_no_place_is_seen_free_through_the_back_of_a_face():
    """Whoever looks through an open side into a wall's back is inside of something that was not scanned."""
    wall = Mesh.of(room().vertices, room().faces[:, ::-1])
    frames = [wall, moved(wall, (0, 0, 0.3))]
    there = place_views([room()], "y", *VIEWS)
    assert not find_places(Observations(frames, there), LATTICE).tally.free.any()


TABLE = moved(plane(0.8, 14), (0.8, 0.8, 0.5))
WITH, WITHOUT = (with_room([body])[0] for body in (TABLE, Mesh.empty()))


def measured(mesh: Mesh, view, hidden: Mesh | None = None) -> DepthPicture:
    """What a camera measures of a mesh; nothing where another mesh would be in the way."""
    seen = draw(mesh, view)
    depth = np.where(seen.faces >= 0, seen.depth, 0.0)
    if hidden is not None:
        depth[draw(hidden, view).faces >= 0] = 0.0
    return DepthPicture(view, depth.astype(np.float32), 1.0, 10.0)


@pytest.mark.parametrize(("hidden", "free"), [(None, True), (TABLE, False)], ids=["taken away", "in a shadow"])
def test_a_place_that_no_camera_measured_past_is_not_seen_free(views, hidden, free):
    """A hole in a surface: something went, or somebody stands before it. The views look through it either way."""
    frames = [WITH, WITHOUT]
    pictures = [[measured(WITH, view) for view in views], [measured(WITHOUT, view, hidden) for view in views]]
    places, known = (find_places(Observations(frames, views, sees), LATTICE) for sees in (None, pictures.__getitem__))
    table = (np.abs(places.middles[:, 2] - 0.5) < CELL) & (np.abs(places.middles[:, :2] - 1.2) < 0.3).all(axis=1)
    assert table.sum() > 50 and (places.tally.free[table] == 1).mean() > 0.9
    share = (known.tally.free[table] == 1).mean()
    assert share > 0.9 if free else share == 0


def test_a_place_that_a_camera_measured_past_is_free_even_if_no_view_sees_it(views):
    """Somebody close to the camera: the views see surfaces from where these are seen best, and not what is before."""
    frames, away = [WITH, WITHOUT], [turned_away(view) for view in views]
    pictures = [[measured(mesh, views[0])] for mesh in frames]
    none, known = (find_places(Observations(frames, away, sees), LATTICE) for sees in (None, pictures.__getitem__))
    assert not none.tally.free.any()
    looked_past = known.tally.free > 0
    depth = (known.middles @ views[0].extrinsic[2, :3]) + views[0].extrinsic[2, 3]
    assert looked_past.sum() > 50 and (depth[looked_past] > 0).all()
    assert (np.abs(known.middles[looked_past][:, 2] - 0.5) < 1.5 * CELL).all()  # the table, and nothing else


def turned_away(view):
    """The same camera, looking back."""
    return replace(view, pose=CameraPose.of_world(np.diag([-1.0, 1, -1, 1]) @ view.extrinsic))


def test_where_no_camera_usually_measures_anything_views_decide(views):
    """In a window, beyond the range, or where all cameras lack the frames."""
    frames = [WITH, WITHOUT]
    alone = find_places(Observations(frames, views), LATTICE)
    blind = measured(WITHOUT, views[0])
    blind = DepthPicture(views[0], np.zeros_like(blind.depth), 1.0, 10.0)
    for pictures in ([blind], [None]):
        found = find_places(Observations(frames, views, lambda _, given=pictures: given), LATTICE)
        assert np.array_equal(found.tally.free, alone.tally.free)


def test_places_behind_which_rays_hit_nothing_are_not_seen_free(views):
    """Where nothing is met, a place is not known to be free."""
    alone = each_frame([ball(FROM), ball(TO)], views)
    assert alone.free.mean() < 0.2
