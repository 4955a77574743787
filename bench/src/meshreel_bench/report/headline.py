"""Numbers of the README, from rows: the size of a moving person, and how much smaller it is than by other codecs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import mean, median
from typing import Any

from ..experiments.mpeg import D1
from ..experiments.study import D2, MASKED
from ..names import BEST, DECIMATED, DRACO, TVMC, title
from ..rows import Row
from .bandwidth import vdmc_times
from .equal import rate_ratio
from .values import rated, value

SECONDS = 3.0  # that a person is said to play
QUALITY, MOST = 50.0, 85.0  # the default, and of `best` the highest that counts: more is hardly seen
TRIANGLES = 20_000  # of a frame of PEOPLE: `datasets.remesh` gives each about 10,000 vertices
PEOPLE = ("crane60", "samba60")
BODIES = ("synthetic4", "dancer", "basketball_player", "mitch", "demo")
OTHERS = (DRACO, DECIMATED, TVMC)


def headline(studies: Mapping[str, Sequence[Row]]) -> dict[str, Any]:
    """Return the numbers from the rows of studies by name, ready for JSON; empty where they are not measured."""
    people = [_person(row) for row in studies.get("layers", ()) if _is_person(row)]
    ratios = {title(name): _ratios(studies.get("figure6", ()), name) for name in OTHERS}
    found = {name: own | {"median": round(median(own.values()), 1)} for name, own in ratios.items() if own}
    if not people or not found:
        return {}
    size = round(mean(person["kilobytes"] for person in people))
    person = {"triangles": TRIANGLES, "seconds": SECONDS, "kilobytes": size, "quality": QUALITY, "from": people}
    known = [row for name in ("figure6", "mpeg") for row in studies.get(name, ())]
    vdmc = {measure.key: vdmc_times(known, measure) for measure in (D1, D2, MASKED)}
    return {"person": person, "times_larger_at_equal_d2": found, "vdmc_times": vdmc}


def _is_person(row: Row) -> bool:
    return row.name == BEST and row.point.sequence in PEOPLE and row.options.get("quality") == QUALITY


def _person(row: Row) -> dict[str, Any]:
    """Return the size of `SECONDS` at the rate of a whole sequence."""
    kilobytes = row.mbps * 1e6 / 8 * SECONDS / 1000
    head = {"sequence": row.point.sequence, "frames": row.frames, "bytes": row.stream.bytes if row.stream else 0}
    return head | {"d2_psnr_db": round(value(row, D2.key) or 0.0, 1), "kilobytes": round(kilobytes, 1)}


def _ratios(rows: Sequence[Row], name: str) -> dict[str, float]:
    """Return by body how many times the rate of `best` a codec needs at the median quality of `best`'s points."""
    usual = [row for row in rows if row.name != BEST or float(row.options.get("quality") or 0.0) <= MOST]
    found = {body: rate_ratio(own, name, BEST, D2) for body in BODIES if (own := rated(usual, body))}
    return {body: round(ratio, 2) for body, ratio in found.items() if ratio is not None}
