"""`python -m meshreel_bench.datasets FOLDER`: rewrite checksums.json from the benchmark data in FOLDER."""

from __future__ import annotations

import sys
from pathlib import Path

from .checksums import TABLE, write_checksums

if __name__ == "__main__":
    write_checksums(Path(sys.argv[1]), Path(__file__).with_name(TABLE))
