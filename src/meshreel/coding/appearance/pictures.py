"""Encode pictures that change little from frame to frame: as AV1 by SVT, or H.264 by x264 (PyAV, extra `color`).

In -> out: pictures in sRGB <-> packets, one for each picture, in order. Both sides use I420 planes of limited range
(ITU-R BT.709), on which decoders agree to the bit; the conversion to sRGB is up to the viewer. The cost of a packet is
determined without decoding it: a few bytes can demand thousands of pictures.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from threading import get_native_id
from typing import Any, Literal

import numpy as np

from ...errors import FormatError, InputError, needed
from ...format.budget import check_pictures
from ...format.kinds import Varint
from ...format.layout import LAYER_PICTURES, Form, Pictures, VideoCodec
from ...format.records import pack, unpack_all
from ...shapes import UInt8
from ...types import LUMA

PRESET = 4  # of SVT: 6 takes half as long for 5 % more bytes (basketball_player)
CRF, MOST_CRF = 42, 63  # constant rate factors of SVT at quality 50, and at most; larger is coarser
ENCODERS = {VideoCodec.AV1: "libsvtav1", VideoCodec.H264: "libx264"}
DECODERS = {VideoCodec.AV1: "libdav1d", VideoCodec.H264: "h264"}
X264 = (  # no picture waits for another; one key picture; BT.709, limited range; start codes. Without
    # `cpu-independent`, one encode of some 500 has other bytes than the rest (measured).
    "threads=1:cpu-independent=1:keyint=infinite:scenecut=0:bframes=0:rc-lookahead=0:sync-lookahead=0:repeat-headers=1:annexb=1"
    ":colorprim=bt709:transfer=bt709:colormatrix=bt709:fullrange=off"
)
H264_SCALE, H264_OFFSET = 0.375, 7.75  # from SVT's rate factor to x264's of about the same PSNR; measured
COMMENT = 6  # type of a NAL unit: supplemental enhancement information
H264_BORDER = 128  # pixels, largest border that FFmpeg's decoder adds to a picture
LOW_DELAY = 0x80000  # FFmpeg's flag AV_CODEC_FLAG_LOW_DELAY: a picture is shown when its packet is decoded
BAND = 64  # rows that become sRGB together: their floats take some MiB
MOST_CODED = 8  # largest number of pictures in a packet: AV1's number of reference frames
SEQUENCE, FRAME = 1, 6  # types of an OBU (AV1, 6.2.2), and those with the header of a picture
HEADERS = (3, FRAME, 7)
SLICES = (1, 2, 5)  # types of a NAL unit (H.264, table 7-1) with a first slice
BLUE, RED = 1.8556, 1.5748  # blue and red of a full colour difference (ITU-R BT.709)


class VideoEncoder:
    """Encoder of the pictures of one chain, of which only the first is a key picture."""

    def __init__(self, width: int, height: int, crf: int = CRF, codec: VideoCodec = VideoCodec.AV1) -> None:
        """Open the encoder. Raises InputError for a rate factor out of range, or if PyAV or its encoder is missing."""
        if not 1 <= crf <= MOST_CRF:
            raise InputError(f"rate factor {crf}: give 1 to {MOST_CRF}")
        self._context = context = _context(ENCODERS[codec], "w")
        context.width, context.height, context.pix_fmt = width, height, "yuv420p"
        context.time_base, context.framerate = Fraction(1, 30), Fraction(30)
        if codec == VideoCodec.AV1:
            params = "lp=1:keyint=-1:color-primaries=1:transfer-characteristics=1:matrix-coefficients=1:color-range=0"
            context.options = {"crf": str(crf), "preset": str(PRESET), "svtav1-params": params}
        else:
            context.options = {"crf": f"{H264_SCALE * crf + H264_OFFSET:.1f}", "x264-params": X264}
        with _as_urgent_as_before():
            context.open()
        self._codec, self._count = codec, 0

    def add(self, planes: UInt8[np.ndarray, "R W"]) -> list[bytes]:
        """Encode a picture, a result of `to_i420`; return the completed packets."""
        import av

        frame = av.VideoFrame.from_ndarray(planes, "yuv420p")
        frame.pts = self._count
        self._count += 1
        return self._packets(frame)

    def finish(self) -> list[bytes]:
        return self._packets(None)

    def _packets(self, frame: Any) -> list[bytes]:
        packets = [bytes(packet) for packet in self._context.encode(frame)]
        return packets if self._codec == VideoCodec.AV1 else [_without_comments(packet) for packet in packets]


class VideoDecoder:
    """Decoder of the pictures of one chain, from its first on."""

    def __init__(self, width: int, height: int, codec: VideoCodec = VideoCodec.AV1) -> None:
        """Open the decoder of pictures of this size. Raises InputError if PyAV is missing."""
        self._context = _context(DECODERS[codec], "r")
        # `max_pixels` limits the memory that a decoder allocates before the first picture.
        if codec == VideoCodec.AV1:
            self._context.options = {"max_pixels": str(width * height), "max_frame_delay": "1"}
        else:
            pixels = (width + H264_BORDER) * (height + H264_BORDER)
            self._context.options = {"max_pixels": str(pixels), "err_detect": "explode", "ec": "0"}  # conceal nothing
            self._context.flags |= LOW_DELAY
        self._context.thread_count = 1
        self._size = width, height

    def decode(self, packet: bytes) -> UInt8[np.ndarray, "R W"]:
        """Return the planes of the next picture. Raises FormatError if the packet is damaged or has another size."""
        import av

        try:
            frames = self._context.decode(av.Packet(packet))
        except (av.error.FFmpegError, ValueError) as error:
            raise FormatError(f"a damaged picture ({len(packet)} bytes): {error}") from error
        if len(frames) != 1:
            raise FormatError(f"a packet of {len(packet)} bytes with {len(frames)} pictures")
        [frame] = frames
        if (frame.width, frame.height) != self._size or frame.format.name != "yuv420p":
            raise FormatError(f"a picture of {frame.width} x {frame.height}, {frame.format.name}: not the atlas' size")
        return np.asarray(frame.to_ndarray())


def encode_pictures(packets: Sequence[bytes], codec: VideoCodec = VideoCodec.AV1, interval: int = 1) -> bytes:
    """Pack the packets of a group's pictures, or of a layer of a background's, each shown for `interval` frames."""
    return pack(Pictures(Form.VIDEO, codec, interval, tuple(packets)))


def decode_pictures(data: bytes, frames: int, texels: int) -> Pictures:
    """Return the packets of a group's pictures, or of a layer of a background's, which has 0 frames.

    Raises FormatError if a group does not have one picture per frame, or a layer none or too many; and CostlyError if
    pictures of this many texels cost more than the bytes allow.
    """
    record = unpack_all(Pictures, data)
    count, interval = len(record.packets), record.interval
    right = (count, interval) == (frames, 1) if frames else interval > 0 and 0 < count <= LAYER_PICTURES
    if record.form != Form.VIDEO or not right or not all(record.packets):
        raise FormatError(f"{count} pictures, one each {interval} frames, for {frames} frames")
    check_pictures(texels * sum(coded_pictures(packet, record.codec) for packet in record.packets), len(data))
    return record


def coded_pictures(packet: bytes, codec: VideoCodec) -> int:
    """Return the number of pictures that a packet decodes in order to show one.

    Raises FormatError if it shows none or several, decodes more than 8, or is AV1 of another profile than Main.
    """
    if codec == VideoCodec.AV1:
        coded, shown = _of_av1(packet)
    else:
        heads = re.findall(rb"\x00\x00\x01(.)[\x80-\xff]", packet, re.DOTALL)  # of slices that begin with block 0
        coded = shown = sum(head[0] & 31 in SLICES for head in heads)
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


def to_i420(pixels: UInt8[np.ndarray, "H W 3"]) -> UInt8[np.ndarray, "R W"]:
    """Return the planes of a picture with even sides, one below the other: R is 3 H / 2."""
    red, green, blue = (pixels[..., k].astype(np.float64) for k in range(3))
    luma = LUMA[0] * red + LUMA[1] * green + LUMA[2] * blue
    wide = [(blue - luma) / BLUE, (red - luma) / RED]
    halved = [(plane[::2, ::2] + plane[1::2, ::2] + plane[::2, 1::2] + plane[1::2, 1::2]) / 4 for plane in wide]
    planes = [16 + 219 / 255 * luma, *(128 + 224 / 255 * plane for plane in halved)]
    flat = np.concatenate([np.rint(plane).astype(np.uint8).reshape(-1) for plane in planes])
    return flat.reshape(-1, pixels.shape[1])


def from_i420(planes: UInt8[np.ndarray, "R W"]) -> UInt8[np.ndarray, "H W 3"]:
    """Return the picture in sRGB."""
    width = planes.shape[1]
    height = planes.shape[0] * 2 // 3
    luma, blue, red = np.split(planes.reshape(-1), [width * height, width * height * 5 // 4])
    pixels = np.empty((height, width, 3), np.uint8)
    for top in range(0, height, BAND):
        rows, half = slice(top, top + BAND), slice(top // 2, (top + BAND) // 2)
        differences = (plane.reshape(height // 2, width // 2)[half] for plane in (blue, red))
        pixels[rows] = _shown(luma.reshape(height, width)[rows], *differences)
    return pixels


def _shown(luma: np.ndarray, blue: np.ndarray, red: np.ndarray) -> np.ndarray:
    y = (luma.astype(np.float64) - 16) * (255 / 219)
    differences = ((plane.astype(np.float64) - 128) * (255 / 224) for plane in (blue, red))
    b, r = (plane.repeat(2, axis=0).repeat(2, axis=1) for plane in differences)
    shown = [y + RED * r, y - (LUMA[2] * BLUE * b + LUMA[0] * RED * r) / LUMA[1], y + BLUE * b]
    return np.clip(np.rint(np.stack(shown, axis=2)), 0, 255).astype(np.uint8)


def _without_comments(packet: bytes) -> bytes:
    """Return an access unit of H.264 without its comments, which x264 fills with 600 bytes about itself."""
    units = [unit for unit in re.split(b"\0{2,3}\1", packet) if unit and unit[0] & 31 != COMMENT]
    return b"".join(b"\0\0\0\1" + unit for unit in units)


@contextmanager
def _as_urgent_as_before() -> Iterator[None]:
    """Restore the scheduling of this thread after the block, and apply it to threads that the block started.

    As root, SVT gives its caller and its own threads the highest priority of the machine (`SCHED_FIFO`, 99): they would
    not share a processor with anything else, and threads started afterwards would inherit it.
    """
    before, earlier_threads = _scheduling(), _threads()
    try:
        yield
    finally:
        if before is not None and _scheduling() != before:
            for thread in (_threads() - earlier_threads) | {get_native_id()}:
                with suppress(ProcessLookupError):  # it has ended
                    os.sched_setscheduler(thread, *before)


def _scheduling() -> tuple[int, Any] | None:
    """Return policy and priority of this thread; None on macOS, Windows (SVT changes neither) and with musl."""
    try:
        return os.sched_getscheduler(0), os.sched_getparam(0)
    except (AttributeError, OSError):
        return None


def _threads() -> set[int]:
    tasks = Path("/proc/self/task")
    return {int(task.name) for task in tasks.iterdir()} if tasks.exists() else set()


def _context(codec: str, mode: Literal["r", "w"]) -> Any:
    os.environ.setdefault("SVT_LOG", "1")  # errors only: SVT would report each encoder on standard error
    with needed("textures need the extra `color`: pip install 'meshreel[color]'"):
        import av
    try:
        return av.CodecContext.create(codec, mode)
    except (av.error.FFmpegError, ValueError) as error:
        raise InputError(f"PyAV has no {codec} ({error}); install the wheel `av` from PyPI") from error
