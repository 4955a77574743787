"""Scenes: captured once, labels, anchors, and what is measured of people, background and parts, on small ones."""

import json
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from meshreel_bench.codecs import make_codec
from meshreel_bench.datasets import NAMES as STORED
from meshreel_bench.datasets import Dataset, Store
from meshreel_bench.datasets import scenes as module
from meshreel_bench.datasets.rooms import FRAMES as ROOM3_FRAMES
from meshreel_bench.datasets.rooms import (
    NAMES,
    PEOPLE,
    SENSED,
    SETTINGS,
    THINGS,
    Parts,
    Room3,
    Setting,
    moving_parts,
    thing_poses,
)
from meshreel_bench.datasets.scenes import TRUE, Captured, SceneFrames, open_scene
from meshreel_bench.measure.metrics import Measured, _flicker, measure_frames, missed, part_values
from meshreel_bench.measure.point import measure_point
from meshreel_bench.report.values import value
from meshreel_bench.rows import Point

from meshreel.capture.recording import open_recording
from meshreel.capture.simulated.procedural import soft_bodies
from meshreel.capture.simulated.sensors import SENSORS, SensorOptions
from meshreel.capture.simulated.simulated_rig import SceneFrame, corner_cameras, simulate_rig
from meshreel.decoder.video import Video
from meshreel.errors import InputError
from meshreel.geometry.closest_points import Surface, distances
from meshreel.geometry.topology import border_edges, concatenate
from meshreel.metrics.scene_accuracy import Scene, Sight, compare_with_truth
from meshreel.types import Mesh, MeshList
from tests.capture.depth_scenes import camera
from tests.metrics.shapes import moved, plane, sphere

BACK = moved(plane(6.0, 4), (-3, -3, 0.8))
PLATE = Mesh.of(BACK.vertices, BACK.faces[:, ::-1])  # faces the cameras
FRAMES = [SceneFrame.of([PLATE], [moved(sphere(0.3, 3), (0.1 * n - 0.15, 0, 0))]) for n in range(4)]
QUIET = SensorOptions(noise=0.1, holes=0.0, flying=0.0)


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A folder in which the scene `room2-4` is a ball that slides before a plate."""
    folder = tmp_path_factory.mktemp("scenes.cache")
    cameras = tuple(camera(f"at{side}", side, 128) for side in (0, 40, 320))
    simulate_rig(folder / "room2-4" / "rig", FRAMES, cameras, 30.0, QUIET)
    return folder


@pytest.fixture(scope="module")
def scene(cache):
    return open_scene("room2", cache, cache, 4)


def test_a_scene_is_captured_once_and_kept(scene, cache):
    assert len(scene.meshes) == len(scene.truth) == 4 and scene.meshes.frame_rate == 30.0
    first = scene.folder / "meshes" / "frame_00000.ply"
    made = first.stat().st_mtime_ns
    again = open_scene("room2", cache, cache, 4)
    assert first.stat().st_mtime_ns == made and np.array_equal(again.meshes[0].faces, scene.meshes[0].faces)


def test_labels_are_those_of_the_nearest_clean_faces(scene):
    labels = [scene.labels(number) for number in range(4)]
    middles = scene.meshes[3].vertices[scene.meshes[3].faces].mean(axis=1)
    assert np.array_equal(labels[3], middles[:, 2] < 0.5) and labels[3].any()
    assert np.array_equal(scene.labels(3), labels[3])  # as kept


def test_labels_that_another_encoder_has_found_are_not_taken_for_this_ones(scene, monkeypatch):
    """Rows of a changed segmenter would have the numbers of the old one."""
    calls = []

    class Found:
        def moving(self, _, mesh):
            return np.full(len(mesh.faces), len(calls) == 2)

    monkeypatch.setattr(module, "segment", lambda meshes: calls.append(len(meshes)) or Found())
    module._kept_as.cache_clear()
    assert not scene.labels(0, "found").any() and not scene.labels(1, "found").any() and calls == [4]
    monkeypatch.setattr(module, "segmenter", module.geometry)  # a segmenter of other code
    module._kept_as.cache_clear()
    assert scene.labels(0, "found").all() and calls == [4, 4]
    monkeypatch.undo()
    module._kept_as.cache_clear()
    for path in (scene.folder / "labels").glob("found*"):
        path.unlink()


def test_the_background_is_what_stands_also_behind_what_moves(scene):
    still = scene.background()
    assert abs(np.median(still.vertices[:, 2]) - 0.8) < 0.003 and (still.vertices[:, 2] > 0.5).all()
    behind = moved(plane(0.6, 20), (-0.3, -0.3, 0.8)).vertices
    assert np.linalg.norm(Surface(still).closest(behind).points - behind, axis=1).max() < 0.01


@pytest.mark.parametrize(
    ("name", "options"),
    [("scene_draco", {"share": 0.3}), ("scene_draco", {"share": 0.3, "levels": 1}), ("background_draco", {})],
)
def test_an_anchor_decodes_to_the_scene(scene, name, options):
    codec = make_codec(name, options)
    data = codec.encode(SceneFrames(scene, (0, 2)))
    decoded = codec.decode(data)
    assert len(decoded) == 2
    row = compare_with_truth(SceneFrames(scene, (0, 2)), decoded, lambda k: scene.true(2 * k), [0, 1])
    assert row["decoded"]["people_median_m"] < 0.005 and row["decoded"]["background_median_m"] < 0.005
    assert row["decoded"]["covered"] > 0.9 and row["decoded"]["people_covered"] > 0.9
    if not options.get("levels"):  # decimation denoises
        assert row["noise_floor"]["normal_error_deg"] > row["decoded"]["normal_error_deg"]
    json.dumps(row, allow_nan=False)


def test_people_and_background_are_measured_against_the_truth_and_the_input(cache):
    store = Store(cache, cache)
    floor = measure_point(Point("room2", "captured", {}, 4, metrics="regions"), store)
    assert floor.name == "the truth itself" and floor.stream is None and floor.measured_frames == [0, 1, 2, 3]
    assert 0 < floor.metrics["truth_people_median_m"] < 0.01 and "input_people_median_m" not in floor.metrics
    point = Point("room2", "background_draco", {"share": 0.5}, 4, sampled=True, metrics="regions")
    row = measure_point(point, store)
    assert 0 < row.stream.background_bytes < row.stream.bytes and row.stream.coded_frames == 4
    moving = (row.stream.bytes - row.stream.background_bytes) * 8 * 30 / 4
    assert value(row, "mbps_background_10s") == pytest.approx((moving + row.stream.background_bytes * 0.8) / 1e6)
    for name in ("truth_people_median_m", "input_background_median_m", "truth_covered"):
        assert row.metrics[name] > 0
    assert not any(name.startswith("seam") for name in row.metrics)  # its stream has one frame more: the background


def test_the_truth_is_measured_beside_the_input_where_pictures_are_from_the_cameras(cache):
    row = measure_point(Point("room2", "draco", {"qp": 8}, 4, metrics="distances"), Store(cache, cache))
    assert row.measured_frames == [0, 2] and row.metrics["d2_psnr_paper"] > 40
    assert row.metrics["truth_people_median_m"] > 0 and "bridges" not in row.metrics


def test_the_input_flickers_as_the_input_and_the_truth_not_at_all(scene):
    assert _flicker(scene, [0, 1, 2], scene.meshes)["people_flicker_of_input"] == 1
    assert _flicker(scene, [0, 1, 2], MeshList(tuple(frame.mesh for frame in FRAMES)))["people_flicker_of_input"] < 0.1


def test_a_recording_is_judged_by_its_depth_pictures_in_all_frames(scene):
    recording, _ = open_recording(scene.folder / "rig")
    known = Dataset(Captured(recording, scene.folder / "meshes"))
    row, _ = measure_frames(Measured(known, range(4), [frame.mesh for frame in FRAMES]), "depth")
    assert row["all_covered"] > 0.95 and row["all_invented"] < 0.01 and row["frames_judged"] == 4
    assert row["body_flicker_deg"] < row["input_body_flicker_deg"] and "per_frame" not in row
    with pytest.raises(InputError, match="only recordings have depth pictures"):
        measure_frames(Measured(Dataset(soft_bodies()), [0], [soft_bodies()[0]]), "depth")


def test_labels_that_the_encoder_finds_are_judged_by_the_true_ones(cache, monkeypatch):
    monkeypatch.setattr(module.SceneData, "labels", lambda *_: np.arange(4) < 2)
    row = measure_point(Point("room2", "segmentation", {"labels": "found"}, 4, metrics="regions"), Store(cache, cache))
    assert row.metrics == {"iou_mean": 1.0, "iou_worst": 1.0, "static_called_dynamic": 0.0}


def test_a_body_has_no_truth_and_no_regions(tmp_path):
    store = Store(tmp_path)
    for codec, metrics in (("captured", "views"), ("segmentation", "regions"), ("draco", "regions")):
        with pytest.raises(InputError, match="simulated scenes"):
            measure_point(Point("demo", codec, {}, 1, metrics=metrics), store)


@pytest.fixture(scope="module")
def room3(tmp_path_factory):
    """Two frames, coarse."""
    cache = tmp_path_factory.mktemp("room3.cache")
    Room3(2, 0.05, Setting(partial(corner_cameras, width=160))).record(cache / "room3-2" / "rig")
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


def test_each_face_has_its_part_and_things_move_rigidly(room3):
    parts, frames = room3.parts, [room3.truth[k] for k in (0, 1)]
    assert [len(parts.of_faces(k)) for k in (0, 1)] == [len(frame.mesh.faces) for frame in frames]
    for which, name in enumerate(THINGS):
        own = [frame.mesh.vertices[frame.mesh.faces[parts.of_faces(k) == 1 + which]] for k, frame in enumerate(frames)]
        first, second = ((own[k] - parts.poses[k, which, :3, 3]) @ parts.poses[k, which, :3, :3] for k in (0, 1))
        assert np.allclose(first, second, atol=1e-5), name
    moving = moving_parts(parts.poses)[0]
    assert moving.tolist() == [False, False, False, True, True, True, True]
    assert np.array_equal(frames[0].dynamic, moving[parts.of_faces(0)])


def test_of_a_thing_at_rest_no_label_is_judged_and_things_are_no_people(room3):
    judged, moving = room3.judged(0, TRUE), room3.labels(0)
    assert 0.9 * len(moving) < len(judged) < len(moving) and judged.sum() == moving.sum()
    assert 0 < room3.true(0).dynamic.sum() < room3.truth[0].dynamic.sum()  # without the box
    assert missed(room3.true(0), room3.meshes[0]) < 0.1 and missed(room3.true(0), Mesh.empty()) == 1.0


def test_crate_and_door_rest_for_a_second():
    moving = moving_parts(thing_poses())
    for name in THINGS[:2]:
        own = moving[:, NAMES.index(name)]
        assert own.sum() >= 20 and not own[ROOM3_FRAMES - 31 :].any()


class Decoded(Video):
    """A decoded file: a wall that has the ball from a frame on, and a track of the ball until then."""

    tracks = ()  # in place of the property

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


def test_at_twice_the_rate_every_second_frame_is_the_same_moment():
    slow, fast = Room3(14, 0.08), Room3(27, 0.08, SETTINGS["d435-corners"])
    parts = [room.parts(number) for room, number in ((slow, 12), (fast, 24), (fast, 25), (slow, 13))]
    for name, one, same in zip(NAMES, *parts[:2], strict=True):
        assert name in PEOPLE or np.array_equal(one.vertices, same.vertices)  # people have a grid each frame
        boxes = [np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)]) for mesh in (one, same)]
        assert np.allclose(*boxes, atol=0.05)
    before, between, after = (frame[NAMES.index("crate")].vertices for frame in (parts[0], *parts[2:]))
    assert np.allclose(between, (before + after) / 2) and (before != after).any()


def test_there_are_seven_settings_of_sensors_in_three_rooms():
    assert len(SENSED) == 21 and {setting.rate for setting in SETTINGS.values()} == {5.0, 15.0, 30.0, 60.0}
    assert {setting.errors for setting in SETTINGS.values()} == {errors for _, errors in SENSORS.values()}
    assert set(SENSED) <= set(STORED)


def test_a_room_is_recorded_by_a_sensor(tmp_path):
    name = "sensors/iphone_lidar-corners/procedural_room"
    known = Store(tmp_path, tmp_path).open(name, 1)
    assert known.sequence.frame_rate == 60.0 and known.cameras[0].width == 256
    row = measure_point(Point(name, "captured", {}, 1, metrics="regions"), Store(tmp_path, tmp_path))
    assert row.metrics["truth_people_median_m"] < 0.02 and row.metrics["truth_people_covered"] > 0.5
