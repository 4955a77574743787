"""A recording fuses each frame once, keeps it while the disk has room, and gives its depth pictures."""

import shutil
import signal
import sys
import tempfile
from dataclasses import replace

import numpy as np
import pytest

from meshreel.capture.recording import FusionOptions, Kept, fuse_depths, open_recording
from meshreel.capture.simulated.demo_room import RoomOptions
from meshreel.errors import InputError
from meshreel.geometry.derived_sequences import captured, picked
from meshreel.geometry.topology import components, face_normals, without_fragments
from meshreel.types import Mesh
from tests.capture import depth_scenes
from tests.capture.depth_scenes import RADIUS, WALL, camera, measured, record_room
from tests.spheres import sliding_sphere

CAMERAS = [camera("left", -20), camera("right", 20)]
TRIANGLE = Mesh.of(np.array([[0, 0, 1 / 3], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])


@pytest.fixture
def recording(tmp_path):
    folder = depth_scenes.record(tmp_path / "rig", CAMERAS, [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)])
    return open_recording(folder)[0]


def test_a_frame_is_fused_once_and_is_the_same_again(recording, monkeypatch):
    first = recording[1]
    monkeypatch.setattr("meshreel.capture.recording.fuse_depths", None)
    again = recording[1]
    assert np.array_equal(first.vertices, again.vertices) and np.array_equal(first.faces, again.faces)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows deletes the file when it is closed")
def test_kept_meshes_are_in_a_file_without_a_name_that_no_killed_process_leaves(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    kept = Kept()
    kept.put(3, TRIANGLE)
    kept.put(4, Mesh.empty())
    again = kept.get(3)
    assert np.array_equal(again.vertices, TRIANGLE.vertices) and np.array_equal(again.faces, TRIANGLE.faces)
    assert kept.get(2) is None and kept.get(4).is_empty
    assert kept._file.fileno() and list(tmp_path.iterdir()) == []


def test_on_a_full_disk_frames_are_fused_again(recording, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("meshreel.capture.recording.tempfile.TemporaryFile", full)
    first, again = recording[0], recording[0]
    assert np.array_equal(first.vertices, again.vertices) and not recording._kept._places


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of a file's size")
def test_a_disk_that_fills_while_a_frame_is_kept_costs_no_kept_frame():
    import resource

    kept, most = Kept(), resource.getrlimit(resource.RLIMIT_FSIZE)
    kept.put(1, TRIANGLE)
    heeded = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, most[1]))
    try:
        kept.put(2, TRIANGLE)
        again = kept.get(1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, most)
        signal.signal(signal.SIGXFSZ, heeded)
    assert np.array_equal(again.vertices, TRIANGLE.vertices) and kept.get(2) is None


def test_without_keep_no_frame_is_stored(tmp_path, monkeypatch):
    folder = depth_scenes.record(tmp_path / "rig", CAMERAS, [(0.0, 0.0, 0.0)])
    monkeypatch.setattr("meshreel.capture.recording.Kept", None)
    assert not open_recording(folder, keep=False)[0][0].is_empty


def test_depth_pictures_are_given_per_camera_and_none_for_a_missing_one(tmp_path):
    folder = depth_scenes.record(tmp_path / "rig", CAMERAS, [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)])
    (folder / "right" / "depth" / "depth_00001.png").unlink()
    found, _ = open_recording(folder)
    assert captured(found) is found and picked(found, [1]).depth is not None
    both, one = found.depth[0], found.depth[1]
    assert [picture is not None for picture in both] == [True, True]
    assert one[0] is not None and one[1] is None
    assert np.array_equal(one[0].depth, found.rig.depth(0, 1)) and one[0].unit == CAMERAS[0].depth_unit
    shutil.rmtree(folder)


AROUND = [camera(f"at{side}", side) for side in (0, 90, 180, 270)]
FINE = FusionOptions(voxel=0.02)


def views(cameras, **scene):
    return [taken(one, measured(one, **scene)) for one in cameras]


def taken(camera, depth):
    return camera.picture(camera.in_range(depth))


def test_a_ball_seen_from_all_sides_is_a_closed_ball_of_its_size():
    mesh = fuse_depths(views(AROUND, wall=False), FINE)
    radii = np.linalg.norm(mesh.vertices, axis=1)
    assert abs(np.median(radii) - RADIUS) < 0.002 and np.abs(radii - RADIUS).max() < 1.5 * FINE.voxel
    assert len(np.unique(components(mesh.faces, len(mesh.vertices)))) == 1
    outward = (face_normals(mesh)[0] * mesh.vertices[mesh.faces[:, 0]]).sum(axis=1)
    assert (outward > 0).mean() > 0.99  # counter-clockwise from outside


def test_the_wall_is_at_its_place_with_the_shadow_of_the_ball():
    mesh = fuse_depths(views(AROUND[:1]), FINE)
    wall = mesh.vertices[mesh.vertices[:, 2] > 1]
    assert len(wall) and np.abs(wall[:, 2] - WALL).max() < 0.005
    assert np.linalg.norm(wall[:, :2], axis=1).min() > RADIUS  # nothing was seen behind the ball


def test_another_camera_carves_away_flying_pixels():
    depth = measured(AROUND[0])
    depth[44:52, 8:16] = 1500  # a piece that is not there, beside the ball
    beside, everything = camera("beside", 20), replace(FINE, fragment=0.0)
    flying = [taken(AROUND[0], depth)]
    alone = fuse_depths(flying, everything)
    both = fuse_depths([*flying, *views([beside])], everything)  # who sees the wall through it

    def piece(mesh):
        away = mesh.vertices[np.linalg.norm(mesh.vertices, axis=1) > RADIUS + 0.1]
        return int((away[:, 2] < 0).sum())

    assert piece(alone) > 100 and piece(both) == 0


def test_neither_the_order_of_cameras_nor_a_second_run_changes_the_mesh():
    first, again = fuse_depths(views(AROUND), FINE), fuse_depths(views(AROUND), FINE)
    assert np.array_equal(first.vertices, again.vertices) and np.array_equal(first.faces, again.faces)
    turned = fuse_depths(views(AROUND[::-1]), FINE)
    assert np.abs(turned.vertices - first.vertices).max() < 1e-4 and np.array_equal(turned.faces, first.faces)


def test_depths_out_of_range_or_missing_are_no_surface():
    near = camera(depth_range=(0.2, 2.5))
    mesh = fuse_depths(views([near]), FINE)
    assert mesh.vertices[:, 2].max() < 0.6  # the wall is 3.2 m away
    assert fuse_depths([taken(near, np.zeros((96, 96), np.uint16))], FINE).is_empty and fuse_depths([], FINE).is_empty


def test_fragments_are_dropped_by_their_area():
    [ball] = sliding_sphere(1, levels=2)
    crumb = Mesh(ball.vertices * 0.01 + 3, ball.faces)
    both = Mesh(
        np.concatenate([ball.vertices, crumb.vertices]), np.concatenate([ball.faces, ball.faces + len(ball.vertices)])
    )
    area = face_normals(crumb)[1].sum()
    assert len(without_fragments(both, 0.99 * area).faces) == 2 * len(ball.faces)
    kept = without_fragments(both, 1.01 * area)
    assert np.array_equal(kept.vertices, ball.vertices) and np.array_equal(kept.faces, ball.faces)
    assert without_fragments(Mesh.empty(), 1.0).is_empty


@pytest.mark.parametrize("wrong", [{"voxel": 0.0}, {"voxel": 2.0}, {"truncation": 0.5}, {"fragment": -1.0}])
def test_options_out_of_range_are_refused(wrong):
    with pytest.raises(InputError, match="give"):
        FusionOptions(**wrong)


@pytest.mark.parametrize("side", [-50.0, 50.0])
def test_a_slanted_wall_is_fused_at_its_place(side):
    slanted = camera(side=side, size=192)
    mesh = fuse_depths(views([slanted], ball=(0.0, 50.0, 0.0)), FusionOptions(voxel=0.02))
    seen = mesh.vertices[np.abs(mesh.vertices[:, :2]).max(axis=1) < 0.5]
    assert len(seen) > 500 and abs(np.median(seen[:, 2]) - WALL) < 1e-3  # half a pixel would be several mm


def test_frames_without_colors_are_the_same_but_for_them_whichever_is_read_first(tmp_path):
    record_room(tmp_path, RoomOptions(frames=2, seed=5))
    frames, other = (open_recording(tmp_path, FusionOptions(0.08))[0] for _ in range(2))
    bare = [frames.uncolored[0], frames[0], frames.uncolored[0], other[0], other.uncolored[0], other[0]]
    assert [mesh.is_colored for mesh in bare] == [False, True, False, True, False, True]
    assert all(np.array_equal(mesh.vertices, bare[0].vertices) for mesh in bare)
    assert np.array_equal(bare[1].colors, bare[5].colors)
