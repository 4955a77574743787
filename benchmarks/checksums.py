"""Writes the checksums of the benchmark data: `python benchmarks/checksums.py DATA`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from meshreel_bench.datasets import BODIES, PERFORMERS, RECORDED, RECORDINGS, checksums
from meshreel_bench.datasets.rooms import PEOPLE, ROOM

BODIES_ALONE = ("collision",)


def main(data: Path) -> None:
    """The table of all that has a name."""
    bodies = dict.fromkeys((*BODIES, *PEOPLE, *BODIES_ALONE))
    paths = [
        next(p for p in (Path(PERFORMERS, b), Path(PERFORMERS, f"{b}.npz")) if (data / p).exists()) for b in bodies
    ]
    paths += [ROOM, *(Path(RECORDED, name) for name in RECORDINGS)]
    table = {path.as_posix(): checksums.checksum(data / path) for path in paths}
    target = Path(checksums.__file__).with_name(checksums.TABLE)
    target.write_text(json.dumps(table, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def _places(body: str) -> tuple[Path, Path]:
    return Path(PERFORMERS, body), Path(PERFORMERS, f"{body}.npz")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
