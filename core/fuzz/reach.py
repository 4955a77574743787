"""Measure the lines and branches of the decoders that the committed corpus reaches.

In: the folder with the targets built to count lines. Out: a Reached for the core and for Python. What only an encoder
runs is left out by the names below, and the report says so.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import verdict

ROOT = Path(__file__).resolve().parents[2]
# Files and functions that only an encoder, or a compiler, runs.
CORE_FILES = re.compile(r"tracking|prediction|surface_quantizer|rigid3|strict")
CORE_FUNCTIONS = re.compile(
    r"RangeEncoder|mr_encode|mr_weight_contexts|mr_edge_frames|mr_refine|mr_laplacian_(quantize|forward|weights)|shape|shaping|copy_out|learning_rates|sixteenths"
)
PYTHON_FILES = ("coding", "container/reader.py", "format/records.py", "format/kinds.py", "format/checks.py")
PYTHON_LEFT_OUT = re.compile(
    r"encode|forward|\bpack|_pack_items|\bquantize|allocation\.py|\bfit|[lL]abel|least|cost|contexts|code_reference|code_on"
    r"|LayerCodingOptions|_check_input|\breach|run_lengths|_set_out|rung_of|_bits_for|_columns|_Columns|_dual|_only"
    r"|_mean_bits|Rate\.|Graph\.core|Siblings\.graph|hierarchy|orthonormal|_check_steps|_head$(?<!_read_head)"
    r"|decode_(field|group|layers)$"  # which the encoder, and tests, call in place of the decoder
)


@dataclass
class Reached:
    """Counts of lines and branches, those reached and all, and what was left out."""

    side: str
    left_out: str
    hit: dict[str, int] = field(default_factory=lambda: {"lines": 0, "branches": 0})
    all: dict[str, int] = field(default_factory=lambda: {"lines": 0, "branches": 0})
    missed: list[str] = field(default_factory=list)  # "file:line"

    def count(self, unit: str, hit: int, total: int) -> None:
        self.hit[unit] += hit
        self.all[unit] += total

    def share(self, unit: str) -> float:
        """The percentage that is reached."""
        return round(100 * self.hit[unit] / max(self.all[unit], 1), 2)

    def __str__(self) -> str:
        units = ", ".join(f"{self.share(unit)} % of {self.all[unit]} {unit}" for unit in ("lines", "branches"))
        return f"{self.side}: {units}\n  left out: {self.left_out}\n  not reached: {', '.join(self._missed())}"

    def _missed(self) -> list[str]:
        files: dict[str, list[str]] = {}
        for place in self.missed:
            name, line = place.split(":")
            files.setdefault(name, []).append(line)
        return [f"{name} {' '.join(lines)}" for name, lines in files.items()]


def measured(cache: Path, native: Iterable[str]) -> dict[str, Reached]:
    """Return what the committed corpus reaches: of the core by targets in C++, of the package by those in Python."""
    sides = (of_core(cache, tuple(native)), of_python(cache))
    return {reached.side: reached for reached in sides}


def of_core(cache: Path, targets: tuple[str, ...]) -> Reached:
    """Replay the corpus of the C++ targets and count lines and branches of core/."""
    folder, profile = cache / "counting" / "fuzz", cache / "counting" / "corpus.profdata"
    raw = []
    for target in targets:
        raw.append(folder / f"{target}.profraw")
        command = [str(folder / f"fuzz_{target}"), "-runs=0", str(verdict.CORPUS / target)]
        subprocess.run(command, env={"LLVM_PROFILE_FILE": str(raw[-1])}, capture_output=True, check=True)
    subprocess.run([tool("llvm-profdata"), "merge", *map(str, raw), "-o", str(profile)], check=True)
    binaries = [f"-object={folder / f'fuzz_{target}'}" for target in targets]
    reached = Reached(
        "the decode paths of core/", f"without files {CORE_FILES.pattern} and functions {CORE_FUNCTIONS.pattern}"
    )
    sources = [str(path) for name in ("src", "wasm") for path in sorted((ROOT / "core" / name).glob("*.*"))]
    export = [tool("llvm-cov"), "export", binaries[0][8:], *binaries[1:], f"-instr-profile={profile}", *sources]
    exported = json.loads(subprocess.run([*export, "-format=text"], capture_output=True, check=True).stdout)
    functions = exported["data"][0]["functions"]
    kept: dict[str, set[int]] = {}
    left_out: dict[str, set[int]] = {}
    branches: dict[tuple[str, int, int, int], int] = {}  # place and outcome -> how often
    for function in functions:
        name, first = function["filenames"][0], function["regions"][0]
        is_decoder = not (CORE_FILES.search(Path(name).name) or CORE_FUNCTIONS.search(function["name"]))
        (kept if is_decoder else left_out).setdefault(name, set()).update(range(first[0], first[2] + 1))
        for line, column, _, _, yes, no, *_ in function.get("branches", []) if is_decoder else []:
            for outcome, count in enumerate((yes, no)):
                place = (name, line, column, outcome)
                branches[place] = branches.get(place, 0) + count
    lines = subprocess.run([*export, "-format=lcov"], capture_output=True, check=True, text=True).stdout
    name = ""
    for text in lines.splitlines():
        if text.startswith("SF:"):
            name = text[3:]
        elif text.startswith("DA:"):
            line, count = map(int, text[3:].split(",")[:2])
            if line in kept.get(name, set()):
                reached.count("lines", count > 0, 1)
                reached.missed += [] if count else [f"{Path(name).name}:{line}"]
    reached.count("branches", sum(count > 0 for count in branches.values()), len(branches))
    return reached


def counted_files() -> list[str]:
    """Return the patterns of the Python files whose lines count."""
    return [str(ROOT / "src/meshreel" / name) + ("" if name.endswith(".py") else "/*") for name in PYTHON_FILES]


def of_python(cache: Path) -> Reached:
    """Replay the corpus of the Python targets and count lines and branches of the package."""
    data, out = cache / "corpus.coverage", cache / "corpus.json"
    include = ",".join(counted_files())
    coverage = [sys.executable, "-m", "coverage"]
    replay = [str(Path(verdict.__file__)), *map(str, verdict.corpus())]
    subprocess.run(
        [*coverage, "run", "--branch", f"--data-file={data}", f"--include={include}", *replay], check=True, cwd=ROOT
    )
    subprocess.run([*coverage, "json", "-q", f"--data-file={data}", "-o", str(out)], check=True, cwd=ROOT)
    reached = Reached("container, coding and format", f"of {', '.join(PYTHON_FILES)} without {PYTHON_LEFT_OUT.pattern}")
    for path, found in json.loads(out.read_text(encoding="utf-8"))["files"].items():
        for name, function in found["functions"].items():
            if not name or PYTHON_LEFT_OUT.search(f"{Path(path).name} {name}"):  # without a name: definitions
                continue
            counts = function["summary"]
            reached.count("lines", counts["covered_lines"], counts["num_statements"])
            reached.count("branches", counts["covered_branches"], counts["num_branches"])
            reached.missed += [f"{Path(path).name}:{line}" for line in function["missing_lines"]]
    return reached


def reaching_new_lines(names: list[str]) -> Iterable[str]:
    """Yield the files that reach lines of the package which no earlier one reaches."""
    from coverage import Coverage

    known: set[tuple[str, int]] = set()
    for name in names:
        counting = Coverage(data_file=None, include=counted_files())
        with counting.collect():
            verdict.check(Path(name).read_bytes())
        data = counting.get_data()
        lines = {(file, line) for file in data.measured_files() for line in data.lines(file) or ()}
        if not lines <= known:
            known |= lines
            yield name


def tool(name: str) -> str:
    """The path of a tool of LLVM, of the version that compiles."""
    dumped = subprocess.run(["clang++", "-dumpversion"], capture_output=True, text=True, check=True)
    version = dumped.stdout.split(".")[0]
    found = shutil.which(f"{name}-{version}") or shutil.which(name)
    return found or sys.exit(f"fuzz: no {name}; install llvm-{version}")


if __name__ == "__main__":
    print(*reaching_new_lines(sys.argv[1:]), sep="\n")
