"""Files of films: MP4 (H.264) and WebM (VP9) by PyAV, GIF by Pillow, and PNG.

In: a function that draws pictures, their times, audio. Out: a file, with the same bytes for the same pictures and
versions of these libraries: encoders use one thread.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..coding.appearance.pictures import to_i420
from ..errors import needed
from ..io.write import replacing, write_picture
from ..shapes import UInt8
from ..types import Audio, evenly

VIDEOS = {".mp4": "libx264", ".webm": "libvpx-vp9"}
KINDS = (*VIDEOS, ".gif", ".png")
SOUNDS = {".mp4": ("aac", "mp3", "mp3float", "opus"), ".webm": ("opus", "vorbis")}  # what browsers play in these
OPTIONS = {  # nearly transparent quality (guess); speeds at which encoding takes less than drawing
    ".mp4": {"crf": "18", "preset": "medium", "x264-params": "threads=1:cpu-independent=1"},
    ".webm": {"crf": "24", "b": "0", "deadline": "good", "cpu-used": "4", "row-mt": "0", "auto-alt-ref": "0"},
}
TICKS = {".mp4": 90_000, ".webm": 1000}  # of time, 1/s: WebM knows no others
BT709, LIMITED = 1, 1  # of H.273: colours as HDTV has them, luma from 16 to 235
GIF_RATE = 50  # pictures a second: players slow down what is faster
LOOKED_AT = 8  # pictures from which a GIF has its colours (guess)
OPAQUE = 128  # least alpha of what a GIF shows

Pixels = UInt8[np.ndarray, "H W C"]
Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class Film:
    """Pictures over time, and audio."""

    picture: Callable[[int], Pixels]  # draws one
    is_transparent: bool  # pictures have alpha as fourth channel
    times: list[float]  # s, of each picture, and of the end
    size: tuple[int, int]  # pixels
    rate: float  # pictures per second, about
    audio: Audio | None
    start: float  # s: time of the first picture, from the recording's first frame on

    @property
    def count(self) -> int:
        return len(self.times) - 1


@dataclass(frozen=True, slots=True)
class Written:
    """Content of a finished file."""

    pictures: int
    has_audio: bool = False


def write_film(film: Film, path: Path, progress: Progress) -> Written:
    """Write a file, which appears when it is complete. Raises InputError, also without PyAV or Pillow."""
    kind = path.suffix.lower()
    if kind == ".png":
        write_picture(film.picture(0), path)
        return Written(1)
    with replacing(path) as file:
        packed = io.BytesIO()  # encoders seek, and what they meet on a full disk they print
        has_audio = _pack_gif(film, packed, progress) if kind == ".gif" else _pack_video(film, packed, kind, progress)
        file.write(packed.getbuffer())
    return Written(film.count, has_audio)


def _pack_video(film: Film, file: io.BytesIO, kind: str, progress: Progress) -> bool:
    """Write pictures and audio; return whether the format takes that audio."""
    with needed("videos need the extra `color`: pip install 'meshreel[color]'"):
        import av

    def again(*_: object) -> io.BytesIO:  # FFmpeg moves the index of an MP4 to its start, and reads the file for that
        return io.BytesIO(file.getvalue())

    options = {"fflags": "+bitexact"} | ({"movflags": "faststart"} if kind == ".mp4" else {})
    with av.open(file, "w", format=kind[1:], options=options, io_open=again) as out:
        packets = [*_encoded(film, out, kind, progress)]
        sound = _sound(film, out, kind)
        for packet in sorted([*packets, *sound], key=lambda packet: packet.dts * packet.time_base):
            out.mux(packet)
    return bool(sound)


def _encoded(film: Film, out: Any, kind: str, progress: Progress) -> Iterator[Any]:
    stream = out.add_stream(VIDEOS[kind], rate=Fraction(film.rate).limit_denominator(1001), options=OPTIONS[kind])
    context, ticks = stream.codec_context, TICKS[kind]
    context.width, context.height = film.size
    context.pix_fmt = "yuva420p" if film.is_transparent else "yuv420p"
    context.time_base, context.thread_count = Fraction(1, ticks), 1
    context.colorspace = context.color_primaries = context.color_trc = BT709
    context.color_range = LIMITED
    for number in range(film.count):
        frame = _planes(film.picture(number), context.pix_fmt)
        frame.pts, frame.time_base = round(film.times[number] * ticks), context.time_base
        yield from stream.encode(frame)
        progress(number + 1, film.count)
    yield from stream.encode()


def _planes(pixels: Pixels, form: str) -> Any:
    import av

    height, width = pixels.shape[:2]
    flat = to_i420(pixels[..., :3]).reshape(-1)
    planes = np.split(flat, [width * height, width * height * 5 // 4])
    frame = av.VideoFrame(width, height, form)
    for plane, values in zip(frame.planes, [*planes, *([pixels[..., 3]] if form == "yuva420p" else [])], strict=True):
        rows = np.zeros((plane.height, plane.line_size), np.uint8)
        rows[:, : plane.width] = values.reshape(plane.height, plane.width)
        plane.update(rows.tobytes())
    return frame


def _sound(film: Film, out: Any, kind: str) -> list[Any]:
    """Return the packets of the audio while the film lasts, unchanged; none if the format takes no such audio."""
    import av

    if film.audio is None:
        return []
    kept = list[Any]()
    try:
        source = av.open(io.BytesIO(film.audio.data), "r")
    except av.error.FFmpegError:  # no audio that FFmpeg knows: any bytes may be in a .reel file
        return []
    with source:
        given = source.streams.audio[0]
        if given.codec_context.name not in SOUNDS[kind]:
            return []
        stream = out.add_stream_from_template(given)
        for packet in source.demux(given):
            if packet.pts is None:  # the end
                continue
            time = float(packet.pts * packet.time_base) + film.audio.start - film.start
            if 0 <= time < film.times[-1]:
                packet.pts = packet.dts = round(time / packet.time_base)
                packet.stream = stream
                kept.append(packet)
    return kept


def _pack_gif(film: Film, file: io.BytesIO, progress: Progress) -> bool:
    """Write a GIF that begins again at its end, and return False: it has no audio.

    Its colours are those of some pictures, so that nothing flickers.
    """
    with needed("a GIF needs the extra `color`: pip install 'meshreel[color]'"):
        from PIL import Image
    samples = np.concatenate([film.picture(number) for number in evenly(film.count, LOOKED_AT)])
    opaque = samples[samples[..., 3] >= OPAQUE][None] if film.is_transparent else samples
    palette = Image.fromarray(np.ascontiguousarray(opaque[..., :3])).quantize(255, Image.Quantize.FASTOCTREE)
    found = palette.getpalette() or []
    colors = [*found, *[0] * (3 * 256 - len(found))]  # a shorter palette would have no place for number 255

    def indexed(number: int) -> Any:
        pixels = film.picture(number)
        image = Image.fromarray(np.ascontiguousarray(pixels[..., :3])).quantize(
            palette=palette, dither=Image.Dither.NONE
        )
        if film.is_transparent:
            indices = np.where(pixels[..., 3] < OPAQUE, 255, np.asarray(image)).astype(np.uint8)
            image = Image.fromarray(indices, "P")
            image.putpalette(colors)
            image.info["transparency"] = 255
        progress(number + 1, film.count)
        return image

    images = [indexed(number) for number in range(film.count)]
    # Pillow (13.0) writes a second head for a picture without anything: the one before it stays instead.
    shown = [k for k, image in enumerate(images) if k == 0 or image.getextrema() != (255, 255)]
    steps = [round(100 * film.times[k]) for k in [*shown, film.count]]
    delays = [10 * max(after - before, 2) for before, after in pairwise(steps)]
    first, *others = (images[k] for k in shown)
    first.save(
        file,
        "GIF",
        save_all=True,
        append_images=others,
        duration=delays,
        loop=0,
        optimize=False,
        disposal=2 if film.is_transparent else 1,
    )
    return False
