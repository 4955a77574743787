"""Build and run all fuzzers, and print what their corpus reaches: `run.py [SECONDS] [--minimise]`.

Targets in C++ call the core, targets in Python decode whole files over a core built with the same sanitizers. New finds
stay in build/fuzz; `--minimise` then keeps a small corpus that reaches as much, which is committed.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import reach
import seeds
import verdict

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from reliability import add_row  # noqa: E402

CACHE = ROOT / "build" / "fuzz"
NATIVE = tuple(sorted(path.stem for path in Path(__file__).parent.glob("*.cpp")))
PYTHON = tuple(seeds.TARGETS)
PACKAGE = CACHE / "python"  # a copy of the package, whose core has sanitizers
MOST_BYTES = 4096  # of a file; arguments of a call take less
MOST_ARGUMENTS = 2048
OF_PYTHON = 0.4  # share of the time, for targets that are slower by a hundred
MOST_KEPT = 40_000  # bytes of a target's committed corpus (a decision: all of them stay far below 1 MB)
LIMITS = ("-timeout=30", "-rss_limit_mb=2560", "-malloc_limit_mb=1024")  # s, so long for machines that do other things
SANITIZERS = "allocator_may_return_null=1:detect_leaks=0:quarantine_size_mb=8:malloc_context_size=2"


@dataclass
class Outcome:
    """What a target did."""

    executions: int = 0
    seconds: float = 0.0
    faults: int = 0


def main(arguments: list[str]) -> int:
    """The exit code: 1 where a fault was found."""
    parser = argparse.ArgumentParser(prog="scripts/fuzz", description=__doc__)
    parser.add_argument("seconds", type=float, nargs="?", default=60.0, help="of all targets together, on all cores")
    parser.add_argument("--minimise", action="store_true", help="write the committed corpus anew from all finds")
    options = parser.parse_args(arguments)
    build()
    began = time.monotonic()
    outcomes = run_all(options.seconds)
    taken = time.monotonic() - began
    if options.minimise:
        minimise()
    report(outcomes, taken, " ".join(["./scripts/fuzz", *arguments]))
    return 1 if any(outcome.faults for outcome in outcomes.values()) else 0


def build() -> None:
    """Build the targets, the core of the package and the targets that count lines; copy the package; cut the seeds."""
    cmake(ROOT / "core", "native", "-DMESHREEL_FUZZ=ON", "-DMESHREEL_SANITIZE=ON")
    cmake(ROOT / "core", "counting", "-DMESHREEL_FUZZ=ON", "-DMESHREEL_COVERAGE=ON")
    shutil.copytree(
        ROOT / "src" / "meshreel", PACKAGE / "meshreel", ignore=shutil.ignore_patterns("*.so"), dirs_exist_ok=True
    )
    checks = "address,undefined,fuzzer-no-link"  # without two of which atheris' runtime knows nothing
    without = "-fno-sanitize-recover=all -fno-sanitize=vptr,function -fno-sanitize-coverage=trace-cmp"
    flags = f"-O2 -g1 -fsanitize={checks} {without}"
    cmake(ROOT, "package", f"-DCMAKE_CXX_FLAGS={flags}", f"-DCMAKE_LIBRARY_OUTPUT_DIRECTORY={PACKAGE / 'meshreel'}")
    run([sys.executable, str(Path(__file__).parent / "seeds.py"), str(CACHE / "seeds")])


def cmake(source: Path, name: str, *options: str) -> None:
    """Build a CMake project in a folder of the cache."""
    folder = str(CACHE / name)
    given = [f"-DPython_EXECUTABLE={sys.executable}", f"-DEIGEN_INCLUDE={eigen()}", "-DCMAKE_CXX_COMPILER=clang++"]
    kind = ["-DCMAKE_BUILD_TYPE=", "-DCMAKE_CXX_FLAGS=-O2"]
    run(["cmake", "-S", str(source), "-B", folder, "-G", "Ninja", *given, *kind, *options])
    run(["cmake", "--build", folder])


def eigen() -> Path:
    """The folder of Eigen's headers, of the PyPI package cmeel-eigen."""
    return Path(sysconfig.get_path("purelib")) / "cmeel.prefix/include/eigen3"


def run(command: list[str], **settings: object) -> None:
    """Run a command, silent if it succeeds."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, **settings)  # type: ignore[call-overload]
    if done.returncode:
        sys.exit(f"fuzz: {' '.join(command)} failed:\n{done.stdout[-4000:]}{done.stderr[-4000:]}")


def run_all(seconds: float) -> dict[str, Outcome]:
    """Run every target for its share of the time, one on each core."""
    cores = os.cpu_count() or 1
    shares = {target: seconds * cores * (1 - OF_PYTHON) / len(NATIVE) for target in NATIVE}
    shares |= {target: seconds * cores * OF_PYTHON / len(PYTHON) for target in PYTHON}
    with ThreadPoolExecutor(cores) as pool:
        return dict(zip(shares, pool.map(fuzz, shares, shares.values()), strict=True))


def fuzz(target: str, seconds: float) -> Outcome:
    """Run a target; after a fault, whose input stays in build/fuzz/faults, go on."""
    outcome, end = Outcome(), time.monotonic() + seconds
    known = [CACHE / "seeds" / target, verdict.CORPUS / target]
    new, faults = CACHE / "finds" / target, CACHE / "faults" / target
    new.mkdir(parents=True, exist_ok=True)
    faults.mkdir(parents=True, exist_ok=True)
    while (left := end - time.monotonic()) > 1:
        folders = [str(folder) for folder in (new, *known) if folder.is_dir()]
        limits = [
            *LIMITS,
            f"-max_total_time={int(left)}",
            f"-max_len={MOST_BYTES if target in PYTHON else MOST_ARGUMENTS}",
        ]
        began = time.monotonic()
        done = start(target, [*folders, *limits, "-print_final_stats=1", f"-artifact_prefix={faults}/"])
        outcome.seconds += time.monotonic() - began
        counted = re.search(r"stat::number_of_executed_units:\s*(\d+)", done.stderr)
        outcome.executions += int(counted[1]) if counted else 0
        if done.returncode:
            outcome.faults += 1
            (faults / f"report-{outcome.faults}.txt").write_text(done.stderr[-20_000:], encoding="utf-8")
        if not counted and done.returncode:
            break  # it did not even start
    return outcome


def start(target: str, arguments: list[str]) -> subprocess.CompletedProcess[str]:
    """Run the fuzzer of a target."""
    environment = os.environ | {
        "ASAN_OPTIONS": SANITIZERS,
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "OMP_NUM_THREADS": "1",
    }
    command = CACHE / "native" / "fuzz" / f"fuzz_{target}"
    if target in PYTHON:
        command = launcher(target)
        packages = sysconfig.get_path("purelib")
        environment["MESHREEL_MUTATOR"] = str(CACHE / "native" / "fuzz" / "mutator.so")
        environment["LD_PRELOAD"] = f"{packages}/asan_with_fuzzer.so {environment['MESHREEL_MUTATOR']}"
        environment["PYTHONPATH"] = os.pathsep.join([str(PACKAGE), packages])
    given = [str(command), *arguments]
    return subprocess.run(given, env=environment, capture_output=True, text=True, check=False, errors="replace")


def launcher(target: str) -> Path:
    """Write a program that runs a Python target: libFuzzer calls it again to merge a corpus."""
    path = CACHE / "launchers" / target
    path.parent.mkdir(exist_ok=True)
    script = Path(__file__).parent / "decode.py"
    # Without `site` no editable install of the package stands before the copy.
    path.write_text(f'#!/bin/sh\nexec "{sys.executable}" -S "{script}" "{path}" "$@"\n', encoding="utf-8")
    path.chmod(0o755)
    return path


def minimise() -> None:
    """Write the committed corpus: of each target a few small inputs that reach most of what all of them do."""
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        list(pool.map(minimise_target, (*NATIVE, *PYTHON)))
    verdict.main([])


def minimise_target(target: str) -> None:
    merged, kept = CACHE / "merged" / target, verdict.CORPUS / target
    shutil.rmtree(merged, ignore_errors=True)
    merged.mkdir(parents=True)
    folders = [folder / target for folder in (verdict.CORPUS, CACHE / "seeds", CACHE / "finds")]
    given = [str(folder) for folder in folders if folder.is_dir()]
    done = start(
        target, ["-set_cover_merge=1", "-use_value_profile=0", str(merged), *given, *LIMITS, f"-max_len={MOST_BYTES}"]
    )
    if done.returncode:
        sys.exit(f"fuzz: the corpus of {target} cannot be merged:\n{done.stderr[-4000:]}")
    shutil.rmtree(kept, ignore_errors=True)
    kept.mkdir(parents=True)
    paths, left = sorted(merged.iterdir(), key=lambda path: path.stat().st_size), MOST_KEPT
    if target in PYTHON:  # those first without which lines would be missing
        program = [sys.executable, str(Path(__file__).parent / "reach.py"), *map(str, paths)]
        first = subprocess.run(program, check=True, capture_output=True, text=True).stdout.splitlines()
        paths.sort(key=lambda path: str(path) not in first)
    for path in paths:
        left -= path.stat().st_size
        if left < 0:
            break
        suffix = ".reel" if target in PYTHON else ""
        shutil.copyfile(path, kept / f"{path.name[:12]}{suffix}")


def report(outcomes: dict[str, Outcome], seconds: float, command: str) -> None:
    """Print and append what was run and what the committed corpus reaches."""
    print(f"{'target':14} {'executions':>12} {'a second':>9} {'faults':>7}")
    for target, outcome in outcomes.items():
        speed = outcome.executions / max(outcome.seconds, 1e-9)
        print(f"{target:14} {outcome.executions:12,} {speed:9,.0f} {outcome.faults:7}")
    total = sum(outcome.executions for outcome in outcomes.values())
    faults = sum(outcome.faults for outcome in outcomes.values())
    speed = total / max(seconds, 1e-9)
    print(f"{'all':14} {total:12,} {speed:9,.0f} {faults:7}   in {seconds:.0f} s on {os.cpu_count()} cores")
    if faults:
        print(f"inputs and reports: {CACHE / 'faults'}")
    counts = ", ".join(f"{target} {outcome.executions:,}" for target, outcome in outcomes.items())
    promise = "Any bytes are refused with FormatError or decode, twice to the same: no crash, no report of a sanitizer"
    add_row(promise, command, (total, "executions"), faults, seconds, f"{os.cpu_count()} cores; {counts}")
    for side, reached in reach.measured(CACHE, NATIVE).items():
        print(reached)
        for unit in ("lines", "branches"):
            note = f"{reached.hit[unit]} of {reached.all[unit]}; core/fuzz/reach.py names what only an encoder runs"
            counted = (reached.share(unit), f"% of {unit}")
            add_row(f"The committed corpus of the fuzzers reaches {side}", command, counted, 0, seconds, note)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
