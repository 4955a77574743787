"""Rigs on disk: a written rig is read back, and errors name what is wrong."""

import json
import struct
import zlib
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from meshreel.capture.recording import open_recording
from meshreel.capture.rig.cameras import posed
from meshreel.capture.rig.rig import read_rig
from meshreel.errors import InputError
from meshreel.geometry.drawing import draw
from meshreel.io.pictures import read_depth
from meshreel.io.write import write_picture
from tests.capture.depth_scenes import camera, measured, record
from tests.spheres import sliding_sphere

STILL = [(0.0, 0.0, 0.0)] * 3


@pytest.fixture
def folder(tmp_path):
    return record(tmp_path / "rig", [camera(), camera("side", 90)], STILL)


def test_a_written_rig_is_read_back(folder):
    rig = read_rig(folder)
    assert rig.frames == [0, 1, 2] and rig.frame_rate == 15 and rig.missing() == []
    for found, wanted in zip(rig.cameras, (camera(), camera("side", 90)), strict=True):
        assert found.record() == wanted.record()
    for one, picture in zip(rig.cameras, rig.depth_pictures(1), strict=True):
        assert np.array_equal(picture.depth, one.in_range(measured(one)))


def turned(*rows):
    pose = np.eye(4)
    pose[:3, :3] = np.array(rows, dtype=np.float64).T  # right, down and forward of a camera, in the world
    return posed(camera(), pose)


@pytest.mark.parametrize(
    ("cameras", "up"),
    [
        ([camera(), camera("side", 90)], "-y"),  # world as the first camera has it
        ([turned([1, 0, 0], [0, -0.8, -0.6], [0, 0.6, -0.8])], "y"),
        ([turned([1, 0, 0], [0, 0, -1], [0, 1, 0])], "z"),
        ([turned([1, 0, 0], [0, 0, 1], [0, -1, 0])], "-z"),
        ([turned([0, 0, 1], [-1, 0, 0], [0, -1, 0])], "y"),  # on its side
    ],
)
def test_the_up_axis_is_the_one_that_points_up_in_the_pictures(tmp_path, cameras, up):
    named = [replace(each, name=str(number)) for number, each in enumerate(cameras)]
    assert read_rig(record(tmp_path / "rig", named, STILL)).up == up


def test_a_folder_with_one_camera_is_a_rig(tmp_path):
    (tmp_path / "depth").mkdir()
    entry = camera().record() | {"frames_per_second": 8}
    del entry["name"]
    (tmp_path / "camera.json").write_text(json.dumps(entry))
    write_picture(measured(camera()), tmp_path / "depth" / "take2_0639.png")
    rig = read_rig(tmp_path)
    assert rig.frames == [639] and rig.frame_rate == 8 and rig.cameras[0].name == tmp_path.name


def test_frames_that_one_camera_lacks_are_reported_and_fused_without_it(folder):
    (folder / "side" / "depth" / "depth_00001.png").unlink()
    rig = read_rig(folder)
    assert [[picture is None for picture in rig.depth_pictures(frame)] for frame in rig.frames] == [
        [False, False],
        [False, True],
        [False, False],
    ]
    assert rig.missing() == ["camera side lacks 1 of 3 frames, for example 1; they are fused without it"]


def changed(folder, change):
    path = folder / "rig.json"
    rig = json.loads(path.read_text())
    change(rig)
    path.write_text(json.dumps(rig))


def mirrored(rig):
    rig["cameras"][1]["camera_to_world"][0][0] = 7


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (mirrored, "camera side: camera_to_world is no rotation"),
        (lambda r: r["cameras"][0].update(camera_to_world=[[1, 0], [0, 1]]), r"camera front: .*\(2, 2\)"),
        (lambda r: r["cameras"][0]["camera_to_world"][0].__setitem__(3, float("nan")), "front.*not finite"),
        (lambda r: r["cameras"][0]["camera_to_world"][3].__setitem__(3, 2), "front.*0 0 0 1"),
        (lambda r: r["cameras"][0].pop("fx"), "camera number 0 .*fx"),
        (lambda r: r["cameras"][0].update(fx=0), "focal"),
        (lambda r: r["cameras"][0].update(width=4), "4 x 96"),
        (lambda r: r["cameras"][0].update(depth_unit_m=0), "depth unit 0"),
        (lambda r: r["cameras"][0].update(depth_min_m=9), "range 9 to 4"),
        (lambda r: r["cameras"][0].pop("camera_to_world"), "camera number 0 .*it has no camera_to_world"),
        (lambda r: r["cameras"][0].update(width="96"), "camera number 0 .*width is '96' and not a number"),
        (lambda r: r["cameras"][0].update(width=96.5), "pictures of 96.5 x 96"),
        (lambda r: r["cameras"][0].update(height=True), "height is True"),
        (lambda r: r["cameras"][0].update(width=10**400), "pictures of inf x 96"),
        (lambda r: r["cameras"][0].update(fx=0.6), r"camera front: focal \(0.6, 96\).* 96 x 96: give pixels"),
        (lambda r: r["cameras"][0].update(fx=1e300), "camera front: focal"),
        (lambda r: r["cameras"][0].update(cx=1e300), "camera front: focal .* center"),
        (lambda r: r["cameras"][0].update(name=None), "name is None; give text"),
        (lambda r: r["cameras"][0].update(depth=None), "depth is None; give text"),
        (lambda r: r["cameras"][0].update(color=["a"]), "color of camera front is"),
        (lambda r: r["cameras"][0].update(camera_to_world="x"), "camera_to_world is not 4 rows"),
        (lambda r: r["cameras"][0].update(camera_to_world=[[1], [0, 1], [0], [1]]), "camera_to_world is not 4 rows"),
        (lambda r: r["cameras"][0]["camera_to_world"][0].__setitem__(3, 1e6), r"front.*1e\+06 m from the world"),
        (lambda r: r["cameras"].__setitem__(0, 5), "camera number 0 .*is 5 and not an object"),
        (lambda r: r["cameras"][1].update(name="front"), "two cameras"),
        (lambda r: r["cameras"][1].update(depth="nowhere"), "nowhere"),
        (lambda r: r.update(cameras=[]), "no list"),
        (lambda r: r.update(frames_per_second=0), "frames_per_second"),
        (lambda r: r.update(frames_per_second=True), "frames_per_second is True"),
        (lambda r: r.update(frames_per_second=1e300), r"frames_per_second is 1e\+300; give"),
    ],
)
def test_a_rig_that_is_wrong_is_refused_with_the_reason(folder, change, words):
    changed(folder, change)
    with pytest.raises(InputError, match=words):
        read_rig(folder)


def test_unknown_keys_are_reported_with_a_suggestion(folder):
    changed(folder, lambda rig: rig["cameras"][1].update(depth_unit=0.01, serial="x"))
    _, warnings = open_recording(folder)
    assert warnings == [
        f"{folder}: unknown keys describe cameras and are ignored: depth_unit (is depth_unit_m meant?), serial"
    ]


def test_a_description_may_begin_with_a_byte_order_mark(folder):
    path = folder / "rig.json"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert len(read_rig(folder).cameras) == 2


def test_frames_that_no_camera_has_are_reported(folder):
    for name in ("front", "side"):
        for number in (3, 4, 6):
            write_picture(measured(camera()), folder / name / "depth" / f"depth_{number:05}.png")
    [missing] = read_rig(folder).missing()
    assert "1 frame is missing between the file names, the one between 4 and 6" in missing
    for name in ("front", "side"):
        for number in (1, 3):
            (folder / name / "depth" / f"depth_{number:05}.png").unlink()
    assert read_rig(folder).missing() == []  # every second number: another way to count


def test_a_folder_without_a_readable_rig_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"neither rig\.json nor camera\.json"):
        read_rig(tmp_path)
    (tmp_path / "rig.json").write_text("[1")
    with pytest.raises(InputError, match="cannot be read"):
        read_rig(tmp_path)
    (tmp_path / "rig.json").write_text("[1]")
    with pytest.raises(InputError, match="not a JSON object"):
        read_rig(tmp_path)


def test_colour_of_another_size_is_refused(folder):
    changed(folder, lambda rig: rig["cameras"][0].update(color="front/color"))
    with pytest.raises(InputError, match=r"front/color: color of camera front cannot be read"):
        read_rig(folder)
    (folder / "front" / "color").mkdir()
    with pytest.raises(InputError, match="camera front has no color pictures"):
        read_rig(folder)
    Image.new("RGB", (50, 40)).save(folder / "front" / "color" / "0.png")
    with pytest.raises(InputError, match="50 x 40 pixels where camera front has 96 x 96"):
        read_rig(folder)


def test_colour_cameras_are_read_beside_depth_and_alone(folder):
    (folder / "pictures").mkdir()
    for number in range(3):
        Image.new("RGB", (50, 40), (9, 8, 7)).save(folder / "pictures" / f"color_{number}.png")
    whole = json.loads((folder / "rig.json").read_text())["cameras"][0]
    size = {"folder": "pictures", "width": 50, "height": 40, "fx": 40, "fy": 40, "cx": 25, "cy": 20}
    alone = {key: whole[key] for key in ("camera_to_world",)} | size | {"name": "eye"}
    changed(folder, lambda rig: rig["cameras"][0].update(color=size | {"distortion": [0.1, 0, 0.01]}))
    changed(folder, lambda rig: rig.update(color_cameras=[alone]))
    rig = read_rig(folder)
    beside, other = rig.color_cameras
    assert (beside.name, other.name) == ("front", "eye") and rig.remarks == ()
    assert beside.view.distortion == (0.1, 0.0, 0.01, 0.0, 0.0) and not any(other.view.distortion)
    np.testing.assert_array_equal(beside.view.pose.to_world, rig.cameras[0].view.pose.to_world)
    picture = other.picture(0)
    assert picture.pixels[0, 0].tolist() == [9, 8, 7] and other.picture(3) is None
    np.testing.assert_array_equal(picture.camera.intrinsic, [[40, 0, 25.5], [0, 40, 20.5], [0, 0, 1]])


@pytest.mark.parametrize(
    ("numbers", "words"), [((0, 2), "2 color pictures for 3 frames .* has frame 1:"), ((0, 1, 2, 5), "4 .* frame 5:")]
)
def test_colour_with_other_frames_than_depth_is_refused(folder, numbers, words):
    (folder / "front" / "color").mkdir()
    for number in numbers:
        Image.new("RGB", (96, 96)).save(folder / "front" / "color" / f"{number}.png")
    changed(folder, lambda rig: rig["cameras"][0].update(color="front/color"))
    with pytest.raises(InputError, match=f"rig: camera front has {words}"):
        read_rig(folder)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"distortion": "none"}, "distortion is 'none'"),
        ({"distortion": [0] * 9}, "give up to eight numbers"),
        ({"distortion": [99]}, "give up to eight numbers"),
        ({"folder": 3}, "has no folder"),
        ({"fx": -1}, "focal"),
        ({"width": "wide"}, "width is 'wide' and not a number"),
    ],
)
def test_colour_cameras_that_are_wrong_are_refused(folder, change, words):
    (folder / "front" / "color").mkdir()
    Image.new("RGB", (96, 96)).save(folder / "front" / "color" / "0.png")
    changed(folder, lambda rig: rig["cameras"][0].update(color={"folder": "front/color"} | change))
    with pytest.raises(InputError, match=words):
        read_rig(folder)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("still.png", "no frame number"),
        ("depth_1.png", "'depth_1' and 'depth_00001' both have frame number 1|'depth_00001' and 'depth_1' both have"),
        ("x_00007.png", "names follow 2 patterns, as 'depth_00002' and 'x_00007'"),
    ],
)
def test_names_must_number_frames(folder, name, words):
    write_picture(measured(camera()), folder / "front" / "depth" / name)
    with pytest.raises(InputError, match=words):
        read_rig(folder)


def renamed(folder, names):
    """Rename the pictures of both cameras, in their order."""
    for name in ("front", "side"):
        pictures = sorted((folder / name / "depth").iterdir())
        for path, stem in zip(pictures, names, strict=True):
            path.rename(path.with_name(f"new_{stem}.png"))


@pytest.mark.parametrize(
    "names",
    [
        ("1305031102.933333", "1305031102.966667", "1305031103.000000"),  # seconds
        ("12-30-59_966", "12-31-00_000", "12-31-00_033"),  # a clock
        ("100_0", "133_0", "166_1"),  # milliseconds, and a count that starts anew
        ("9", "10", "11"),
    ],
)
def test_pictures_sort_by_all_numbers_in_their_names(folder, names):
    renamed(folder, names)
    rig = read_rig(folder)
    assert [rig.files[0][frame].stem for frame in rig.frames] == [f"new_{name}" for name in names]
    assert all(None not in rig.depth_pictures(frame) for frame in rig.frames) and rig.missing() == []


def test_a_camera_that_stopped_within_a_second_keeps_its_frames(folder):
    renamed(folder, ("7.50", "7.90", "8.30"))
    (folder / "side" / "depth" / "new_8.30.png").unlink()
    assert [[*files] for files in read_rig(folder).files] == [[0, 1, 2], [0, 1]]


def test_where_numbers_of_pictures_disagree_the_order_is_asked_for(folder):
    renamed(folder, ("1_300", "2_100", "5_200"))
    with pytest.raises(InputError, match=r"new_1_300, .*--order all.*new_2_100, .*--order last"):
        read_rig(folder)
    orders = {order: read_rig(folder, order) for order in ("all", "last", "name")}
    names = {order: [rig.files[1][frame].stem[4:] for frame in rig.frames] for order, rig in orders.items()}
    assert names["all"] == names["name"] == ["1_300", "2_100", "5_200"]
    assert names["last"] == ["2_100", "5_200", "1_300"]


def test_a_colour_of_another_time_is_refused(folder):
    renamed(folder, ("7.5", "7.6", "7.7"))
    for name in ("7.5", "7.6", "7.8"):
        (folder / "colors").mkdir(exist_ok=True)
        Image.new("RGB", (96, 96)).save(folder / "colors" / f"{name}.png")
    changed(folder, lambda rig: rig["cameras"][0].update(color="colors"))
    with pytest.raises(
        InputError,
        match=r"3 color pictures for 3 frames of depth; only one of both has frame 2: .*new_7\.7\.png stands alone",
    ):
        read_rig(folder)
    (folder / "colors" / "7.8.png").rename(folder / "colors" / "7.7.png")
    assert [path.stem for path in read_rig(folder).color_cameras[0].files.values()] == ["7.5", "7.6", "7.7"]


def test_a_camera_without_pictures_is_refused(folder):
    for path in (folder / "side" / "depth").iterdir():
        path.unlink()
    with pytest.raises(InputError, match="camera side has no depth pictures"):
        read_rig(folder)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda path: Image.new("L", (96, 96)).save(path), "8 bits a pixel; store depth as 16-bit"),
        (lambda path: Image.new("RGB", (96, 96)).save(path), "mode RGB"),
        (lambda path: path.write_bytes(b"no picture"), "is no picture"),
        (lambda path: path.write_bytes(path.read_bytes()[:-60]), "cannot be read"),
        (lambda path: write_picture(np.ones((8, 9), np.uint16), path), "9 x 8 pixels where camera front has 96 x 96"),
    ],
)
def test_pictures_that_hold_no_depth_are_refused(folder, made, words):
    made(folder / "front" / "depth" / "depth_00001.png")
    with pytest.raises(InputError, match=words):
        read_rig(folder).depth_pictures(1)


def bomb(path):
    """A picture of 60 000 x 60 000 pixels, by its head."""
    head = struct.pack(">IIBBBBB", 60_000, 60_000, 16, 0, 0, 0, 0)
    chunk = struct.pack(">I", len(head)) + b"IHDR" + head + struct.pack(">I", zlib.crc32(b"IHDR" + head))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk + path.read_bytes()[33:])


def test_a_picture_that_claims_an_enormous_size_is_refused(folder):
    bomb(folder / "front" / "depth" / "depth_00001.png")
    with pytest.raises(InputError, match="more than 8192 x 8192"):
        read_rig(folder).depth_pictures(1)


def test_depth_pictures_keep_every_bit(tmp_path):
    depth = np.arange(60_000, 60_000 + 99 * 7, dtype=np.uint16).reshape(99, 7)
    write_picture(depth, tmp_path / "1.png")
    assert np.array_equal(read_depth(tmp_path / "1.png"), depth)


def test_a_recording_gives_frames_and_reports_blind_cameras(folder):
    blank = np.zeros((96, 96), np.uint16)
    for number in range(3):
        write_picture(blank, folder / "side" / "depth" / f"depth_{number:05}.png")
    recording, warnings = open_recording(folder)
    assert warnings == ["camera side measures nothing in 3 of 3 frames looked at"]
    assert len(recording) == 3 and recording.frame_rate == 15 and not recording[2].is_empty
    assert len(list(recording)) == 3


def test_a_moving_camera_is_detected_in_its_depths(tmp_path):
    walking = [(0.3 * number - 1, 0.0, 0.0) for number in range(6)]
    recording, _ = open_recording(
        record(tmp_path / "still", [camera()], walking)
    )  # the ball moves, the camera does not
    assert len(recording) == 6
    moving = record(tmp_path / "moving", [camera()], walking)
    for number in range(6):
        write_picture(measured(camera(side=8.0 * number)), moving / "front" / "depth" / f"depth_{number:05}.png")
    with pytest.raises(InputError, match=r"camera front seems to move: .* say where it was in each frame"):
        open_recording(moving)


def test_the_view_of_a_camera_has_pixel_centers_at_halves():
    one = camera("side", 30.0)
    said = one.record()
    local = one.view.local(np.random.default_rng(0).uniform(-0.3, 0.3, (20, 3)))
    numbers = local[:, :2] / local[:, 2:] * [said["fx"], said["fy"]] + [said["cx"], said["cy"]]
    assert np.allclose(one.view.project(local), numbers + 0.5)
    assert np.allclose(one.view.eye, one.view.pose.to_world[:3, 3]) and (one.view.width, one.view.height) == (96, 96)
    depth = draw(sliding_sphere(1, levels=2)[0], one.view).depth
    assert np.isfinite(depth[47, 47]) and np.isinf(depth[0, 0])
