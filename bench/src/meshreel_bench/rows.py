"""Points to measure and rows of measurements. In -> out: a file of JSON lines <-> rows."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from meshreel.errors import InputError

METHOD = ("preset", "variant", "color", "levels", "labels", "decoder")  # options that choose one; others: its points
BEGINNING = b'{"point":'  # of a row
Count = Annotated[int, msgspec.Meta(gt=0)]
Positive = Annotated[float, msgspec.Meta(gt=0)]
Option = str | int | float | bool | None
Options = dict[str, Option]
Metrics = Literal["distances", "views", "parallel views", "regions", "colors", "depth", "splats", "mpeg"]


class Point(msgspec.Struct, frozen=True):
    """A codec at an operating point on a sequence, which one row measures."""

    sequence: str
    codec: str
    options: Options = {}
    frames: int | None = None  # the first frames of the sequence; None: all
    sampled: bool = False  # the codec is given some frames of a scene only: it is slow, or codes every frame alone
    # distances alone; also pictures, from where the cameras stood or from four sides (perspective, or parallel); people
    # and background of a simulated scene against truth and input; colours of parallel views and cameras' pictures;
    # all frames of a recording by its depth pictures; splats on the decoded mesh, by pictures of these; or MPEG's own
    metrics: Metrics = "views"

    @property
    def key(self) -> str:
        """Text that is equal for equal points."""
        return json.dumps(msgspec.to_builtins(self), sort_keys=True)

    @property
    def method(self) -> Options:
        """Options that choose a method of the codec."""
        return {name: self.options[name] for name in METHOD if name in self.options}


class Maker(msgspec.Struct, frozen=True):
    """Version and machine that made a row; None: not recorded."""

    meshreel: str | None = None
    commit: str | None = None
    platform: str | None = None
    python: str | None = None
    cpu: str | None = None
    cores: int | None = None


class Group(msgspec.Struct, frozen=True, omit_defaults=True):
    """Group of frames in a .reel file."""

    first_frame: int
    frames: int
    form: str
    bytes: int
    key: int | None = None  # frame that the others are predicted from, where the file names it


class ColorBytes(msgspec.Struct, frozen=True, omit_defaults=True):
    """Bytes of a stream's colours; of its geometry, what a chain of groups begins with."""

    vertices: int = 0  # colours of moving bodies' vertices
    atlas: int = 0  # places in textures
    pictures: list[int] = []  # of each texture
    background: int = 0  # all colours of what stands still
    base: int = 0  # base meshes of groups that need no other: no colours
    chains: int = 1

    @property
    def all(self) -> int:
        """All bytes of colours."""
        return self.vertices + self.atlas + self.background + sum(self.pictures)


class Stream(msgspec.Struct, frozen=True, omit_defaults=True):
    """Encoded sequence."""

    bytes: Count
    coded_frames: Count
    background_bytes: int = 0  # share of `bytes` that is sent once
    groups: list[Group] = []
    colors: ColorBytes | None = None
    canonical: int = 0  # groups whose reference lies in the pose of eq. 5
    tracks: int = 0


class Encoding(msgspec.Struct, frozen=True, omit_defaults=True):
    """Cost of an encode, processor time."""

    s: float | None = None  # a frame
    stages_s: dict[str, float] = {}  # a frame
    peak_rss_mb: float | None = None  # of the process, points of a shared analysis included
    reference_s: float | None = None  # `measure.worker.reference_s` meanwhile
    work: dict[str, float] = {}  # a frame, by kind (`meshreel.geometry.work`)


class Decoding(msgspec.Struct, frozen=True):
    """Cost of a decode in a fresh process, one thread, processor time."""

    first_frame_ms: float
    frame_ms: float
    vertices: float  # of a frame, mean
    peak_rss_mb: float | None = None
    reference_s: float | None = None  # `measure.worker.reference_s` after the passes


class Row(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, forbid_unknown_fields=True):
    """Measurements of a point, or the reason why there are none."""

    point: Point
    name: str  # of the codec, as it calls itself: points of one name are a curve
    options: Options = {}  # of the codec, its defaults included
    frames: int = 0  # of the sequence
    frame_rate: Positive = 30.0  # 1/s
    measured_frames: list[int] = []
    stream: Stream | None = None
    encoding: Encoding | None = None
    decoding: Decoding | None = None
    metrics: dict[str, float | None] = {}  # by name, over the measured frames; None: not finite
    per_frame: dict[str, list[float | None]] = {}  # by name, for each measured frame
    made_by: Maker | None = None
    source: str | None = None  # digest of a sequence that is none of the benchmark's
    codec_version: str | None = None  # of another distribution's codec
    encoder: str | None = None  # digest of its codec's method (`measure.digests`); None: not recorded
    data: str | None = None  # digest of the sequence's first frame
    failed: str | None = None  # reason why nothing was measured

    @property
    def mbps(self) -> float:
        """Rate: all bytes over the time that the coded frames play."""
        assert self.stream is not None
        return self.stream.bytes * 8 * self.frame_rate / self.stream.coded_frames / 1e6


def read_rows(path: Path) -> list[Row]:
    """Return the rows of a file, each point's last; a last line cut short is left out. InputError for no row."""
    try:
        lines = path.read_bytes().split(b"\n")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); make it with `meshreel-bench run`") from None
    rows = list[Row]()
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            rows.append(msgspec.json.decode(line, type=Row))
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            if number == len(lines) and _is_cut(line):
                continue  # a sweep that was killed while it wrote
            raise InputError(f"{path}, line {number}: not a row: {error}; delete that line") from None
    return join_rows([rows[::-1]])[::-1]


def checked(row: Row) -> Row:
    """Return a row that can be written and read again. InputError where a codec's name or options cannot."""
    try:
        again = msgspec.json.decode(msgspec.json.encode(row), type=Row)
    except (TypeError, ValueError, RecursionError, msgspec.MsgspecError) as error:
        raise InputError(f"codec {row.point.codec!r}: name, options, stages or sizes make no row: {error}") from None
    if (again.name, again.options) != (row.name, row.options):
        raise InputError(f"codec {row.point.codec!r}: options {row.options} are none of JSON's; give numbers and texts")
    return row


def _is_cut(line: bytes) -> bool:
    """Return whether a last line is the beginning of a row."""
    if not (line.startswith(BEGINNING) or BEGINNING.startswith(line)):
        return False
    try:
        msgspec.json.decode(line)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return True
    return False


def join_rows(files: Iterable[Sequence[Row]]) -> list[Row]:
    """Return the rows of several files, each point once: the first that was measured counts."""
    rows = [row for file in files for row in file]
    found: dict[str, Row] = {}
    for row in rows:
        known = found.get(row.point.key)
        if known is None or (known.failed and not row.failed):
            found[row.point.key] = row
    return list(found.values())


def check_writable(path: Path) -> None:
    """Raise InputError where rows cannot be appended to a file, before they are measured."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab"):
            pass
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); choose another file") from None


def append_row(path: Path, row: Row) -> None:
    """Append a row to a file, in the place of a last line that was not written to its end."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a+b") as file:
            file.seek(0)
            data = file.read()
            last = data[data.rfind(b"\n") + 1 :]
            if _is_cut(last):
                file.truncate(len(data) - len(last))
            elif last:
                file.write(b"\n")
            file.write(msgspec.json.encode(row) + b"\n")
    except OSError as error:
        text = f"{path}: cannot be written ({error.strerror or error})"
        raise InputError(f"{text}; free space, or choose another file") from None


def parted(rows: Sequence[Row]) -> tuple[list[Row], list[Row]]:
    """Return the rows of which something was measured, and those of which nothing was."""
    return [row for row in rows if row.failed is None], [row for row in rows if row.failed is not None]
