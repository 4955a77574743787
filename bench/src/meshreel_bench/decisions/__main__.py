"""`python -m meshreel_bench.decisions [FOLDER]`: write the tables of docs/decisions from the rows of measured.jsonl."""

import sys
from pathlib import Path

from .tables import write_tables

if __name__ == "__main__":
    for page in write_tables(Path(*(sys.argv[1:] or ["docs/decisions"]))):
        print(page)
