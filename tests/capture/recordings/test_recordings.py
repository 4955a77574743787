"""Recordings of every format become rigs whose depth, colour, times and poses are those that were written."""

import json
import os
import shutil
import sys
import types
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest

from meshreel.capture.recordings import is_rig, open_take, to_rig
from meshreel.capture.recordings.record3d import FLIP
from meshreel.errors import InputError
from meshreel.io.pictures import pack_picture
from meshreel.io.write import write_picture
from tests.capture.recordings import files
from tests.capture.recordings.files import COUNT, DEPTHS, SIZE, TIMES, Bag, jpeg, shade

PLACE = [0.1, 1.5, 0.2]  # of the camera in recordings with poses, m
NEAR = 3  # of 255, by which JPEG or a video changes a grey


def same(rig, rows=slice(None), unit=1.0):
    """Depth in mm and colours of each frame are the scene's."""
    assert rig.frames == list(range(COUNT)) and rig.frame_rate == files.RATE
    for frame in rig.frames:
        depth = rig.depth(0, frame) * rig.cameras[0].depth_unit * 1000 * unit
        assert np.abs(depth - DEPTHS[frame])[rows].max() < 1e-6
        if rig.color_cameras:
            picture = rig.color_cameras[0].picture(frame).pixels
            assert np.abs(picture.astype(int) - shade(frame)[0, 0]).max() <= NEAR
    return True


def test_a_tum_folder_has_depth_in_fifths_of_millimetres_and_its_pose(tmp_path, made):
    rig, remarks = made(files.tum(tmp_path / "desk"))
    assert same(rig) and remarks == [] and rig.cameras[0].name == "desk-camera"
    assert rig.cameras[0].view.pose.to_world[:3, 3].tolist() == PLACE
    assert np.allclose(rig.color_cameras[0].view.pose.to_world, rig.cameras[0].view.pose.to_world)


def test_a_tum_folder_may_have_associations_alone_in_either_order(tmp_path, made):
    folder = files.tum(tmp_path / "desk")
    rows = [f"{t} rgb/{n}.jpg {t + 0.01} depth/{n}.png" for n, t in enumerate(TIMES)]
    (folder / "associations.txt").write_text("\n".join(rows))
    (folder / "depth.txt").unlink()
    assert same(made(folder)[0])


def test_the_cameras_of_the_tum_benchmark_are_known_by_the_names_of_folders(tmp_path):
    folder = files.tum(tmp_path / "rgbd_dataset_freiburg1_xyz", numbers="")
    lens = open_take(folder).sensors[0].depth.lens
    assert lens.focal == (517.3, 516.5) and lens.distortion == (0.2624, -0.9531, -0.0054, 0.0026, 1.1633)


def test_a_stray_scanner_folder_has_a_larger_video_and_loses_uncertain_depth(tmp_path, made):
    pytest.importorskip("av")
    rig, remarks = made(files.stray(tmp_path / "scan"))
    assert same(rig, slice(1, None)) and remarks == [] and not rig.depth(0, 0)[0].any()
    color = rig.color_cameras[0]
    assert (color.view.width, color.view.focal[0], color.view.center[0]) == (2 * SIZE, 2 * SIZE, SIZE)
    assert rig.cameras[0].view.focal == (SIZE, SIZE) and np.allclose(rig.cameras[0].view.center, SIZE / 2)
    assert np.allclose(rig.cameras[0].view.pose.to_world, np.block([[np.eye(3), np.c_[PLACE]], [0, 0, 0, 1]]))


def test_the_export_of_record3d_turns_from_the_axes_of_the_phone(tmp_path, made):
    pytest.importorskip("OpenEXR")
    rig, _ = made(files.exr(tmp_path / "scan"))
    assert same(rig) and np.allclose(rig.cameras[0].view.pose.to_world[:3, :3], FLIP[:3, :3]) and rig.up == "y"


def test_an_r3d_is_read_with_lzfse_and_without_it_says_what_to_export(tmp_path, made, monkeypatch):
    path = tmp_path / "scan.r3d"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("metadata", json.dumps(files.record3d_metadata()))
        for number in range(COUNT):
            depth = (DEPTHS[number] / 1000).astype("<f4")
            archive.writestr(f"rgbd/{number}.jpg", jpeg(number))
            archive.writestr(f"rgbd/{number}.depth", zlib.compress(depth.tobytes()))
    monkeypatch.setitem(sys.modules, "liblzfse", types.SimpleNamespace(decompress=zlib.decompress))
    assert same(made(path)[0])
    monkeypatch.setitem(sys.modules, "liblzfse", None)
    assert open_take(path).sensors[0].depth.count == COUNT
    with pytest.raises(InputError, match=r"scan\.r3d: the depth .* by LZFSE.*as EXR \+ JPG, or pip install pyliblzfse"):
        made(path)


@pytest.mark.usefixtures("as_recorded")
def test_the_poses_of_record3d_have_the_times_of_its_pictures_and_more_of_them_do_not_count(tmp_path, made):
    pytest.importorskip("OpenEXR")
    folder = files.exr(tmp_path / "scan")
    about = files.record3d_metadata([*MOVED, MOVED[0]])
    (folder / "EXR_RGBD" / "metadata.json").write_text(json.dumps(about))
    assert np.allclose(paths(made(folder)[0])[0], [pose[4:] for pose in MOVED])


@pytest.mark.parametrize("form", ["bag", "sqlite3", "mcap"])
def test_bags_of_all_kinds_have_the_same_camera(tmp_path, made, form):
    pytest.importorskip("rosbags")
    path = tmp_path / ("room.bag" if form == "bag" else "room")
    with Bag(path, form) as bag:
        bag.info("/front/depth/camera_info")
        bag.info("/front/color/camera_info", (0.1, 0, 0, 0, 0))
        bag.still("base", "/optical", (0.1, 1.5, 0.2))
        bag.still("optical", "color", (0.05, 0, 0))
        bag.write("/chatter", "std_msgs/String", bag.of("std_msgs/String", "hello"))
        for number, time in enumerate(TIMES):
            bag.image("/front/depth/image_raw", DEPTHS[number], "16UC1", time)
            bag.image("/front/color/image_raw", shade(number)[..., ::-1], "bgr8", time + 0.01, "color")
            bag.image("/front/infra/image_raw", DEPTHS[number], "16UC1", time)
    rig, remarks = made(path)
    assert same(rig) and rig.cameras[0].name == "room-front-depth-image_raw"
    assert [remark.split(": ", 1)[1] for remark in remarks] == ["not read: /front/infra/image_raw (Image)"]
    assert np.allclose(rig.cameras[0].view.pose.to_world[:3, 3], PLACE)
    assert np.allclose(rig.color_cameras[0].view.pose.to_world[:3, 3], [0.15, 1.5, 0.2])
    assert rig.color_cameras[0].view.distortion == (0.1, 0, 0, 0, 0)
    assert open_take(path).others == (
        "/chatter (String)",
        "/front/color/camera_info (CameraInfo)",
        "/front/depth/camera_info (CameraInfo)",
        "/front/infra/image_raw (Image)",
        "/tf_static (TFMessage)",
    )
    if form != "bag":  # a file alone, without its metadata.yaml
        assert same(made(next(p for p in path.iterdir() if p.suffix in (".db3", ".mcap")))[0])


@pytest.mark.parametrize("known", [True, False])
def test_depth_that_was_moved_to_colour_stays_only_where_nothing_says_how_the_cameras_lie(tmp_path, known):
    pytest.importorskip("rosbags")
    with Bag(tmp_path / "room", "mcap") as bag:
        if known:
            bag.still("depth", "rgb", (0.05, 0, 0))
        for name, frame in (("depth", "depth"), ("depth_to_rgb", "rgb")):
            bag.image(f"/{name}/image_raw", DEPTHS[0], "16UC1", TIMES[0], frame)
        bag.image("/rgb/image_raw", shade(0), "rgb8", TIMES[0], "rgb")
        bag.image("/ir/image_raw", DEPTHS[0], "mono16", TIMES[0], "depth")
    (sensor,) = open_take(tmp_path / "room").sensors
    assert sensor.name == ("depth-image_raw" if known else "depth_to_rgb-image_raw")
    assert sensor.color is not None and sensor.color_to_depth[0, 3] == (0.05 if known else 0)


def test_compressed_pictures_of_a_bag_and_depth_in_metres(tmp_path, made):
    pytest.importorskip("rosbags")
    from meshreel.capture.recordings.rosbag import COMPRESSED

    with Bag(tmp_path / "room", "mcap") as bag:
        for name in ("a", "b", "c"):
            bag.info(f"/{name}/depth/camera_info")
        bag.info("/a/rgb/camera_info")
        for number, time in enumerate(TIMES):
            depth = DEPTHS[number]
            png = pack_picture(depth)
            bag.compressed(
                "/a/depth/image/compressedDepth", COMPRESSED.pack(0, 0, 0) + png, "16UC1; compressedDepth png", time
            )
            bag.compressed("/a/rgb/image/compressed", jpeg(number), "rgb8; jpeg compressed bgr8", time)
            bag.image("/b/depth/image", (depth / 1000).astype(np.float32), "32FC1", time)
            inverse = np.rint(40e6 / np.maximum(depth, 1000)).astype(np.uint16)
            bag.compressed(
                "/c/depth/image/compressedDepth",
                COMPRESSED.pack(0, 40e3, 0.0) + pack_picture(inverse),
                "32FC1; compressedDepth",
                time,
            )
    rig, remarks = made(tmp_path / "room")
    assert same(rig) and len(rig.cameras) == 3 and len(rig.color_cameras) == 1
    assert np.array_equal(rig.depth(1, 2), DEPTHS[2])
    assert np.abs(rig.depth(2, 2).astype(int) - DEPTHS[2]).max() <= 1
    assert any("3 cameras stand to each other is not known; meshreel calibrate finds it" in one for one in remarks)


def test_a_bag_of_realsense_says_its_unit_and_where_colour_is(tmp_path, made):
    pytest.importorskip("rosbags")
    deep, color = "/device_0/sensor_0/Depth_0", "/device_0/sensor_1/Color_0"
    with Bag(tmp_path / "scan.bag", "bag") as bag:
        bag.info(f"{deep}/info/camera_info", model="Brown Conrady")
        bag.info(f"{color}/info/camera_info", (0.1, 0, 0, 0, 0), model="Inverse Brown Conrady")
        bag.write("/device_0/sensor_0/option/Depth Units/value", "std_msgs/Float32", bag.of("std_msgs/Float32", 0.0005))
        bag.write(f"{deep}/tf/0", "geometry_msgs/Transform", bag.transform((0, 0, 0)))
        bag.write(f"{color}/tf/0", "geometry_msgs/Transform", bag.transform((0.015, 0, 0)))
        for number, time in enumerate(TIMES):
            bag.image(f"{deep}/image/data", DEPTHS[number] * 2, "mono16", time)
            bag.image(f"{color}/image/data", shade(number), "rgb8", time)
    rig, _ = made(tmp_path / "scan.bag")
    assert same(rig) and rig.cameras[0].depth_unit == pytest.approx(0.0005)
    assert rig.color_cameras[0].view.pose.to_world[0, 3] == pytest.approx(-0.015)


CALIBRATION = {"CalibrationInformation": {"Cameras": [
    {"Location": "CALIBRATION_CameraLocationD0", "MetricRadius": 1.74, "SensorWidth": 1024, "SensorHeight": 1024,
     "Rt": {"Rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "Translation": [0, 0, 0]},
     "Intrinsics": {"ModelParameters": [0.5, 0.51, 0.49, 0.492, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]}},
    {"Location": "CALIBRATION_CameraLocationPV0", "MetricRadius": 0, "SensorWidth": 4096, "SensorHeight": 3072,
     "Rt": {"Rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "Translation": [-0.032, -0.002, 0.004]},
     "Intrinsics": {"ModelParameters": [0.5, 0.51, 0.478, 0.637, 0.58, -2.49, 1.36, 0.5, -2.3, 1.3, 0, 0, 2e-4, 1e-4]}},
]}}  # fmt: skip


def test_an_azure_kinect_file_has_the_lens_of_its_mode(tmp_path, made):
    pytest.importorskip("av")
    rig, remarks = made(files.mkv(tmp_path / "room.mkv", CALIBRATION))
    depth, color = rig.cameras[0], rig.color_cameras[0]
    assert remarks == [] and rig.frames == list(range(COUNT)) and (rig.depth(0, 2) == 1002).all()
    assert np.allclose(depth.view.focal, (0.49 * 1024, 0.492 * 1024))
    assert np.allclose(depth.view.center, (0.5 * 1024 - 192, 0.51 * 1024 - 180))
    assert np.allclose(color.view.center, (0.5 * 1280, 0.51 * 960 - 120))
    assert np.allclose(color.view.focal, (0.478 * 1280, 0.637 * 960))
    assert color.view.distortion == (0.58, -2.49, 1e-4, 2e-4, 1.36, 0.5, -2.3, 1.3)
    assert np.allclose(color.view.pose.to_world[:3, 3], (0.032, 0.002, -0.004))
    assert np.abs(color.picture(3).pixels.astype(int) - 100).max() <= NEAR


def test_bent_depth_is_straightened_without_new_depths(tmp_path, made):
    """A wall seen through a lens that bends: each pixel that is left has a depth of the picture, in its place."""
    folder = files.tum(tmp_path / "desk", numbers="96 96 47.5 47.5 0.2 0 0 0 0")
    rig, _ = made(folder)
    depth = rig.depth(0, 0)
    assert set(np.unique(depth)) <= {0, *np.unique(DEPTHS[0].astype(np.uint16) * 5)}
    x = (70 - 47.5) / 96
    assert depth[48, 70] == 5 * DEPTHS[0][48, round(47.5 + 96 * x * (1 + 0.2 * (x * x + (0.5 / 96) ** 2)))]
    assert rig.color_cameras[0].view.distortion == (0.2, 0, 0, 0, 0)


def test_pictures_are_paired_within_half_a_frame_and_lost_ones_are_told(tmp_path, made):
    late = [TIMES[0] + 0.04, TIMES[1] - 0.04, TIMES[2] + 0.06, TIMES[3]]
    rig, remarks = made(files.tum(tmp_path / "desk", color_times=late))
    assert rig.frames == [0, 1, 2, 3] and len(remarks) == 1
    text = "1 of 4 frames have no colour within half a frame (50 ms), and keep the last one; the first is frame 2"
    assert text in remarks[0]
    pictures = [rig.color_cameras[0].files[frame].read_bytes() for frame in range(4)]
    assert pictures[2] == pictures[1] and pictures[3] != pictures[2]


def test_a_dropped_frame_leaves_a_gap_and_times_that_go_back_are_sorted(tmp_path, made):
    gap = [TIMES[0], TIMES[1], TIMES[2], TIMES[3] + 0.1]
    rig, _ = made(files.tum(tmp_path / "gap", gap, gap))
    assert (
        rig.frames == [0, 1, 2, 4]
        and "1 frame is missing between the file names, the one between 2 and 4" in rig.missing()[0]
    )
    back = [TIMES[0], TIMES[2], TIMES[1], TIMES[3]]
    rig, remarks = made(files.tum(tmp_path / "back", back, TIMES))
    assert "depth of camera: time stamps go back 1 times" in remarks[0]
    assert np.array_equal(rig.depth(0, 1), DEPTHS[2] * 5)


def test_several_recordings_are_cameras_of_one_rig(tmp_path, made):
    first, second = (
        files.tum(tmp_path / "a" / "desk"),
        files.tum(tmp_path / "b" / "desk", [t + 900 for t in TIMES], [t + 900 for t in TIMES]),
    )
    rig, remarks = made(first, second)
    assert [one.name for one in rig.cameras] == ["desk-camera", "desk-camera-2"] and rig.frames == list(range(COUNT))
    assert "both begin together now" in remarks[0] and "meshreel calibrate finds it" in remarks[-1]


MOVED = [[*files.STILL[:4], 0.1 + 0.1 * n, 1.5, 0.2] for n in range(COUNT)]


def paths(rig):
    """The places of a rig's depth and colour camera, frame by frame."""
    return [
        [one.path[frame].to_world[:3, 3].tolist() for frame in rig.frames] for one in (*rig.cameras, *rig.color_cameras)
    ]


@pytest.fixture
def as_recorded(monkeypatch):
    """Poses stay as they were recorded: the pictures of these files are of a camera that stands still."""
    monkeypatch.setattr(to_rig, "refine_paths", lambda _: [])


@pytest.mark.usefixtures("as_recorded")
def test_a_camera_that_moves_by_its_own_poses_has_one_in_each_frame(tmp_path, made):
    rig, remarks = made(files.tum(tmp_path / "desk", poses=MOVED))
    assert same(rig) and remarks == [] and np.allclose(paths(rig), [[pose[4:] for pose in MOVED]] * 2)
    turned = [[np.sin(n / 20), 0, 0, np.cos(n / 20), *PLACE] for n in range(COUNT)]
    rig, _ = made(files.tum(tmp_path / "chair", poses=turned))
    assert (
        paths(rig) == [[PLACE] * COUNT] * 2
        and np.ptp([rig.cameras[0].path[k].to_world[1, 2] for k in rig.frames]) > 0.2
    )


@pytest.mark.usefixtures("as_recorded")
def test_a_picture_between_two_poses_is_taken_between_them(tmp_path, made):
    late = [time + 0.04 for time in TIMES]
    rig, _ = made(files.tum(tmp_path / "desk", TIMES, late, poses=MOVED))
    depth, color = paths(rig)
    assert np.allclose(np.subtract(color, depth)[:-1], [0.04, 0, 0]) and color[-1] == depth[-1]


@pytest.mark.usefixtures("as_recorded")
def test_frames_without_a_pose_near_them_are_left_out_and_told(tmp_path, made):
    folder = files.tum(tmp_path / "desk", poses=MOVED)
    rows = (folder / "groundtruth.txt").read_text().splitlines()
    (folder / "groundtruth.txt").write_text("\n".join([*rows[:2], f"{TIMES[2] + 99} 9 9 9 0 0 0 1"]))
    late = [TIMES[0], TIMES[1], TIMES[1] + 0.5, TIMES[1] + 0.6]
    (folder / "depth.txt").write_text("\n".join(f"{time} depth/{n}.png" for n, time in enumerate(late)))
    (folder / "rgb.txt").write_text("\n".join(f"{time} rgb/{n}.jpg" for n, time in enumerate(late)))
    rig, remarks = made(folder)
    assert rig.frames == [0, 1] and any(
        "2 of 4 frames are left out: no pose of camera is known then" in r for r in remarks
    )


@pytest.mark.usefixtures("as_recorded")
def test_stray_scanner_and_record3d_move_with_their_phone(tmp_path, made):
    pytest.importorskip("av")
    rig, _ = made(files.stray(tmp_path / "scan", poses=MOVED))
    assert same(rig, slice(1, None)) and np.allclose(paths(rig)[0], [pose[4:] for pose in MOVED])


@pytest.mark.usefixtures("as_recorded")
@pytest.mark.parametrize("form", ["bag", "mcap"])
def test_a_camera_on_a_robot_moves_by_its_bags_tf(tmp_path, made, form):
    pytest.importorskip("rosbags")
    with Bag(tmp_path / f"robot.{form}" if form == "bag" else tmp_path / "robot", form) as bag:
        bag.info("/camera/depth/camera_info")
        bag.still("base", "optical", (0.0, 1.0, 0.0))
        bag.still("map", "odom", (0.0, 0.0, 5.0))
        for number, time in enumerate([*TIMES, TIMES[-1] + 0.1]):
            bag.move("odom", "base", (0.1 * number, 0.0, 0.0), time)
        for number, time in enumerate(TIMES):
            bag.image("/camera/depth/image", DEPTHS[number], "16UC1", time + 0.05)
    rig, _ = made(bag.path)
    assert same(rig) and np.allclose(paths(rig)[0], [[0.1 * n + 0.05, 1.0, 5.0] for n in range(COUNT)])


def seven_scenes(folder, lost=()):
    folder.mkdir()
    for number in range(COUNT):
        name = f"frame-{3 * number:06}"
        depth = DEPTHS[number].copy()
        depth[0] = 65535  # none
        write_picture(depth, folder / f"{name}.depth.png")
        (folder / f"{name}.color.jpg").write_bytes(jpeg(number))
        pose = np.full((4, 4), np.nan) if number in lost else np.eye(4)
        pose[0, 3] += 0.1 * number
        (folder / f"{name}.pose.txt").write_text("\n".join(" ".join(f"{x:.9f}" for x in row) for row in pose))
    (folder / "camera-intrinsics.txt").write_text("\n".join(" ".join(map(str, row)) for row in files.MATRIX))
    return folder


@pytest.mark.usefixtures("as_recorded")
def test_a_folder_of_7_scenes_has_a_pose_a_frame_and_nothing_at_its_mark_for_none(tmp_path, made):
    rig, remarks = made(seven_scenes(tmp_path / "chess"))
    assert same(rig, slice(1, None)) and remarks == [] and not rig.depth(0, 0)[0].any()
    assert np.allclose(paths(rig), [[[0.1 * n, 0, 0] for n in range(COUNT)]] * 2)
    rig, _ = made(seven_scenes(tmp_path / "fire", lost=[1]))  # the poses around it are near in time
    assert np.allclose(paths(rig)[0][1], [0.1, 0, 0])
    (tmp_path / "chess" / "frame-000000.pose.txt").write_text("1 2 3")
    with pytest.raises(InputError, match=r"frame-000000\.pose\.txt: has 3 numbers; give 4 rows of 4"):
        made(tmp_path / "chess")


def nerfstudio(folder, **changed):
    (folder / "images").mkdir(parents=True)
    frames = []
    for number in range(COUNT):
        write_picture(DEPTHS[number], folder / f"depth-{number}.png")
        (folder / "images" / f"{number}.jpg").write_bytes(jpeg(number))
        pose = np.diag([1.0, -1.0, -1.0, 1.0])  # OpenGL's axes
        pose[0, 3] = 0.1 * number
        names = {"file_path": f"images/{number}.jpg", "depth_file_path": f"depth-{number}.png"}
        frames.append(names | {"transform_matrix": pose.tolist()})
    about = {"fl_x": SIZE, "fl_y": SIZE, "cx": SIZE / 2, "cy": SIZE / 2, "w": SIZE, "h": SIZE, "fps": files.RATE}
    about |= {"frames": frames[::-1], "integer_depth_scale": 0.001} | changed
    (folder / "transforms.json").write_text(json.dumps({key: about[key] for key in about if about[key] is not None}))
    return folder


@pytest.mark.usefixtures("as_recorded")
def test_a_nerfstudio_folder_has_opengls_axes_and_frames_in_any_order(tmp_path, made):
    rig, remarks = made(nerfstudio(tmp_path / "scan"))
    assert same(rig) and remarks == [] and rig.cameras[0].view.center == (SIZE / 2, SIZE / 2)
    assert np.allclose(paths(rig), [[[0.1 * n, 0, 0] for n in range(COUNT)]] * 2)
    assert np.allclose(rig.cameras[0].path[2].to_world[:3, :3], np.eye(3))


@pytest.mark.usefixtures("as_recorded")
def test_lenses_of_nerfstudio_frames_may_differ_by_what_autofocus_does_and_no_more(tmp_path, made):
    folder = nerfstudio(tmp_path / "scan")
    about = json.loads((folder / "transforms.json").read_text())
    for number, frame in enumerate(about["frames"]):
        frame |= {"fl_x": SIZE * (1 + 0.002 * number), "cx": SIZE / 2 + 0.1 * number}
    (folder / "transforms.json").write_text(json.dumps(about))
    assert same(made(folder)[0])
    about["frames"][0]["fl_x"] = 2 * SIZE
    (folder / "transforms.json").write_text(json.dumps(about))
    with pytest.raises(InputError, match=r"fl_x of transforms\.json is 192 in images/3\.jpg and .* of each lens alone"):
        made(folder)


@pytest.mark.usefixtures("as_recorded")
def test_a_nerfstudio_folder_without_its_colours_has_depth(tmp_path, made):
    folder = nerfstudio(tmp_path / "scan")
    shutil.rmtree(folder / "images")
    rig, _ = made(folder)
    assert rig.frames == list(range(COUNT)) and not rig.color_cameras


def test_poses_of_another_clock_are_refused_and_few_are_told(tmp_path, made):
    folder = files.tum(tmp_path / "desk", poses=MOVED)
    rows = (folder / "groundtruth.txt").read_text().splitlines()
    (folder / "groundtruth.txt").write_text(rows[0])
    remarks = made(folder)[1]
    assert "only 2 of 4 depth pictures have a pose of camera near them; by these it stands still" in remarks[0]
    folder = files.tum(tmp_path / "chair", poses=MOVED)
    shifted = [" ".join([str(float(row.split()[0]) + 3600), *row.split()[1:]]) for row in rows]
    (folder / "groundtruth.txt").write_text("\n".join(shifted))
    with pytest.raises(InputError, match="chair: no pose of camera is of the time of a picture; do the clocks"):
        made(folder)


@pytest.mark.usefixtures("as_recorded")
def test_links_of_tf_that_are_said_seldom_hold_between(tmp_path, made):
    pytest.importorskip("rosbags")
    with Bag(tmp_path / "robot.bag", "bag") as bag:
        bag.info("/camera/depth/camera_info")
        bag.move("map", "odom", (0.0, 0.0, 5.0), TIMES[0] - 30)  # once
        for number in range(8):
            bag.move("odom", "optical", (0.1 * number, 0.0, 0.0), TIMES[0] + 0.05 * number)
        for number, time in enumerate(TIMES):
            bag.image("/camera/depth/image", DEPTHS[number], "16UC1", time)
    assert np.allclose(paths(made(bag.path)[0])[0], [[0.2 * n, 0, 5.0] for n in range(COUNT)])


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"frames": [{"file_path": "a.jpg"}]}, r"no frame of transforms\.json has a depth_file_path"),
        ({"frames": [{"file_path": 3, "depth_file_path": "a.png"}]}, r"frame 0 of .*: file_path is 3 and no text"),
        ({"frames": [{"file_path": "a", "depth_file_path": "b"}]}, "transform_matrix of a is None; give 4 rows"),
        ({"fl_x": [1]}, r"fl_x of transforms\.json is \[1\] in images/0\.jpg; give a number"),
        ({"fps": 0}, r"fps of transforms\.json is 0: give a number above 0"),
        ({"w": 0}, r"pictures of 0 x 96: give w and h"),
        ({"camera_model": "OPENCV_FISHEYE"}, "the camera_model OPENCV_FISHEYE"),
        ({"fl_x": None}, "write fl_x fl_y cx cy w h into"),
        ({"frames": 3}, "no list `frames` of objects"),
    ],
)
def test_a_nerfstudio_folder_that_cannot_be_read_is_told_by_what_it_lacks(tmp_path, made, changed, told):
    with pytest.raises(InputError, match=told):
        made(nerfstudio(tmp_path / "scan", **changed))


def test_what_is_written_as_docs_and_other_tools_have_it_is_read(tmp_path, made):
    """Titles and commas in calibration.txt, and names in any encoding."""
    folder = files.tum(tmp_path / "desk", numbers="# fx fy cx cy\n96, 96, 47.5, 47.5")
    name = os.fsdecode(b"\xff.png")
    (folder / "depth" / "0.png").rename(folder / "depth" / name)
    text = (folder / "depth.txt").read_bytes()
    (folder / "depth.txt").write_bytes(text.replace(b"0.png", b"\xff.png"))
    assert same(made(folder)[0])


def test_a_folder_without_rights_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(_path: Path) -> bool:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "is_file", refused)
    with pytest.raises(InputError, match=f"{tmp_path.name}: cannot be read .Permission denied.; check its rights"):
        is_rig(tmp_path)
