"""Poses in files of other programs are read as matrices from cameras to the world, and damage is named."""

import json
import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from meshreel.capture.calibration.poses import mean_pose, pose_for, read_poses
from meshreel.errors import InputError

TURNS = {"left": Rotation.from_rotvec([0.1, -0.5, 0.2]), "right": Rotation.from_rotvec([-0.3, 2.5, 0.4])}
PLACES = {"left": np.array([1.0, 2.0, -0.5]), "right": np.array([-1.5, 0.25, 3.0])}


def matrix(turn, shift):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn.as_matrix(), shift
    return pose


WANTED = {name: matrix(TURNS[name], PLACES[name]) for name in TURNS}  # camera to world
INSIDE = {name: (TURNS[name].inv(), -TURNS[name].inv().apply(PLACES[name])) for name in TURNS}  # world to camera


def row(numbers):
    return " ".join(f"{number:.17g}" for number in numbers)


def listed(numbers):
    return "[ " + ", ".join(f"{number:.17g}" for number in np.ravel(numbers)) + " ]"


def colmap_text(path):
    lines = ["# Image list with two lines of data per image:"]
    for number, (name, (turn, shift)) in enumerate(INSIDE.items()):
        lines += [
            f"{number} {row(np.roll(turn.as_quat(), 1))} {row(shift)} 1 {name}/00001.png",
            "" if number else "1.5 2.5 -1",
        ]
    path.write_text("\n".join(lines) + "\n")


def colmap_binary(path):
    data = struct.pack("<Q", len(INSIDE))
    for number, (name, (turn, shift)) in enumerate(INSIDE.items()):
        data += struct.pack("<I7dI", number, *np.roll(turn.as_quat(), 1), *shift, 1) + f"{name}.png".encode() + b"\0"
        data += struct.pack("<Q", 2) + bytes(48)
    path.write_bytes(data)


def caliscope(path):
    tables = [
        f"[cameras.{name}]\nignore = false\nrotation = {listed(turn.as_rotvec())}\ntranslation = {listed(shift)}"
        for name, (turn, shift) in INSIDE.items()
    ]
    path.write_text("\n".join([*tables, "[cameras.lost]", "ignore = true", ""]))


def anipose(path):
    tables = [
        f'[cam_{number}]\nname = "{name}"\nrotation = {turn.as_matrix().tolist()}\ntranslation = {listed(shift)}'
        for number, (name, (turn, shift)) in enumerate(INSIDE.items())
    ]
    path.write_text("\n".join([*tables, "[metadata]", "error = 0.3", ""]))


def opencv_matrix(name, numbers, rows):
    head = f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {np.size(numbers) // rows}"
    return f"{head}\n   dt: d\n   data: {listed(numbers)}"


def opencv(path):
    lines = ["%YAML:1.0", "---", 'names:\n   - "left"\n   - "right"']
    for name, (turn, shift) in INSIDE.items():
        lines += [opencv_matrix(f"R_{name}", turn.as_rotvec(), 3), opencv_matrix(f"T_{name}", shift, 3)]
    path.write_text("\n".join(lines) + "\n")


def opencv_lists(path):
    turns, shifts = ([inside[k] for inside in INSIDE.values()] for k in (0, 1))
    matrices = [opencv_matrix("rvecs", [turn.as_rotvec() for turn in turns], 2), opencv_matrix("Ts", shifts, 2)]
    path.write_text("\n".join(["%YAML:1.0", "---", *matrices, "cam_ids: left,right", ""]))


def transforms():
    middle = matrix(Rotation.from_rotvec([0, 0, 1]), [5, 0, 0])
    frames = {"world": ("rig", middle)} | {
        f"{n}_depth_optical_frame": ("rig", np.linalg.inv(middle) @ p) for n, p in WANTED.items()
    }
    found = []
    for frame, (parent, pose) in frames.items():
        above, below = ("world", "rig") if frame == "world" else (parent, frame)
        turn, shift = Rotation.from_matrix(pose[:3, :3]).as_quat(), pose[:3, 3]
        parts = {
            "translation": dict(zip("xyz", shift.tolist(), strict=True)),
            "rotation": dict(zip("xyzw", turn.tolist(), strict=True)),
        }
        found.append({"header": {"frame_id": above}, "child_frame_id": below, "transform": parts})
    return found


def tf_json(path):
    path.write_text(json.dumps({"transforms": transforms()}))


def tf_yaml(path):
    path.write_text("".join(f"transforms:\n- {json.dumps(one)}\n---\n" for one in transforms()))


def rig(path):
    path.write_text(
        json.dumps({"cameras": [{"name": name, "camera_to_world": pose.tolist()} for name, pose in WANTED.items()]})
    )


FORMS = {
    "images.txt": colmap_text,
    "images.bin": colmap_binary,
    "camera_array.toml": caliscope,
    "calibration.toml": anipose,
    "extri.yml": opencv,
    "multiview.yaml": opencv_lists,
    "tf_static.json": tf_json,
    "tf_static.yaml": tf_yaml,
    "rig.json": rig,
}


@pytest.mark.parametrize(("name", "write"), FORMS.items())
def test_each_form_gives_the_same_poses(tmp_path, name, write):
    if name.endswith(("yml", "yaml")):
        pytest.importorskip("yaml")
    write(tmp_path / name)
    found = read_poses(tmp_path / name)
    for camera, pose in WANTED.items():
        assert np.allclose(pose_for(camera, found, "depth"), pose, atol=1e-12)
    assert pose_for("third", found, "depth") is None


@pytest.mark.parametrize(("name", "write"), FORMS.items())
def test_a_damaged_file_raises_nothing_else(tmp_path, name, write):
    if name.endswith(("yml", "yaml")):
        pytest.importorskip("yaml")
    path = tmp_path / name
    write(path)
    whole = path.read_bytes()
    for size in range(0, len(whole), 37):
        path.write_bytes(whole[:size])
        try:
            found = read_poses(path)
        except InputError as error:
            assert str(path) in str(error)
        else:
            assert all(pose.shape == (4, 4) for pose in found.values())


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("poses.csv", "", "extension is of no file of poses; give COLMAP"),
        ("poses.json", '{"cameras": [{"name": "left"}]}', "'camera_to_world' is missing"),
        ("poses.json", '{"cameras": [{"name": "left", "camera_to_world": [[1]]}]}', "pose of left is not 4 x 4"),
        ("poses.json", "[]", "cannot be read"),
        ("poses.json", '{"cameras": [{"name": "left", "camera_to_world": 1' + 400 * "0" + "}]}", "cannot be read"),
        ("poses.toml", "[cameras.a]\nsize = [1, 2]", "has no poses of cameras"),
        ("images.txt", "1 2 3\n", "cannot be read"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, name, text, told):
    if name.endswith("yml"):
        pytest.importorskip("yaml")
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=told):
        read_poses(tmp_path / name)


def test_a_folder_is_that_of_colmap_and_frames_that_hang_on_themselves_are_refused(tmp_path):
    colmap_binary(tmp_path / "images.bin")
    assert set(read_poses(tmp_path)) == {"left", "right"}
    one, two = (
        entry | {"child_frame_id": to, "header": {"frame_id": of}}
        for entry, to, of in zip(transforms(), "ab", "ba", strict=False)
    )
    (tmp_path / "tf.json").write_text(json.dumps({"transforms": [one, two]}))
    with pytest.raises(InputError, match="hangs on itself"):
        read_poses(tmp_path / "tf.json")


def test_names_are_matched_to_the_end_of_a_word_by_kind_or_by_number():
    one, two = np.eye(4), 2 * np.eye(4)
    frames = {"cam_1_color_optical_frame": one, "cam_1_depth_optical_frame": two, "cam_10_depth_optical_frame": one}
    assert pose_for("cam_1", frames, "depth") is two and pose_for("cam_1", frames, "color") is one
    assert pose_for("corner1", {"0": one, "1": two}, "depth") is two
    with pytest.raises(InputError, match="several poses may be of camera cam: cam_a, cam_b"):
        pose_for("cam", {"cam_a": one, "cam_b": two}, "depth")


def test_the_mean_of_poses_leaves_out_those_that_are_far_off():
    random = np.random.default_rng(0)
    near = [matrix(Rotation.from_rotvec(0.01 * random.normal(size=3)), 0.01 * random.normal(size=3)) for _ in range(9)]
    mean = mean_pose([*near, matrix(Rotation.from_rotvec([2, 0, 0]), [1, 1, 1])])
    assert np.abs(mean - np.eye(4)).max() < 0.02 and np.allclose(mean[:3, :3] @ mean[:3, :3].T, np.eye(3))
