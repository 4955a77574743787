"""`python -m meshreel_bench.decisions [FOLDER]`: write the tables of docs/decisions from the rows of measured.jsonl."""

from __future__ import annotations

import sys
from pathlib import Path

from .tables import write_tables


def main(folder: Path = Path("docs/decisions")) -> None:
    """Write the tables of all pages in a folder; print the pages that change."""
    for page in write_tables(folder):
        print(page)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
