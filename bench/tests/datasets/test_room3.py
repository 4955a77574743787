"""The scene of three people, a crate, a door and a box: its truth by part, and what is measured of parts."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from meshreel_bench.datasets.rooms import FRAMES, NAMES, PEOPLE, THINGS, Parts, Room3, moving_parts, thing_poses
from meshreel_bench.datasets.scenes import TRUE, open_scene
from meshreel_bench.measure.parts import missed, part_values

from meshreel.decoder.video import Video
from meshreel.geometry.closest_points import distances
from meshreel.geometry.topology import border_edges, concatenate
from meshreel.metrics.scene_accuracy import Scene, Sight
from meshreel.types import Mesh
from tests.capture.depth_scenes import camera
from tests.metrics.shapes import moved, plane, sphere


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Two frames, coarse."""
    cache = tmp_path_factory.mktemp("room3.cache")
    Room3(2, 0.05).record(cache / "room3-2" / "rig", width=160)
    return open_scene("room3", cache, cache, 2)


def test_the_story_is_told_by_the_truth():
    room = Room3(spacing=0.08)
    frames = {number: dict(zip(NAMES, room.parts(number), strict=True)) for number in (0, 23, 30, 59)}
    for parts in frames.values():
        assert not any(len(border_edges(parts[name])) for name in (*PEOPLE, *THINGS))
    gaps = [distances(parts["person 0"].vertices, parts["person 1"]).min() for parts in frames.values()]
    assert gaps[1] < 0.02 < 0.1 < min(gaps[0], gaps[3])
    sides = [np.subtract(*(parts[name].vertices[:, 0].mean() for name in PEOPLE[:2])) for parts in frames.values()]
    assert sides[0] < 0 < sides[3]  # they have passed each other
    heads = [parts["person 2"].vertices[:, 1].max() for parts in frames.values()]
    assert heads[2] < heads[0] - 0.35 and heads[3] > heads[0] - 0.05
    crates = [parts["crate"].vertices for parts in frames.values()]
    assert 0.8 < np.linalg.norm(crates[2] - crates[0], axis=1).max() < 1.0 and np.array_equal(crates[2], crates[3])
    assert frames[59]["box"].vertices[:, 1].min() == pytest.approx(0.72, abs=0.005)  # on the table


def test_each_face_has_its_part_and_things_move_rigidly(scene):
    parts, frames = scene.parts, [scene.truth[k] for k in (0, 1)]
    assert [len(parts.of_faces(k)) for k in (0, 1)] == [len(frame.mesh.faces) for frame in frames]
    for which, name in enumerate(THINGS):
        own = [frame.mesh.vertices[frame.mesh.faces[parts.of_faces(k) == 1 + which]] for k, frame in enumerate(frames)]
        first, second = ((own[k] - parts.poses[k, which, :3, 3]) @ parts.poses[k, which, :3, :3] for k in (0, 1))
        assert np.allclose(first, second, atol=1e-5), name
    moving = moving_parts(parts.poses)[0]
    assert moving.tolist() == [False, False, False, True, True, True, True]
    assert np.array_equal(frames[0].dynamic, moving[parts.of_faces(0)])


def test_of_a_thing_at_rest_no_label_is_judged_and_things_are_no_people(scene):
    judged, moving = scene.judged(0, TRUE), scene.labels(0)
    assert 0.9 * len(moving) < len(judged) < len(moving) and judged.sum() == moving.sum()
    assert 0 < scene.true(0).dynamic.sum() < scene.truth[0].dynamic.sum()  # without the box
    assert missed(scene.true(0), scene.meshes[0]) < 0.1 and missed(scene.true(0), Mesh.empty()) == 1.0


def test_crate_and_door_rest_for_a_second():
    moving = moving_parts(thing_poses())
    for name in THINGS[:2]:
        own = moving[:, NAMES.index(name)]
        assert own.sum() >= 20 and not own[FRAMES - 31 :].any()


class Decoded(Video):
    """A decoded file: a wall that has the ball from a frame on, and a track of the ball until then."""

    def __init__(self, frames, room_from):
        chunk = SimpleNamespace(track=0, first_frame=0, frame_count=6, size=700)
        self.reader = SimpleNamespace(groups=[chunk], frame_rate=10.0, frame_count=6)
        self.frames, self.room_from = frames, room_from
        self.tracks = [[self.moving(number) for number in range(6)]]

    def __getitem__(self, index):
        return concatenate(self.frames[index])

    def background(self, index):
        return concatenate(self.frames[index][: 1 + (index >= self.room_from)])

    def moving(self, index):
        return Mesh.empty() if index >= self.room_from else self.frames[index][1]


@pytest.mark.parametrize(("room_from", "after"), [(2, 0.0), (4, 0.2), (6, 0.4)])
def test_a_thing_is_room_from_when_the_background_has_it(room_from, after):
    back, sight = moved(plane(6.0, 4), (-3, -3, 0.8)), Sight(camera("front", 0, 64).view)
    wall = Mesh.of(back.vertices, back.faces[:, ::-1])
    frames = [(wall, moved(sphere(0.3, 3), (0.1 * min(number, 1), 0, 0))) for number in range(6)]
    poses, faces = np.tile(np.eye(4), (6, 3, 1, 1)), np.zeros((6, len(NAMES)), np.int64)
    poses[1:, 0, 0, 3], poses[5, 1:, 0, 3] = 0.1, 1.0
    faces[:, 0], faces[:, 1] = (len(part.faces) for part in frames[0])
    clean = [Scene(concatenate(parts), np.zeros(faces[0].sum(), bool), [sight], complete=True) for parts in frames]
    values = part_values(clean.__getitem__, Parts(faces, poses), Decoded(frames, room_from))
    assert values["crate_room_s"] == pytest.approx(after)
    assert values["crate_bytes"] == 700 and values["room_bytes"] == values["people_bytes"] == 0
    assert values["door_bytes_of_people"] is None and values["door_room_s"] == 0.0
