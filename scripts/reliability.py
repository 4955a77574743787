"""Rows of measured reliability, and the table that docs/reliability.md makes of them.

A campaign calls `add_row` at its end; `reliability.filled()` is the page with the newest row of each promise and unit.
"""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ROWS = ROOT / "docs/reliability.jsonl"
PAGE = ROOT / "docs/reliability.md"
WRITTEN = ("docs/reliability.*", "core/fuzz/corpus")  # by campaigns
KEYS = ("promise", "command", "count", "unit", "faults", "seconds", "version", "note")
MARKED = re.compile(r"(<!-- rows -->\n).*?(<!-- end -->)", re.DOTALL)


def add_row(
    promise: str, command: str, counted: tuple[float, str], faults: int, seconds: float, note: str = ""
) -> None:
    """Append what a campaign measured: `counted` is how many of which unit, `faults` how often the promise broke."""
    values = (promise, command, *counted, faults, round(seconds, 1), _version(), note)
    with ROWS.open("a", encoding="utf-8", newline="\n") as file:
        file.write(json.dumps(dict(zip(KEYS, values, strict=True))) + "\n")


def _version() -> str:
    """Return the commit, marked as dirty where a tracked file differs from it that no campaign writes."""

    def git(*arguments: str) -> str:
        done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
        return done.stdout.strip()

    changed = git("status", "--porcelain", "--untracked-files=no", "--", ".", *(f":!{name}" for name in WRITTEN))
    return (git("rev-parse", "--short", "HEAD") or "unknown") + ("-dirty" if changed else "")


def filled() -> str:
    """Return docs/reliability.md with its table made anew."""
    lines = ROWS.read_text(encoding="utf-8").splitlines() if ROWS.exists() else []
    newest = {(row["promise"], row["unit"]): row for row in map(json.loads, lines)}
    table = ["| promise | command | measured | faults | s | version |", "| --- | --- | ---: | ---: | ---: | --- |"]
    for row in newest.values():
        promise = f"{row['promise']} ({row['note']})" if row["note"] else row["promise"]
        counted = f"{row['count']:,} {row['unit']}"
        cells = (promise, f"`{row['command']}`", counted, f"{row['faults']:,}", f"{row['seconds']:.0f}", row["version"])
        table.append(f"| {' | '.join(cells)} |")
    text = "\n".join(table) + "\n"
    return MARKED.sub(lambda match: match[1] + text + match[2], PAGE.read_text(encoding="utf-8"))
