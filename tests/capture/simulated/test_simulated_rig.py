"""Simulated rigs: exact depth without sensor errors, errors of the chosen size, and a truth with labels."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from meshreel.capture.recording import FusionOptions, fuse_depths
from meshreel.capture.rig.rig import read_rig
from meshreel.capture.simulated.simulated_rig import (
    LABELS,
    TRUTH,
    SceneFrame,
    SensorOptions,
    corner_cameras,
    read_truth,
    simulate_rig,
)
from meshreel.errors import InputError
from meshreel.geometry.closest_points import Surface, carried_labels
from meshreel.io.pictures import read_depth
from meshreel.io.sequence import open_sequence
from meshreel.io.write import write_mesh
from meshreel.types import Mesh
from tests.capture.depth_scenes import RADIUS, WALL, camera, measured
from tests.metrics.shapes import moved, plane, sphere
from tests.spheres import sliding_sphere

EXACT = SensorOptions(noise=0.0, grazing=90.0, holes=0.0, flying=0.0)
UNIT = sliding_sphere(1, levels=5)[0]
BALL = Mesh(UNIT.vertices / np.linalg.norm(UNIT.vertices, axis=1).max() * RADIUS, UNIT.faces)
PLATE = Mesh.of([[-9, -9, WALL], [9, -9, WALL], [9, 9, WALL], [-9, 9, WALL]], [[0, 2, 1], [0, 3, 2]])
SCENE = SceneFrame.of([PLATE], [BALL])


def seen(folder, sensor, cameras=(camera(),), frames=(SCENE,)):
    """The depths of the first camera in every frame."""
    simulate_rig(folder, frames, cameras, 30.0, sensor)
    rig = read_rig(folder)
    return np.stack([read_depth(rig.files[0][number]) for number in rig.frames])


def test_without_errors_depth_is_that_of_the_surface(tmp_path):
    [found] = seen(tmp_path, EXACT)
    wanted = camera().in_range(measured(camera()))
    apart = np.abs(found.astype(int) - wanted)
    assert (found > 0).all() and np.median(apart) <= 1
    assert np.percentile(apart, 97) <= 2  # mm; at the ball's rim a ray grazes it or not


def test_noise_has_the_chosen_size_and_grows_with_depth(tmp_path):
    still = SceneFrame.of([PLATE], [])
    exact = seen(tmp_path / "exact", EXACT, frames=[still])[0].astype(float)
    noisy = seen(tmp_path / "noisy", replace(EXACT, noise=1.0), frames=[still] * 8)
    errors = noisy.astype(float) - exact
    assert abs(errors.std() - 21) < 2 and abs(errors.mean()) < 3  # mm; the wall is 3.2 m away


def test_holes_flying_pixels_and_grazing_angles_are_simulated(tmp_path):
    [exact] = seen(tmp_path / "exact", EXACT)
    [holes] = seen(tmp_path / "holes", replace(EXACT, holes=0.1))
    assert abs((holes == 0).mean() - 0.1) < 0.02
    [flying] = seen(tmp_path / "flying", replace(EXACT, flying=1.0))
    between = (flying > 2100) & (flying < 3100)  # neither ball nor wall is there
    assert 50 < between.sum() < 400 and not ((exact > 2100) & (exact < 3100)).any()
    [grazing] = seen(tmp_path / "grazing", replace(EXACT, grazing=60.0))
    lost = (grazing == 0) & (exact < 2500)
    rows, columns = np.nonzero(lost)
    assert lost.sum() > 100 and np.hypot(rows - 47.5, columns - 47.5).min() > 12  # around the rim only


def test_the_same_seed_gives_the_same_pictures_and_frames_differ(tmp_path):
    sensor = SensorOptions(seed=3)
    first, again = (seen(tmp_path / name, sensor, frames=[SCENE] * 2) for name in ("a", "b"))
    other = seen(tmp_path / "c", SensorOptions(seed=4))
    assert np.array_equal(first, again) and (first[0] != first[1]).any() and (first[0] != other[0]).any()


def test_a_pose_error_is_in_the_rig_and_not_in_the_truth(tmp_path):
    wrong = replace(EXACT, pose_error=(0.01, 0.5))
    simulate_rig(tmp_path / "wrong", [SCENE], (camera(),), 30.0, wrong)
    [known] = read_rig(tmp_path / "wrong").cameras
    away = np.linalg.norm(known.view.pose.to_world[:3, 3] - camera().view.pose.to_world[:3, 3])
    assert 0.001 < away < 0.05 and (tmp_path / "wrong" / TRUTH / "rig.json").exists()


def test_the_truth_has_clean_meshes_and_labels_that_fused_faces_take(tmp_path):
    cameras = tuple(camera(f"at{side}", side) for side in (0, 30, 330))
    simulate_rig(tmp_path, [SCENE], cameras, 30.0, EXACT)
    [clean] = open_sequence(tmp_path / TRUTH)
    assert len(clean.faces) == len(SCENE.mesh.faces)
    with np.load(tmp_path / TRUTH / "dynamic.npz") as labels:
        found = np.unpackbits(labels["frame_00000"])[: len(SCENE.dynamic)].astype(bool)
    assert np.array_equal(found, SCENE.dynamic) and found.sum() == len(BALL.faces)
    fused = fuse_depths(read_rig(tmp_path).depth_pictures(0), FusionOptions())
    dynamic = carried_labels(Surface(SCENE.mesh), SCENE.dynamic, fused)
    middles = fused.vertices[fused.faces].mean(axis=1)
    assert np.array_equal(dynamic, np.linalg.norm(middles, axis=1) < RADIUS + 0.2) and 0 < dynamic.mean() < 1
    assert len(carried_labels(Surface(SCENE.mesh), SCENE.dynamic, Mesh.empty())) == 0


def test_cameras_in_the_corners_look_down_at_the_middle():
    low, high = np.array([-3.0, -1.0, -2.0]), np.array([3.0, 2.0, 2.0])
    cameras = corner_cameras(low, high)
    assert len({one.name for one in cameras}) == 4
    for one in cameras:
        eye, forward, down = one.view.pose.to_world[:3, 3], one.view.pose.to_world[:3, 2], one.view.pose.to_world[:3, 1]
        assert np.allclose(np.abs(eye - (low + high) / 2)[::2], ((high - low) / 2)[::2])
        assert forward[1] < 0 and down[1] < -0.5  # it looks down, and its y axis points down
        ahead = (one.view.extrinsic @ [*((low + high) / 2), 1])[:3]
        assert ahead[2] > 0 and np.abs(ahead[:2] / ahead[2]).max() < 0.3


@pytest.mark.parametrize(
    "wrong", [{"noise": -1.0}, {"grazing": 0.0}, {"holes": 1.5}, {"pose_error": (0.0, float("nan"))}]
)
def test_impossible_sensors_are_refused(wrong):
    with pytest.raises(InputError, match="give numbers from 0 on"):
        SensorOptions(**wrong)


FRAMES = [SceneFrame.of([moved(plane(4.0), (-2, -2, 1))], [sphere(0.3, 2 + number)]) for number in range(2)]
CAMERAS = (camera(size=16), camera("side", 30.0, 16))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rig")
    simulate_rig(folder, FRAMES, CAMERAS, 24.0)
    return folder / TRUTH


@pytest.fixture
def folder(written, tmp_path):
    """A copy that may be damaged."""
    return shutil.copytree(written, tmp_path / "truth")


def test_a_simulated_truth_is_read_back(written):
    truth = read_truth(written)
    assert len(truth) == 2 and truth.frame_rate == 24.0
    assert [one.name for one in truth.cameras] == ["front", "side"]
    for number, frame in enumerate(FRAMES):
        assert np.array_equal(truth[number].dynamic, frame.dynamic)
        assert np.allclose(truth[number].mesh.vertices, frame.mesh.vertices, atol=1e-6)
        assert np.array_equal(truth[number - 2].mesh.faces, frame.mesh.faces)
    with pytest.raises(IndexError):
        truth[2]


def test_a_missing_part_is_named(folder):
    (folder / "frame_00001.ply").unlink()
    with pytest.raises(InputError, match="1 clean meshes and labels of 2 frames, unlike in frame_00001"):
        read_truth(folder)
    (folder / "frame_00000.ply").unlink()
    with pytest.raises(InputError, match="no clean meshes"):
        read_truth(folder)
    (folder / "rig.json").unlink()
    with pytest.raises(InputError, match=r"rig\.json"):
        read_truth(folder)


@pytest.mark.parametrize("data", [b"", b"PK\x03\x04", b"no archive", None])
def test_unreadable_labels_are_refused(folder, data):
    (folder / LABELS).unlink()
    if data is not None:
        (folder / LABELS).write_bytes(data)
    with pytest.raises(InputError, match="labels cannot be read"):
        read_truth(folder)


def test_every_truncation_of_the_labels_is_refused(folder):
    whole = (folder / LABELS).read_bytes()
    for size in range(0, len(whole), 37):
        (folder / LABELS).write_bytes(whole[:size])
        with pytest.raises(InputError):
            read_truth(folder)


def test_labels_as_objects_are_not_unpickled(folder):
    np.savez(folder / LABELS, frame_00000=np.array([{}], object), frame_00001=np.zeros(3, np.uint8))
    with pytest.raises(InputError, match="labels cannot be read"):
        read_truth(folder)


@pytest.mark.parametrize("bits", [np.zeros(1, np.uint8), np.zeros(10_000, np.uint8), np.zeros(25, np.int64)])
def test_labels_of_another_mesh_are_refused_with_the_frame(folder, bits):
    np.savez(folder / LABELS, frame_00000=bits, frame_00001=np.packbits(FRAMES[1].dynamic))
    truth = read_truth(folder)
    assert truth[1].dynamic.sum() == FRAMES[1].dynamic.sum()
    with pytest.raises(InputError, match=r"frame_00000\.ply.*bit a face"):
        truth[0]


def test_a_damaged_clean_mesh_is_refused(folder):
    (folder / "frame_00000.ply").write_bytes(b"ply\n")
    with pytest.raises(InputError, match="frame_00000"):
        read_truth(folder)[0]


def test_an_empty_frame_may_be_read(folder):
    write_mesh(Mesh.empty(), folder / "frame_00000.ply")
    np.savez(folder / LABELS, frame_00000=np.zeros(0, np.uint8), frame_00001=np.packbits(FRAMES[1].dynamic))
    assert read_truth(folder)[0].mesh.is_empty
