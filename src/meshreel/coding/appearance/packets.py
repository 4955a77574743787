"""What a packet of a video asks of its decoder, seen without decoding it.

In: a packet. Out: how many pictures it has. A few bytes can ask for thousands of pictures, of which none is shown.
"""

from __future__ import annotations

import re

from ...errors import FormatError
from ...format.kinds import Varint
from ...format.layout import VideoCodec

MOST_CODED = 8  # pictures in a packet: AV1 keeps as many for later ones
SEQUENCE, FRAME = 1, 6  # types of an OBU (AV1, 6.2.2), and those with the header of a picture
HEADERS = (3, FRAME, 7)
SLICES = (1, 2, 5)  # types of a NAL unit (H.264, table 7-1) with a first slice


def coded_pictures(packet: bytes, codec: VideoCodec) -> int:
    """Return how many pictures a packet decodes, to show one.

    Raises FormatError where it shows none or several, decodes more than 8, or is AV1 of another profile than Main.
    """
    coded, shown = _of_av1(packet) if codec == VideoCodec.AV1 else _of_h264(packet)
    if shown != 1 or coded > MOST_CODED:
        raise FormatError(f"a packet of {len(packet)} bytes that decodes {coded} pictures and shows {shown}")
    return coded


def _of_av1(packet: bytes) -> tuple[int, int]:
    at = coded = shown = 0
    while at < len(packet):
        head = packet[at]
        size, begin = Varint().unpack(packet, at + 1 + (head >> 2 & 1))
        at, kind = begin + size, head >> 3 & 15
        if at > len(packet) or not head & 2:
            raise FormatError(f"a damaged picture: an OBU of {size} bytes that ends behind its packet, or has no size")
        first = packet[begin] if size else 0
        if kind == SEQUENCE and first & 0xE8:  # a profile but Main, or the short headers of a still picture
            raise FormatError(f"a video whose sequence header begins with {first}: not AV1's Main profile")
        if kind in HEADERS:
            again = first >> 7  # show_existing_frame
            coded += not again
            shown += again or first >> 4 & 1
    return coded, shown


def _of_h264(packet: bytes) -> tuple[int, int]:
    heads = re.findall(rb"\x00\x00\x01(.)[\x80-\xff]", packet, re.DOTALL)  # of slices that begin with block 0
    count = sum(head[0] & 31 in SLICES for head in heads)
    return count, count
