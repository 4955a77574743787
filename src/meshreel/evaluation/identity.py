"""What a row is about beyond names: the content of a sequence of one's own, and the version of somebody else's codec.

In: a point, where its sequence is. Out: what its row says of them; and an error where rows that were measured before
are about others, for then they must not stand for what is asked for now.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ..errors import InputError
from .bench import Bench
from .codecs import codec_version
from .datasets import own_digest
from .rows import FAILED, Point, Row

SOURCE, VERSION = "source", "codec_version"  # of a row
_SHOWN = 20  # characters of a digest or a version


def identity(point: Point, bench: Bench) -> Row:
    """What a row says of its sequence and codec, where names do not say it."""
    found = {SOURCE: own_digest(point.sequence, bench.data, bench.own), VERSION: codec_version(point.codec)}
    return {key: told for key, told in found.items() if told is not None}


def check_same(points: Sequence[Point], known: Mapping[str, Row], bench: Bench, file: Path) -> None:
    """Raises InputError where the row of a point in the file is about other content, or lacks what is asked for."""
    for point in points:
        row = known.get(point.key, {FAILED: "not there"})
        if FAILED in row:
            continue
        what = f"{file}: {point.sequence} {point.codec}"
        if bench.comparison.ssim and "d2_psnr_paper" in row and "ssim" not in row:
            raise InputError(f"{what} was measured without pictures; say --no-ssim, or give another file for the rows")
        for key in (SOURCE, VERSION) if {SOURCE, VERSION} & set(row) else ():
            told = identity(point, bench).get(key)
            if key in row and row[key] != told:
                name = "sequence, frames, scale or rate" if key == SOURCE else "version of the codec"
                text = f"{what} was measured of another {name} ({row[key][:_SHOWN]}, now {str(told)[:_SHOWN]})"
                raise InputError(f"{text}; give another file for the rows, or delete those lines")
