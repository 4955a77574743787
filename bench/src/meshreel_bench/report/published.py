"""Numbers of others, each table with its source: the paper's, what its released code reaches, and V-DMC's.

Package data -> tables of systems, and the points of V-DMC as rows of a curve of their own (`anchor_rows`).
"""

from __future__ import annotations

from importlib.resources import files

import msgspec

from ..names import VDMC, VDMC_HERE
from ..rows import Point, Row, Stream

DATA = "published.json"
FRAME_RATE = 30.0  # 1/s, of every sequence of V-DMC's that is shown


class Published(msgspec.Struct, frozen=True):
    """Numbers of a system; None: not published."""

    system: str  # as the source has it
    codec: str  # the curve of ours that stands beside it, or its own
    d2_psnr: float | None = None  # dB
    ssim: float | None = None  # whole pictures, four views
    decode_ms: float | None = None  # a frame
    mbps: float | None = None
    symmetric_psnr: float | None = None  # dB
    normal_error_deg: float | None = None
    ssim_masked: float | None = None
    mpeg_d1_psnr: float | None = None  # dB


class Table(msgspec.Struct, frozen=True):
    """Systems of one source."""

    source: str
    systems: list[Published]
    frames: int | None = None
    sequence: str | None = None  # of ours, in whose plots they are drawn


_TABLES = msgspec.json.decode((files(__package__) / DATA).read_bytes(), type=dict[str, Table])
TABLE_1, TABLE_2 = _TABLES["table_1"].systems, _TABLES["table_2"].systems
RELEASED = {name: _TABLES[name].systems for name in ("dancer", "synthetic4")}
ANCHORS = [table for table in _TABLES.values() if table.sequence is not None]


def anchor_rows(sequence: str | None = None) -> list[Row]:
    """Return V-DMC's points on a sequence of ours, or on all, as rows; only what is published of them is known."""
    return [_row(table, each) for table in ANCHORS if sequence in (None, table.sequence) for each in table.systems]


def _row(table: Table, point: Published) -> Row:
    assert table.sequence is not None and table.frames is not None and point.mbps is not None
    metrics = {
        "d2_psnr_paper": point.d2_psnr,
        "symmetric_psnr": point.symmetric_psnr,
        "normal_error_deg": point.normal_error_deg,
        "ssim_masked": point.ssim_masked,
        "mpeg_d1_psnr": point.mpeg_d1_psnr,
    }
    size = round(point.mbps * 1e6 / 8 * table.frames / FRAME_RATE)
    return Row(
        point=Point(table.sequence, point.codec, {"rate": point.system}, table.frames),
        name=VDMC if point.codec == "vdmc" else VDMC_HERE,
        frames=table.frames,
        frame_rate=FRAME_RATE,
        stream=Stream(size, table.frames),
        metrics={name: number for name, number in metrics.items() if number is not None},
    )
