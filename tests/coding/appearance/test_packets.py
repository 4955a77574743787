"""Packets of videos: how many pictures they decode is known before, and what asks for too much is refused."""

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


NOT_ONE = [b"", HIDDEN, 2 * SHOWN, 2 * AGAIN, SHOWN + AGAIN, MOST_CODED * HIDDEN + SHOWN]
NO_SIZE = [b"\x30\x10", b"\x32\2\x10", b"\x32", b"\x32\xff", SHOWN + b"\x32\x81\1\x10", b"\x36"]
OTHERS = [
    bytes([0x0A, 1, first]) + SHOWN for first in (0x20, 0x40, 0x80, 0x18)
]  # profiles, and heads of still pictures
UNITS = [b"", SLICE[:-1], 2 * SLICE, b"\0\0\1\x65\x88" + SLICE]


@pytest.mark.parametrize(
    ("codec", "bad", "words"),
    [
        (AV1, NOT_ONE, "pictures and shows"),
        (AV1, NO_SIZE, None),
        (AV1, OTHERS, "Main profile"),
        (H264, UNITS, "pictures and shows"),
    ],
)
def test_packets_that_show_not_one_picture_or_are_of_another_kind_are_refused(
    codec, bad: list[bytes], words: str | None
):
    for packet in bad:
        with pytest.raises(FormatError, match=words):
            coded_pictures(packet, codec)


@pytest.mark.parametrize("codec", VideoCodec)
def test_what_the_encoders_make_is_legal(codec: VideoCodec):
    pytest.importorskip("av")
    encoder, found = VideoEncoder(64, 32, codec=codec), list[bytes]()
    noise = np.random.default_rng(0)
    for _ in range(40):
        found += encoder.add(to_i420(noise.integers(0, 256, (32, 64, 3)).astype(np.uint8)))
    counts = [coded_pictures(packet, codec) for packet in found + encoder.finish()]
    assert len(counts) == 40 and sum(counts) <= 44
