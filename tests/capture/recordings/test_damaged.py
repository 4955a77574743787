"""Recordings that are damaged, incomplete or not what they seem end with an error that names them, or are told of."""

import re

import numpy as np
import pytest

from meshreel.capture.recordings import is_take, open_take, readers
from meshreel.errors import InputError
from meshreel.io.pictures import pack_picture
from tests.capture.recordings import files
from tests.capture.recordings.files import DEPTHS, TIMES, Bag, jpeg, shade
from tests.capture.recordings.test_recordings import CALIBRATION


def test_what_cannot_be_read_is_named_with_a_remedy(tmp_path, made):
    (tmp_path / "film.avi").write_bytes(b"RIFF")
    with pytest.raises(InputError, match=r"film\.avi: is neither the folder of a rig .* TUM RGB-D folder"):
        made(tmp_path / "film.avi")
    with pytest.raises(InputError, match="no such file"):
        open_take(tmp_path / "nothing.bag")
    with pytest.raises(InputError, match=r"depth of camera has no calibration: write fx fy cx cy .*calibration\.txt"):
        made(files.tum(tmp_path / "desk", numbers=""))
    assert len(readers()) == 8 and not is_take(tmp_path)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda folder: (folder / "depth.txt").write_text("# none"), "its list of pictures is empty"),
        (
            lambda folder: (folder / "depth.txt").write_text("now depth/0.png"),
            r"depth\.txt: line 1 is 'now depth/0\.png'",
        ),
        (lambda folder: (folder / "depth.txt").write_text("nan depth/0.png"), "line 1 is .* give NUMBER NAME"),
        (
            lambda folder: (folder / "depth.txt").write_text("# t\n100"),
            r"depth\.txt: line 2 is '100'; give NUMBER NAME",
        ),
        (lambda folder: (folder / "depth.txt").write_text("1 depth/9.png"), r"9\.png: cannot be read \(No such file"),
        (
            lambda folder: (folder / "depth.txt").write_text("1 rgb.txt"),
            r"rgb\.txt: is no picture; its .* bytes are no",
        ),
        (
            lambda folder: (folder / "calibration.txt").write_text("96 96"),
            r"calibration\.txt: has '96 96'; give .* fx fy cx cy",
        ),
        (
            lambda folder: (folder / "calibration.txt").write_text("fx 1"),
            r"calibration\.txt: has 'fx 1'; give the numbers",
        ),
        (lambda folder: (folder / "calibration.txt").write_text("0 96 48 48"), r"focal \(0, 96\), .* focal above 0"),
        (
            lambda folder: (folder / "calibration.txt").write_text("96 96 48 48 12"),
            r"distortion is \[12.0\]; .* at most 10",
        ),
        (
            lambda folder: (folder / "groundtruth.txt").write_text("100 0 0 0 0 0 0 0"),
            r"groundtruth\.txt: cannot be read",
        ),
        (lambda folder: (folder / "groundtruth.txt").write_text("100 0 0"), r"groundtruth\.txt: line 1 is '100 0 0'"),
        (
            lambda folder: (folder / "odometry.csv").write_text(""),
            "is a Stray Scanner folder .* and a TUM .* at once; move",
        ),
        (lambda folder: (folder / "rig.json").write_text("{}"), "is a rig, which no other recording joins"),
    ],
)
def test_a_damaged_folder_is_an_input_error(tmp_path, made, change, text):
    folder = files.tum(tmp_path / "desk")
    change(folder)
    with pytest.raises(InputError, match=text):
        made(folder)
    assert not list(tmp_path.glob("*rig*"))


DAMAGE = {
    r"depth of camera: 1 picture .*: picture 2 \(100\.200 s\): .*store depth as 16-bit": ("depth/2.png", jpeg(0)),
    r"picture 2 .*2\.png: ": ("depth/2.png", b"\x89PNG"),
    r"picture 2 .*2\.png: cannot be read \(No such file": ("depth/2.png", None),
    r"picture 2 .* 96 x 50 pixels where its lens has 96 x 96": ("depth/2.png", pack_picture(DEPTHS[0][:50])),
    r"color of camera: 1 picture .*: picture 1 \(100\.100 s\): .* 0 bytes are": ("rgb/1.jpg", b""),
    r"picture 1 .* 96 x 50 pixels where": ("rgb/1.jpg", pack_picture(shade(0)[:50])),
}


@pytest.mark.parametrize("words", DAMAGE)
def test_one_bad_picture_costs_one_frame_and_is_told_with_its_number_and_time(tmp_path, made, words):
    folder, (name, data) = files.tum(tmp_path / "desk"), DAMAGE[words]
    (folder / name).unlink() if data is None else (folder / name).write_bytes(data)
    rig, remarks = made(folder)
    assert rig.frames == ([0, 1, 3] if name.startswith("depth") else [0, 1, 2, 3])
    assert any(re.search(words, one) for one in remarks)
    assert data is not None or not any("delete the file" in one for one in remarks)
    for other in folder.glob(f"{name[:3]}*/*"):
        other.write_bytes(b"")
    with pytest.raises(InputError, match="0 bytes are no PNG"):
        made(folder)


def test_what_a_killed_run_left_is_deleted_by_the_next(tmp_path, made):
    (tmp_path / ".rig0.part" / "desk-camera").mkdir(parents=True)
    made(files.tum(tmp_path / "desk"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["desk", "rig0"]


def test_time_stamps_in_another_unit_repeated_or_far_off(tmp_path, made):
    nanoseconds = [1e9 * time for time in TIMES]
    with pytest.raises(
        InputError, match=r"desk: its depth pictures are 1e\+08 s apart .*; give time stamps in seconds"
    ):
        made(files.tum(tmp_path / "desk", nanoseconds, nanoseconds))
    twice = [*TIMES[:3], TIMES[2]]
    rig, remarks = made(files.tum(tmp_path / "twice", twice))
    assert rig.frames == [0, 1, 2] and "1 of 4 depth pictures are left out: another one is at their time" in remarks[0]
    far = [*TIMES[:3], 1e30]
    assert made(files.tum(tmp_path / "far", far, far))[0].frames[:3] == [0, 1, 2]


def test_lenses_that_bend_by_no_number_are_refused_where_they_are_read(tmp_path):
    pytest.importorskip("rosbags")
    with Bag(tmp_path / "room", "mcap") as bag:
        bag.info("/depth/camera_info", (np.nan,) * 5)
        bag.image("/depth/image_raw", DEPTHS[0], "16UC1", TIMES[0])
    with pytest.raises(InputError, match=r"room: cannot be read \(its lens bends by \(nan, nan"):
        open_take(tmp_path / "room")


def test_pictures_of_phones_that_have_no_time_are_not_put_on_another_clock(tmp_path, made):
    pytest.importorskip("av")
    folder = files.stray(tmp_path / "scan")
    text = (folder / "odometry.csv").read_text().splitlines()
    (folder / "odometry.csv").write_text("\n".join(text[:3]))
    rig, remarks = made(folder)
    assert rig.frames == [0, 1] and "depth of phone: 2 of 4 pictures can be read" in remarks[0]
    (folder / "confidence" / "000001.png").write_bytes(pack_picture(np.zeros((5, 5), np.uint8)))
    _, remarks = made(folder)
    assert any("000001.png: 5 x 5 pixels where depth has 96 x 96" in one for one in remarks)
    (folder / "odometry.csv").write_text("\n".join([text[0], text[1].replace("100.0", "nan")]))
    with pytest.raises(InputError, match=r"odometry\.csv: cannot be read \(it has a number that is not finite\)"):
        made(folder)


def test_a_file_of_kinect_that_is_damaged_or_lacks_something(tmp_path, made):
    pytest.importorskip("av")
    with pytest.raises(InputError, match=r"has no calibration: the file has no calibration\.json attached"):
        made(files.mkv(tmp_path / "bare.mkv", None))
    with pytest.raises(InputError, match=r"no track has the title DEPTH, only IR, COLOR"):
        made(files.mkv(tmp_path / "infrared.mkv", CALIBRATION, title="IR"))
    path = files.mkv(tmp_path / "whole.mkv", CALIBRATION)
    (tmp_path / "cut.mkv").write_bytes(path.read_bytes()[: path.stat().st_size // 3])
    _, remarks = made(tmp_path / "cut.mkv")
    assert any("pictures can be read; was the file cut off?" in one for one in remarks)
    (tmp_path / "none.mkv").write_bytes(b"no video")
    with pytest.raises(InputError, match=r"none\.mkv: cannot be read"):
        made(tmp_path / "none.mkv")


def test_bags_that_are_damaged_or_have_no_depth(tmp_path, made):
    pytest.importorskip("rosbags")
    with Bag(tmp_path / "a.bag", "bag") as bag:
        bag.image("/color/image_raw", shade(0), "rgb8", TIMES[0])
    with pytest.raises(InputError, match=r"a\.bag: .*no depth pictures .*; its topics are /color/image_raw \(Image\)"):
        made(tmp_path / "a.bag")
    with Bag(tmp_path / "b.bag", "bag") as bag:
        bag.info("/depth/camera_info", (0.1, 0, 0, 0), "equidistant")
        bag.image("/depth/image_raw", DEPTHS[0], "16UC1", TIMES[0])
    with pytest.raises(InputError, match="lens model equidistant"):
        made(tmp_path / "b.bag")
    with Bag(tmp_path / "e.bag", "bag") as bag:
        bag.info("/depth/camera_info")
        bag.image("/depth/image_raw", DEPTHS[0], "16UC1", TIMES[0])
        values = (bag.header(TIMES[1], "optical"), 96, 96, "16UC1", 0, 10, np.zeros(960, np.uint8))
        bag.write("/depth/image_raw", "sensor_msgs/Image", bag.of("sensor_msgs/Image", *values), TIMES[1])
    rig, remarks = made(tmp_path / "e.bag")
    assert rig.frames == [0]
    text = r"e\.bag: depth of .*: picture 1 \(100.100 s\): 96 x 96 pixels of 16UC1 in 960 bytes, 10 a row"
    assert any(re.search(text, one) for one in remarks)
    with Bag(tmp_path / "c.bag", "bag") as bag:
        bag.image("/depth/image_raw", DEPTHS[0], "16UC1", TIMES[0])
    with pytest.raises(InputError, match="has no calibration: record the topics camera_info"):
        made(tmp_path / "c.bag")
    data = (tmp_path / "c.bag").read_bytes()
    for size in (0, 10, 4000, len(data) // 2):
        (tmp_path / "d.bag").write_bytes(data[:size])
        with pytest.raises(InputError, match=r"d\.bag: cannot be read"):
            made(tmp_path / "d.bag")
