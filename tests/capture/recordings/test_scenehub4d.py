"""Folders of SceneHub4D, made as they are published: a rig with its poses, lenses and colours, or an error by name."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from meshreel.capture.recording import FusionOptions, open_recording
from meshreel.capture.recordings import open_take
from meshreel.errors import InputError
from meshreel.io.write import write_picture
from tests.capture.depth_scenes import RADIUS, camera, measured

SIDES, BENT = (0.0, 90.0, 180.0, 270.0), {"k1": 0.02, "k2": -0.01, "p1": 0.001, "p2": 0.0, "k3": 0.0}
CAMERAS = [camera(f"cam{number}", side) for number, side in enumerate(SIDES)]
LENS = {"fx": 96.0, "fy": 96.0, "cx": 47.5, "cy": 47.5}  # middles of pixels are whole numbers


def scene(folder: Path, calibration: dict[str, Any], frames: int = 3, name: str = "arena") -> Path:
    """A folder of a ball that slides, seen by four cameras."""
    for one in CAMERAS:
        own = folder / "rgbd" / one.name
        for number in range(7, 7 + frames):
            depth = measured(one, (0.05 * number, 0, 0), wall=False)
            color = np.full((96, 96, 3), 20 * number, np.uint8)
            for path, picture in (("trans_depth", depth), ("rgb", color)):
                (own / path).mkdir(parents=True, exist_ok=True)
                ending = "_depth.png" if path == "trans_depth" else ".png"
                write_picture(picture, own / path / f"{number}{ending}")
    (folder / "camera_pose" / "extrinsics").mkdir(parents=True)
    extrinsics = np.stack([one.view.extrinsic for one in CAMERAS])
    np.save(folder / "camera_pose" / "extrinsics" / f"extrinsics_{name}.npy", extrinsics)
    (folder / "intrinsics").mkdir()
    (folder / "intrinsics" / f"{name}_config.json").write_text(json.dumps(calibration))
    return folder


def of_each(own: dict[str, Any]) -> dict[str, Any]:
    return {"camera_config": {"fps": 30}, "device_calibration": {f"cam{number}": own for number in range(4)}}


def test_a_folder_becomes_a_rig_whose_cameras_see_one_ball(tmp_path, made):
    rig, remarks = made(scene(tmp_path / "arena", of_each(LENS)))
    assert remarks == [] and rig.frame_rate == 30 and len(rig.frames) == 3
    assert [one.name for one in rig.cameras] == [f"arena-cam{number}" for number in range(4)]
    for one, true in zip(rig.cameras, CAMERAS, strict=True):
        assert np.allclose(one.view.pose.to_world, true.view.pose.to_world)
        assert one.view.focal == (96.0, 96.0) and one.depth_unit == 0.001
    assert np.abs(rig.color_cameras[2].picture(rig.frames[1]).pixels.astype(int) - 160).max() <= 2
    recording, _ = open_recording(rig.folder, FusionOptions(0.03))
    for number, mesh in enumerate(recording):
        errors = np.linalg.norm(mesh.vertices - [0.05 * (7 + number), 0, 0], axis=1) - RADIUS
        assert np.abs(np.median(errors)) < 0.005


@pytest.mark.parametrize(
    ("calibration", "bends"),
    [
        ({"device_calibration": LENS}, ()),  # one for all
        ({"device_calibration": [LENS] * 4}, ()),
        (of_each(LENS | BENT), tuple(BENT.values())),
        (of_each({"color": LENS | {"distortion": list(BENT.values())}, "depth": LENS | {"fx": 9.0}}), "all"),
        (of_each({"color_camera": {"intrinsics": LENS, "distortion": BENT}}), "all"),
        (of_each({"rgb": {"intrinsics": LENS, "dist_coeffs": list(BENT.values())}}), "all"),
    ],
)
def test_the_calibration_is_found_where_it_lies(calibration, bends, tmp_path):
    sensors = open_take(scene(tmp_path / "arena", calibration, 1)).sensors
    wanted = tuple(BENT.values()) if bends == "all" else bends
    for sensor in sensors:
        lens = sensor.depth.lens
        assert lens is not None and lens.focal == (96.0, 96.0) and lens.center == (48.0, 48.0)
        assert tuple(lens.distortion)[: len(wanted)] == wanted and not any(lens.distortion[len(wanted) :])


def test_lenses_are_those_of_the_cameras_that_are_named(tmp_path):
    lenses = {f"cam{number}": LENS | {"fx": 90.0 + number} for number in (2, 0, 3, 1)}
    sensors = open_take(scene(tmp_path / "arena", {"device_calibration": lenses}, 1)).sensors
    assert [sensor.depth.lens.focal[0] for sensor in sensors] == [90.0, 91.0, 92.0, 93.0]


def test_the_rate_is_that_of_the_settings(tmp_path, made):
    rig, _ = made(scene(tmp_path / "arena", of_each(LENS) | {"camera_config": {"fps": 15}}))
    assert rig.frame_rate == 15


def test_calibration_may_lie_beside_the_scenes(tmp_path):
    folder = scene(tmp_path / "Sitting", of_each(LENS), 1, "sitting")
    for name in ("camera_pose", "intrinsics"):
        (folder / name).rename(tmp_path / name)
    np.save(tmp_path / "camera_pose" / "extrinsics" / "extrinsics_arena.npy", np.zeros((4, 4, 4)))
    (tmp_path / "intrinsics" / "arena_config.json").write_text("{}")
    assert len(open_take(folder).sensors) == 4


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda f: np.save(f / "camera_pose/extrinsics/extrinsics_arena.npy", np.eye(4)), r"array \(4, 4\).*4 cameras"),
        (lambda f: (f / "camera_pose/extrinsics/extrinsics_arena.npy").write_bytes(b"no"), "arena.npy: cannot be read"),
        (lambda f: (f / "camera_pose/extrinsics/extrinsics_arena.npy").unlink(), r"extrinsics: has no \*.npy"),
        (lambda f: np.save(f / "camera_pose/extrinsics/more.npy", np.eye(4)), None),  # the scene's name tells
        (lambda f: (f / "intrinsics/arena_config.json").write_text('{"a": {}}'), "has 0 cameras with fx, fy, cx, cy"),
        (lambda f: (f / "intrinsics/arena_config.json").write_text("[]"), "is not a JSON object"),
        (lambda f: np.save(f / "camera_pose/extrinsics/extrinsics_arena.npy", np.zeros((4, 4, 4))), "cam0 is no pose"),
        (lambda f: (f / "camera_pose/extrinsics/extrinsics_arena.npy").write_bytes(b"PK\x03\x04"), "cannot be read"),
        (
            lambda f: (f / "intrinsics/arena_config.json").write_text(
                json.dumps(of_each(LENS | {"distortion": [0.1] * 6}))
            ),
            "the distortion of cam0 has 6 numbers",
        ),
        (lambda f: (f / "rgbd/cam1/trans_depth/7_depth.png").rename(f / "rgbd/cam1/trans_depth/x.png"), "no PNG"),
        (lambda f: (f / "rgbd/cam1/trans_depth/7_depth.png").write_bytes(b"no"), "7_depth.png"),
    ],
)
def test_damage_is_named(damage, message, tmp_path):
    folder = scene(tmp_path / "arena", of_each(LENS), 1)
    damage(folder)
    if message is None:
        assert len(open_take(folder).sensors) == 4
        return
    with pytest.raises(InputError, match=message):
        open_take(folder)
