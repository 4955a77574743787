"""Numbers published by others, or measured of their released code, beside which ours stand.

They are package data, each table with its source. Nothing in them was measured by this package.
"""

from __future__ import annotations

from importlib.resources import files

import msgspec

DATA = "published.json"  # package data: the paper's tables, and what its released code reaches on two sequences


class Published(msgspec.Struct, frozen=True):
    """Numbers of a system; None: not published."""

    system: str  # as the source has it
    codec: str  # the curve of ours that stands beside it
    d2_psnr: float  # dB
    ssim: float | None = None  # whole pictures, four views
    decode_ms: float | None = None  # a frame
    mbps: float | None = None


class Table(msgspec.Struct, frozen=True):
    """Systems of one source."""

    source: str
    systems: list[Published]


_TABLES = msgspec.json.decode((files(__package__) / DATA).read_bytes(), type=dict[str, Table])
TABLE_1, TABLE_2 = _TABLES["table_1"].systems, _TABLES["table_2"].systems
RELEASED = {name: _TABLES[name].systems for name in ("dancer", "synthetic4")}
