"""Writes tests/durations.json from the reports of `./scripts/test --all` in build/tests, and prints what takes longest.

`python -m scripts.durations [REPORT.xml...]`: JUnit reports of pytest and vitest; of files without a report the last
durations stay. Seconds are of CPU time for Python and of the clock for the player.
"""

from __future__ import annotations

import json
import sys
import xml.etree.ElementTree as ElementTree
from collections import defaultdict
from pathlib import Path

from tests.durations import LONGEST

ROOT = Path(__file__).resolve().parents[1]
RECORDED = ROOT / "tests" / "durations.json"
REPORTS = ROOT / "build" / "tests"
PRINTED = 15  # tests


def read_report(path: Path) -> dict[tuple[str, str], float]:
    """Return the seconds of each test by its file, relative to the repository, and its name."""
    seconds = dict[tuple[str, str], float]()
    for case in ElementTree.parse(path).getroot().iter("testcase"):
        measured = case.find("properties/property[@name='cpu']")
        file, name = place(case.get("classname", "")), case.get("name", "")
        seconds[file, name] = float(case.get("time", "0") if measured is None else measured.get("value", "0"))
    return seconds


def place(classname: str) -> str:
    """Return the file of a test: pytest gives a module's name, vitest a path in web/."""
    if classname.endswith(".ts"):
        return f"web/{classname}"
    return next((f"{path}.py" for path in parents(classname) if (ROOT / f"{path}.py").is_file()), classname)


def parents(module: str) -> list[str]:
    """Return a module's path and those above it: a test within a class has the class's name behind the module's."""
    names = module.split(".")
    return ["/".join(names[:count]) for count in range(len(names), 0, -1)]


def record(seconds: dict[tuple[str, str], float]) -> dict[str, dict[str, float]]:
    """Return the contents of durations.json: files, and long tests; without files that are gone."""
    files = defaultdict[str, float](float)
    for (file, _), taken in seconds.items():
        files[file] += taken
    known = json.loads(RECORDED.read_text(encoding="utf-8")) if RECORDED.exists() else {"files": {}, "tests": {}}
    kept = {test: taken for test, taken in known["tests"].items() if test.split("::")[0] not in files}
    long = {f"{file}::{name}": taken for (file, name), taken in seconds.items() if taken > LONGEST}
    merged = {"files": known["files"] | dict(files), "tests": kept | long}
    return {
        kind: {name: round(taken, 1) for name, taken in sorted(rows.items()) if (ROOT / name.split("::")[0]).exists()}
        for kind, rows in merged.items()
    }


def main() -> None:
    """Write the durations of the named reports, or of all in build/tests."""
    reports = [Path(name) for name in sys.argv[1:]] or sorted(REPORTS.glob("*.xml"))
    if not reports:
        sys.exit(f"durations: no reports in {REPORTS}; run ./scripts/test --all first")
    seconds = {test: taken for report in reports for test, taken in read_report(report).items()}
    RECORDED.write_text(json.dumps(record(seconds), indent=0, ensure_ascii=False) + "\n", encoding="utf-8")
    print(f"{sum(seconds.values()):.0f} s in {len(seconds)} tests; longest:")
    for (file, name), taken in sorted(seconds.items(), key=lambda pair: -pair[1])[:PRINTED]:
        print(f"{taken:7.1f} s  {file}::{name}")


if __name__ == "__main__":
    main()
