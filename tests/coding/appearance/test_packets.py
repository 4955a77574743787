"""Packets of videos: how many pictures they decode is known before, and what asks for too much is refused."""

from __future__ import annotations

import numpy as np
import pytest

from meshreel.coding.appearance.pictures import MOST_CODED, VideoEncoder, coded_pictures, to_i420
from meshreel.errors import FormatError
from meshreel.format.layout import VideoCodec

AV1, H264 = VideoCodec.AV1, VideoCodec.H264
SHOWN, HIDDEN, AGAIN = b"\x32\1\x10", b"\x32\1\0", b"\x1a\1\x80"
SLICE = b"\0\0\1\x41\x9a"


def test_pictures_that_are_decoded_are_counted_and_those_that_are_shown_again_are_not():
    assert coded_pictures(b"\x12\0" + SHOWN, AV1) == 1
    assert coded_pictures((MOST_CODED - 1) * HIDDEN + SHOWN, AV1) == MOST_CODED
    assert coded_pictures(AGAIN, AV1) == 0
    assert coded_pictures(b"\x36\x20\1\x10", AV1) == 1  # of a layer, whose OBU has a longer head
    assert coded_pictures(b"\0\0\1\x67\x80" + SLICE + b"\0\0\1\x41\x10", H264) == 1  # a second slice of it


@pytest.mark.parametrize("packet", [b"", HIDDEN, 2 * SHOWN, 2 * AGAIN, SHOWN + AGAIN, MOST_CODED * HIDDEN + SHOWN])
def test_packets_that_show_not_one_picture_or_decode_many_are_refused(packet: bytes):
    with pytest.raises(FormatError, match="pictures and shows"):
        coded_pictures(packet, AV1)


@pytest.mark.parametrize("bad", [b"\x30\x10", b"\x32\2\x10", b"\x32", b"\x32\xff", SHOWN + b"\x32\x81\1\x10", b"\x36"])
def test_obus_without_their_size_or_beyond_their_packet_are_refused(bad: bytes):
    with pytest.raises(FormatError):
        coded_pictures(bad, AV1)


@pytest.mark.parametrize("first", [0x20, 0x40, 0x80, 0x18])
def test_other_profiles_and_the_short_heads_of_still_pictures_are_refused(first: int):
    with pytest.raises(FormatError, match="Main profile"):
        coded_pictures(bytes([0x0A, 1, first]) + SHOWN, AV1)


@pytest.mark.parametrize("packet", [b"", SLICE[:-1], 2 * SLICE, b"\0\0\1\x65\x88" + SLICE])
def test_access_units_have_one_picture(packet: bytes):
    with pytest.raises(FormatError, match="pictures and shows"):
        coded_pictures(packet, H264)


@pytest.mark.parametrize("codec", VideoCodec)
def test_what_the_encoders_make_is_legal(codec: VideoCodec):
    pytest.importorskip("av")
    encoder, found = VideoEncoder(64, 32, codec=codec), list[bytes]()
    noise = np.random.default_rng(0)
    for _ in range(40):
        found += encoder.add(to_i420(noise.integers(0, 256, (32, 64, 3)).astype(np.uint8)))
    counts = [coded_pictures(packet, codec) for packet in found + encoder.finish()]
    assert len(counts) == 40 and sum(counts) <= 44
