"""Pictures as video: colours of planes, one packet a picture, the same bytes again, and damage."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from meshreel.coding.appearance.pictures import (
    BAND,
    VideoDecoder,
    VideoEncoder,
    decode_pictures,
    encode_pictures,
    from_i420,
    to_i420,
)
from meshreel.errors import FormatError, InputError
from meshreel.format.budget import CostlyError
from meshreel.format.layout import LAYER_PICTURES, VideoCodec

pytest.importorskip("av")
SHOWN, HIDDEN = b"\x32\1\x10", b"\x32\1\0"  # headers of pictures, that of AV1's OBU first
X, Y = np.meshgrid(np.arange(96), np.arange(64))
PICTURES = [
    np.stack([128 + 100 * np.sin(X / 9 + t / 5), 128 + 90 * np.cos(Y / 7), 2.0 * X], axis=2).astype(np.uint8)
    for t in range(9)
]


def packets(crf: int = 20, codec: VideoCodec = VideoCodec.AV1) -> list[bytes]:
    encoder, found = VideoEncoder(96, 64, crf, codec), list[bytes]()
    for one in PICTURES:
        found += encoder.add(to_i420(one))
    return found + encoder.finish()


@pytest.mark.skipif(
    not hasattr(os, "sched_getscheduler") or os.geteuid() != 0, reason="SVT makes threads urgent on Linux, as root"
)
def test_encoding_leaves_no_thread_more_urgent_than_it_was() -> None:
    encoder, before = VideoEncoder(96, 64), os.sched_getscheduler(0)
    encoder.add(to_i420(PICTURES[0]))
    threads = [int(task.name) for task in Path("/proc/self/task").iterdir()]
    assert len(threads) > 3  # SVT's own
    assert {os.sched_getscheduler(thread) for thread in threads} == {before}
    child = subprocess.run([sys.executable, "-c", "import os; print(os.sched_getscheduler(0))"], capture_output=True)
    assert int(child.stdout) == before


def test_h264_that_is_cut_short_is_refused_and_not_concealed() -> None:
    first, *_ = packets(codec=VideoCodec.H264)
    for damaged in (first[:-3], first[: len(first) // 2], first[: len(first) // 2] + bytes(len(first) // 2)):
        with pytest.raises(FormatError, match="picture"):
            VideoDecoder(96, 64, VideoCodec.H264).decode(damaged)


def test_planes_are_bt_709_in_limited_range() -> None:
    colors = np.array([[0, 0, 0], [255, 255, 255], [255, 0, 0], [0, 255, 0], [0, 0, 255]], np.uint8)
    for color, wanted in zip(
        colors, [(16, 128, 128), (235, 128, 128), (63, 102, 240), (173, 42, 26), (32, 240, 118)], strict=True
    ):
        planes = to_i420(np.tile(color, (2, 2, 1)))
        assert planes.shape == (3, 2) and planes[0, 0] == wanted[0]
        assert planes.reshape(-1)[4:].tolist() == list(wanted[1:])
        assert np.abs(from_i420(planes).astype(int) - color).max() <= 2


def test_bands_of_rows_are_one_picture() -> None:
    planes = np.random.default_rng(0).integers(0, 256, (3 * BAND // 2 + 3, 6)).astype(np.uint8)
    whole, cuts = from_i420(planes), [6 * (BAND + 2), 6 * (BAND + 2) * 5 // 4]
    luma, blue, red = (
        plane.reshape(-1, width) for plane, width in zip(np.split(planes.reshape(-1), cuts), (6, 3, 3), strict=True)
    )
    last = np.concatenate([luma[BAND:].reshape(-1), blue[BAND // 2 :].reshape(-1), red[BAND // 2 :].reshape(-1)])
    np.testing.assert_array_equal(whole[BAND:], from_i420(last.reshape(-1, 6)))
    assert whole.shape == (BAND + 2, 6, 3)


@pytest.mark.parametrize("codec", VideoCodec)
def test_each_picture_is_a_packet_and_comes_back(codec: VideoCodec) -> None:
    found = packets(codec=codec)
    assert len(found) == len(PICTURES) and found == packets(codec=codec)
    decoder = VideoDecoder(96, 64, codec)
    for one, packet in zip(PICTURES, found, strict=True):
        assert np.abs(from_i420(decoder.decode(packet)).astype(int) - one).mean() < 6
    assert sum(map(len, packets(50, codec))) < sum(map(len, found))


def test_packets_of_h264_have_no_comments() -> None:
    assert b"x264" not in b"".join(packets(codec=VideoCodec.H264))


@pytest.mark.parametrize("codec", VideoCodec)
def test_damaged_pictures_are_refused(codec: VideoCodec) -> None:
    first, second, *_ = packets(codec=codec)
    for bad in (first[:20], b"\0" * 50, second, first[::-1]):
        with pytest.raises(FormatError):
            VideoDecoder(96, 64, codec).decode(bad)
    for width, height in ((48, 32), (96, 62), (192, 128)):
        with pytest.raises(FormatError):
            VideoDecoder(width, height, codec).decode(first)


def test_a_group_has_a_picture_for_each_frame() -> None:
    data = encode_pictures([SHOWN, SHOWN + HIDDEN])
    assert decode_pictures(data, 2, 4).packets == (SHOWN, SHOWN + HIDDEN)
    slow = encode_pictures([SHOWN, SHOWN], interval=4)
    for count, bad in ((3, data), (2, data[:-1]), (2, encode_pictures([SHOWN, b""])), (2, slow)):
        with pytest.raises(FormatError):
            decode_pictures(bad, count, 4)


@pytest.mark.parametrize("codec", VideoCodec)
def test_truncated_and_changed_records_are_refused_before_anything_is_decoded_or_decode(codec: VideoCodec) -> None:
    found = packets(codec=codec)[:3]
    data, wrong = encode_pictures(found, codec), 0
    for length in range(len(data)):
        with pytest.raises(FormatError):
            decode_pictures(data[:length], 3, 96 * 64)
    for at in [*range(12), *range(12, len(data), 97)]:
        changed = data[:at] + bytes([data[at] ^ 255]) + data[at + 1 :]
        try:
            record = decode_pictures(changed, 3, 96 * 64)
            decoder = VideoDecoder(96, 64, record.codec)
            assert all(decoder.decode(packet).shape == (96, 96) for packet in record.packets)
        except FormatError:
            wrong += 1
    assert wrong > 5


def test_pictures_that_cost_more_than_their_bytes_may_are_refused() -> None:
    texels, data = 2048 * 2048, encode_pictures([SHOWN + 7 * HIDDEN] * 11)
    assert len(decode_pictures(data, 11, texels).packets) == 11
    with pytest.raises(CostlyError, match=r"pictures: .* bytes that cost"):
        decode_pictures(encode_pictures([SHOWN + 7 * HIDDEN] * 13), 13, texels)
    assert len(decode_pictures(encode_pictures([SHOWN + 7 * HIDDEN] * 13), 13, texels // 4).packets) == 13


def test_a_layer_of_a_background_has_at_most_64_pictures() -> None:
    record = decode_pictures(encode_pictures([SHOWN] * LAYER_PICTURES, interval=4), 0, 4)
    assert (len(record.packets), record.interval) == (LAYER_PICTURES, 4)
    for count, interval in ((LAYER_PICTURES + 1, 4), (0, 4), (1, 0)):
        with pytest.raises(FormatError):
            decode_pictures(encode_pictures([SHOWN] * count, interval=interval), 0, 4)


def test_without_pyav_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(InputError, match=r"meshreel\[color\]"):
        VideoEncoder(96, 64)


def test_options_out_of_range_are_refused() -> None:
    with pytest.raises(InputError, match="rate factor 64"):
        VideoEncoder(96, 64, 64)
