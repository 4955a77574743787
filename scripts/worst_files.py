"""Builds the most expensive legal file of each form, decodes each in a fresh process, prints what it costs, and appends
one row to docs/reliability.jsonl. Linux and macOS.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import reliability  # noqa: E402

from tests.budget.measure import measured  # noqa: E402
from tests.budget.test_budget import CASES, promised  # noqa: E402


def main() -> int:
    """The exit code: 1 where a file costs more memory than is promised."""
    start, faults, rows = time.monotonic(), 0, []
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            [make] = case.values
            data = make()
            cost = measured(Path(folder) / "worst.reel", data)
            most = promised(data)
            faults += cost.memory > most
            rows.append((cost.memory / 2**20, cost.seconds))
            share = 100 * cost.memory / most
            print(f"{case.id:36} {len(data):7,} bytes {rows[-1][0]:5.0f} MiB ({share:2.0f} %) {cost.seconds:5.2f} s")
    memory, seconds = (max(column) for column in zip(*rows, strict=True))
    reliability.add_row(
        "n bytes of file cost at most 384 MiB + 16 KiB n of memory",
        "python scripts/worst_files.py",
        (len(rows), "worst legal files"),
        faults,
        time.monotonic() - start,
        f"{memory:.0f} MiB and {seconds:.1f} s of processor time at most",
    )
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
