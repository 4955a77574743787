"""Checks that the lower bounds of pyproject.toml are the versions installed in this environment.

`--build` prints the lowest build requirements instead; `--row` stores what scripts/test-versions counted.
"""

from __future__ import annotations

import platform
import re
import sys
import tomllib
import xml.etree.ElementTree as ElementTree
from importlib.metadata import version
from typing import Any

from scripts.reliability import ROOT, add_row

EXTRAS = ("cli", "encode", "demo", "play", "usd", "cluster", "remote")  # which scripts/test-versions installs
FORM = re.compile(r"([\w.-]+)(?:\[\w+\])?>=([\d.]+)")  # of a requirement that is tested here


def requirements() -> list[str]:
    """Return the requirements of meshreel, its extras and the bench, without each other."""
    product, bench = settings("pyproject.toml")["project"], settings("bench/pyproject.toml")["project"]
    lists = [product["dependencies"], *(product["optional-dependencies"][extra] for extra in EXTRAS)]
    return [one for found in (*lists, bench["dependencies"]) for one in found if not one.startswith("meshreel")]


def settings(path: str) -> dict[str, Any]:
    """Return a settings file of the repository."""
    return tomllib.loads((ROOT / path).read_text(encoding="utf-8"))


def untrue() -> list[str]:
    """Return the dependencies whose installed version is not their lower bound, as sentences."""
    found = []
    for requirement in requirements():
        match = FORM.match(requirement)
        if match is None:
            found.append(f"{requirement}: give a lower bound")
        elif numbers(have := version(match[1])) != numbers(match[2]):
            found.append(f"{requirement}: together with the others, {have} is the lowest; make it the bound")
    return found


def numbers(release: str) -> list[int]:
    """Return the numbers of a version without zeros at its end: 2 is 2.0.0."""
    return [int(number) for number in re.findall(r"\d+", re.sub(r"(\.0)+$", "", release))]


def store(which: str, report: str, seconds: float) -> None:
    """Append a row with the counts of pytest's report."""
    suite = next(ElementTree.parse(report).getroot().iter("testsuite"))
    count = {name: int(suite.get(name, "0")) for name in ("tests", "failures", "errors", "skipped")}
    python = ".".join(platform.python_version_tuple()[:2])
    add_row(
        f"With the {which} versions of dependencies, on Python {python}, commands, readers, exports and server work",
        f"./scripts/test-versions {which} {python} --row",
        (count["tests"] - count["skipped"], "tests"),
        count["failures"] + count["errors"],
        seconds,
        f"NumPy {version('numpy')}, SciPy {version('scipy')}, libigl {version('libigl')}",
    )


def main() -> int:
    """Return 1 where a bound is not true."""
    if sys.argv[1:2] == ["--row"]:
        store(sys.argv[2], sys.argv[3], float(sys.argv[4]))
        return 0
    if sys.argv[1:] == ["--build"]:
        for requirement in settings("pyproject.toml")["build-system"]["requires"]:
            print(requirement.replace(">=", "=="))
        return 0
    for sentence in (found := untrue()):
        print(f"check_bounds: {sentence}", file=sys.stderr)
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
