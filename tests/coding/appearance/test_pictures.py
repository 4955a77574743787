"""Pictures as video: colours of planes, one packet a picture, the same bytes again, and damage."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from meshreel.coding.appearance.pictures import (
    VideoDecoder,
    VideoEncoder,
    VideoOptions,
    decode_pictures,
    encode_pictures,
    from_i420,
    to_i420,
)
from meshreel.errors import FormatError, InputError
from meshreel.format.layout import LAYER_PICTURES, VideoCodec

pytest.importorskip("av")
X, Y = np.meshgrid(np.arange(96), np.arange(64))
PICTURES = [
    np.stack([128 + 100 * np.sin(X / 9 + t / 5), 128 + 90 * np.cos(Y / 7), 2.0 * X], axis=2).astype(np.uint8)
    for t in range(9)
]


def packets(crf: int = 20, codec: VideoCodec = VideoCodec.AV1) -> list[bytes]:
    encoder, found = VideoEncoder(96, 64, VideoOptions(crf), codec), list[bytes]()
    for one in PICTURES:
        found += encoder.add(to_i420(one))
    return found + encoder.finish()


def test_planes_are_bt_709_in_limited_range() -> None:
    colors = np.array([[0, 0, 0], [255, 255, 255], [255, 0, 0], [0, 255, 0], [0, 0, 255]], np.uint8)
    for color, wanted in zip(
        colors, [(16, 128, 128), (235, 128, 128), (63, 102, 240), (173, 42, 26), (32, 240, 118)], strict=True
    ):
        planes = to_i420(np.tile(color, (2, 2, 1)))
        assert planes.shape == (3, 2) and planes[0, 0] == wanted[0]
        assert planes.reshape(-1)[4:].tolist() == list(wanted[1:])
        assert np.abs(from_i420(planes).astype(int) - color).max() <= 2


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
    data = encode_pictures([b"one", b"two"])
    assert decode_pictures(data, 2).packets == (b"one", b"two")
    slow = encode_pictures([b"one", b"two"], interval=4)
    for count, bad in ((3, data), (2, data[:-1]), (2, encode_pictures([b"one", b""])), (2, slow)):
        with pytest.raises(FormatError):
            decode_pictures(bad, count)


def test_a_layer_of_a_background_has_at_most_64_pictures() -> None:
    record = decode_pictures(encode_pictures([b"one"] * LAYER_PICTURES, interval=4), 0)
    assert (len(record.packets), record.interval) == (LAYER_PICTURES, 4)
    for count, interval in ((LAYER_PICTURES + 1, 4), (0, 4), (1, 0)):
        with pytest.raises(FormatError):
            decode_pictures(encode_pictures([b"one"] * count, interval=interval), 0)


def test_without_pyav_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(InputError, match=r"meshreel\[color\]"):
        VideoEncoder(96, 64, VideoOptions())


def test_options_out_of_range_are_refused() -> None:
    with pytest.raises(InputError, match="crf 64"):
        VideoOptions(crf=64)
