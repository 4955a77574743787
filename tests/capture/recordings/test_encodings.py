"""Depth and colours of bags in every encoding that drivers write, and the unit of depth."""

import struct

import numpy as np
import pytest

from meshreel.capture.recordings import open_take
from meshreel.capture.recordings.rosbag import _from_bayer, _from_yuv
from meshreel.capture.recordings.to_rig import write_takes
from meshreel.capture.rig.rig import read_rig
from meshreel.io.pictures import pack_picture, read_picture
from tests.capture.recordings import files
from tests.capture.recordings.files import DEPTHS, SIZE, TIMES, Bag

pytest.importorskip("rosbags")
FLAT = np.zeros((SIZE, SIZE, 3), np.uint8) + np.array([200, 120, 40], np.uint8)


def rvl(depth):
    """A stream of RVL, as Wilson's paper writes it (2017): number by number."""
    digits, before, flat, at = [], 0, depth.reshape(-1).astype(int).tolist(), 0

    def put(number):
        while True:
            number, digit = number >> 3, number & 7
            digits.append(digit | (8 if number else 0))
            if not number:
                return

    while at < len(flat):
        begin = at
        while at < len(flat) and flat[at] == 0:
            at += 1
        put(at - begin)
        end = at
        while end < len(flat) and flat[end] != 0:
            end += 1
        put(end - at)
        for value in flat[at:end]:
            step, before = value - before, value
            put(2 * step if step >= 0 else -2 * step - 1)
        at = end
    digits += [0] * (-len(digits) % 8)
    words = [sum(digit << 28 - 4 * k for k, digit in enumerate(digits[n : n + 8])) for n in range(0, len(digits), 8)]
    head = struct.pack("<iff", 0, 0, 0) + struct.pack("<II", depth.shape[1], depth.shape[0])
    return head + struct.pack(f"<{len(words)}I", *words)


def rig_of(path, depth=None, color=None):
    """The rig of a bag with one picture; `depth` and `color` write them."""
    with Bag(path / "room", "mcap") as bag:
        bag.info("/cam/depth/camera_info")
        bag.info("/cam/color/camera_info")
        if depth is None:
            bag.image("/cam/depth/image_raw", DEPTHS[0], "16UC1", TIMES[0])
        else:
            depth(bag)
        if color is not None:
            color(bag)
    write_takes([open_take(path / "room")], path / "rig")
    return read_rig(path / "rig")


@pytest.mark.parametrize("holes", [False, True])
def test_depth_in_rvl_is_that_of_its_pixels(tmp_path, holes):
    depth = DEPTHS[0].astype(np.uint16).copy()
    if holes:
        depth[::3, 5:40], depth[-1], depth[0, 0] = 0, 0, 0
    name, form = "/cam/depth/image_raw/compressedDepth", "16UC1; compressedDepth rvl"
    rig = rig_of(tmp_path, lambda bag: bag.compressed(name, rvl(depth), form, TIMES[0]))
    assert np.array_equal(rig.depth(0, 0), depth)


@pytest.mark.parametrize("encoding", ["16UC1", "mono16", "Z16", "16SC1"])
def test_depth_of_16_bits_has_many_names(tmp_path, encoding):
    rig = rig_of(tmp_path, lambda bag: bag.image("/cam/depth/image_raw", DEPTHS[0], encoding, TIMES[0]))
    assert np.array_equal(rig.depth(0, 0), DEPTHS[0])


def test_depth_in_a_png_without_another_word_is_depth(tmp_path):
    data = pack_picture(DEPTHS[0].astype(np.uint16))
    rig = rig_of(tmp_path, lambda bag: bag.compressed("/cam/depth/image_raw/compressed", data, "png", TIMES[0]))
    assert np.array_equal(rig.depth(0, 0), DEPTHS[0])


def yuv(order):
    """The flat colour in two bytes a pixel (ITU-R BT.601, limited range)."""
    r, g, b = FLAT[0, 0] / 255
    y = 16 + 65.481 * r + 128.553 * g + 24.966 * b
    u, v = 128 - 37.797 * r - 74.203 * g + 112 * b, 128 + 112 * r - 93.786 * g - 18.214 * b
    pair = {"uyvy": [u, y, v, y], "yuyv": [y, u, y, v]}[order]
    return np.tile(np.rint(pair).astype(np.uint8), (SIZE, SIZE // 2))


def bayer(order):
    raw = np.zeros((SIZE, SIZE), np.uint8)
    for k, channel in enumerate(order):
        raw[k // 2 :: 2, k % 2 :: 2] = FLAT[0, 0, "rgb".index(channel)]
    return raw


@pytest.mark.parametrize(
    ("encoding", "pixels", "wanted"),
    [
        ("8UC3", FLAT[..., ::-1], FLAT[0, 0]),
        ("bgra8", np.concatenate([FLAT[..., ::-1], FLAT[..., :1]], axis=2), FLAT[0, 0]),
        ("mono8", FLAT[..., 0], [200] * 3),
        *((f"bayer_{order}8", bayer(order), FLAT[0, 0]) for order in ("rggb", "bggr", "gbrg", "grbg")),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_colours_of_drivers_are_red_green_and_blue(tmp_path, encoding, pixels, wanted):
    pixels = np.ascontiguousarray(pixels)
    rig = rig_of(tmp_path, color=lambda bag: bag.image("/cam/color/image_raw", pixels, encoding, TIMES[0]))
    (camera,) = rig.color_cameras
    assert abs(read_picture(camera.files[0]).astype(int) - np.array(wanted, int)).max() <= 3


@pytest.mark.parametrize(("order", "places"), [("uyvy", (1, 0)), ("yuyv", (0, 1))])
def test_luma_and_chroma_of_video_cameras(order, places):
    assert abs(_from_yuv(yuv(order), *places).astype(int) - FLAT).max() <= 2


def test_a_pixel_of_a_bayer_picture_keeps_what_was_measured_there():
    raw = np.random.default_rng(1).integers(0, 256, (6, 8)).astype(np.uint8)
    found = _from_bayer(raw, "rggb")
    assert np.array_equal(found[::2, ::2, 0], raw[::2, ::2]) and np.array_equal(found[1::2, 1::2, 2], raw[1::2, 1::2])
    assert found[2, 3, 0] == round((int(raw[2, 2]) + int(raw[2, 4])) / 2)


def test_the_unit_of_depth_can_be_said_and_a_room_of_half_a_metre_is_questioned(tmp_path):
    folder = files.tum(tmp_path / "desk")
    remarks = write_takes([open_take(folder)], tmp_path / "said", depth_unit=0.001)
    assert read_rig(tmp_path / "said").cameras[0].depth_unit == 0.001 and not any("--depth-unit" in r for r in remarks)
    remarks = write_takes([open_take(folder)], tmp_path / "wrong", depth_unit=0.00002)
    assert any("its depth reaches 0." in one and "say --depth-unit" in one for one in remarks)
