"""Fills FORMAT.md's tables from meshreel.format.layout; with --check changes nothing and fails where they are stale."""

from __future__ import annotations

import sys
from pathlib import Path

from meshreel.format.describe import fill_tables
from meshreel.format.layout import PAYLOADS, RECORDS

DOCUMENT = Path(__file__).resolve().parents[1] / "FORMAT.md"


def main(arguments: list[str]) -> int:
    """The exit code: 1 where --check finds a difference."""
    if arguments not in ([], ["--check"]):
        print("usage: scripts/generate [--check]", file=sys.stderr)
        return 2
    before = DOCUMENT.read_text(encoding="utf-8")
    after = fill_tables(before, RECORDS + PAYLOADS)
    if arguments and after != before:
        print("FORMAT.md is stale: run scripts/generate", file=sys.stderr)
        return 1
    if after != before:
        DOCUMENT.write_text(after, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
