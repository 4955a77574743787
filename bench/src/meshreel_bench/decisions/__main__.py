"""`python -m meshreel_bench.decisions NAME...`: measure decisions again, and rewrite the tables of docs/decisions.

Without a name only the tables are written, from the rows that are there. Decisions on captured bodies take half an hour
each, those on procedural frames minutes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from . import correspondence, fused, procedural, scene, tails, templates
from .rows import Row, Sources, replace_rows
from .tables import write_tables

MEASURE: dict[str, Callable[[Sources], Iterable[Row]]] = procedural.MEASURE | {
    "correspondence": correspondence.measure,
    "template": templates.measure,
    "tails": tails.measure,
    "fused": fused.measure,
    "views": scene.measure_views,
    "backgrounds": scene.measure_backgrounds,
}


def main(arguments: list[str]) -> int:
    """Measure the decisions that are named, then write all tables."""
    parser = argparse.ArgumentParser(
        prog="python -m meshreel_bench.decisions", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("names", nargs="*", choices=[*MEASURE, []], metavar="NAME", help=", ".join(MEASURE))
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the benchmark data")
    parser.add_argument("--cache", type=Path, default=Path("build/scenes"), help="folder in which scenes are kept")
    parser.add_argument("--pages", type=Path, default=Path("docs/decisions"), help="folder of pages and rows")
    given = parser.parse_args(arguments)
    for name in given.names:
        replace_rows(given.pages / "measured.jsonl", name, MEASURE[name](Sources(given.data, given.cache)))
    for page in write_tables(given.pages):
        print(page)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
