"""What a row is about beyond names: the content of a sequence of one's own, and the version of somebody else's codec.

In: a point, where its sequence is. Out: what its row says of them; and an error where rows that were measured before
are about others, for then they must not stand for what is asked for now.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from meshreel.errors import InputError

from .bench import Bench
from .codecs import codec_version
from .datasets import own_digest
from .row_form import FAILED
from .rows import Point, Row

SOURCE, VERSION = "source", "codec_version"  # of a row
_SHOWN = 20  # characters of a digest or a version


def identity(point: Point, bench: Bench) -> Row:
    """What a row says of its sequence and codec, where names do not say it."""
    found = {SOURCE: own_digest(point.sequence, bench.data, bench.own), VERSION: codec_version(point.codec)}
    return {key: told for key, told in found.items() if told is not None}


def changed(row: Row, expected: Mapping[str, str | None], bench: Bench) -> str | None:
    """Why a row that has come is not of the sequence that its sweep began with (its digest by name); None if it is."""
    began = expected.get(row["sequence"])
    if began is None:
        return None
    try:
        now = own_digest(row["sequence"], bench.data, bench.own)
    except InputError as error:
        return f"the sequence has changed since the sweep began: {error}"
    if now == began == row.get(SOURCE, began):
        return None
    return f"the sequence has changed since the sweep began ({began[:_SHOWN]}, now {str(now)[:_SHOWN]})"


def check_one_source(rows: Sequence[Row]) -> None:
    """Raises InputError where rows of one name are of sequences of different content, which share no curve."""
    sources: dict[str, str] = {}
    for row in rows:
        if (found := row.get(SOURCE)) and sources.setdefault(row["sequence"], found) != found:
            told = f"rows of {row['sequence']} are of sequences of different content, or read in different ways"
            digests = f"{SOURCE} {sources[row['sequence']][:_SHOWN]} and {found[:_SHOWN]}"
            raise InputError(f"{told} ({digests}); make a report of each, or delete the lines of one")


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
