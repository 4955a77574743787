"""Encodes of equal input under settings that must not matter: how many files differ, and where they begin to.

`python scripts/repeat.py [FOLDER[@FRAMES]...] [--bodies N] [--quality Q]... [--preset P]... [--no-rows]`. Each is
a process of its own, which encodes all sequences.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FRAME_RATE = 10.0  # 1/s; with groups of 2 frames and intervals of 4, some groups are predicted
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "IGL_NUM_THREADS", "TBB_NUM_THREADS")
EXACT = "Equal input and options give equal bytes, whatever the threads, cores, workers, locale, hash seed and folder"
KERNELS = "Equal input and options give equal bytes, whatever x86 instructions BLAS, NumPy and the C library choose"


@dataclass(frozen=True, slots=True)
class Setting:
    """A way to run an encode that must not change the file."""

    name: str
    promise: str = EXACT
    environment: dict[str, str] = field(default_factory=dict)
    prefix: tuple[str, ...] = ()
    jobs: int = 1
    folder: str = "."  # in which the process runs, in a folder of its own


def settings() -> Iterator[Setting]:
    """Yield the usual way first, then all others that this machine knows."""
    yield Setting("default")
    for count in (1, 2, 3, 8):
        yield Setting(f"{count} threads", environment=dict.fromkeys(THREADS, str(count)))
    if shutil.which("taskset"):
        yield Setting("one core", prefix=("taskset", "-c", "0"))
    yield Setting("two workers", jobs=2)
    yield Setting("hash seed 7", environment={"PYTHONHASHSEED": "7"})
    yield Setting("locale C", environment={"LC_ALL": "C", "LANG": "C"})
    yield Setting("locale tr_TR", environment={"LC_ALL": "tr_TR.UTF-8"})
    yield Setting("another folder", folder="down/here")
    for kind in ("Prescott", "Nehalem", "Sandybridge", "Haswell", "Zen", "SkylakeX"):
        yield Setting(f"OpenBLAS for {kind}", KERNELS, {"OPENBLAS_CORETYPE": kind})
    yield Setting("NumPy without its dispatch", KERNELS, {"NPY_DISABLE_CPU_FEATURES": " ".join(dispatched())})
    plain = "glibc.cpu.hwcaps=-AVX512F,-AVX512VL,-AVX2,-AVX,-FMA,-FMA4,-ERMS,-SSE4_1,-SSE4_2"
    yield Setting("C library without AVX and FMA", KERNELS, {"GLIBC_TUNABLES": plain})


def dispatched() -> list[str]:
    """Return the groups of instructions that NumPy would use here beyond those it needs."""
    from numpy._core import _multiarray_umath as core

    return [name for name in core.__cpu_dispatch__ if core.__cpu_features__.get(name)]


def write_sequences(folder: Path, bodies: int, given: list[str]) -> list[Path]:
    """Write the frames of all sequences once, so that no setting can change them; return their files."""
    from meshreel.io.sequence import open_sequence
    from tests.small_bodies import body
    from tests.small_scene import scene

    sequences = {f"small body {seed}": body(seed, frames=4) for seed in range(bodies)} | {"small scene": scene(3)}
    for name in given:
        path, _, count = name.partition("@")
        opened = open_sequence(path)
        sequences[Path(path).stem] = [opened[k] for k in range(min(int(count or 4), len(opened)))]
    for name, frames in sequences.items():
        arrays = [(mesh.vertices, mesh.faces) for mesh in frames]
        (folder / name).write_bytes(pickle.dumps(arrays))
    return [folder / name for name in sequences]


def run(setting: Setting, out: Path, work: list[tuple[str, str, float]]) -> dict[str, str]:
    """Encode all work under a setting; return the digest of each file."""
    folder = out / "runs" / setting.folder
    folder.mkdir(parents=True, exist_ok=True)
    command = [*setting.prefix, sys.executable, str(Path(__file__).resolve()), "--work"]
    environment = {k: v for k, v in os.environ.items() if k not in THREADS} | setting.environment
    relative = [(os.path.relpath(path, folder), *others) for path, *others in work]
    asked = json.dumps([relative, str(out / setting.name), setting.jobs])
    done = subprocess.run(
        [*command, asked], cwd=folder, env=environment | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True
    )
    if done.returncode:
        sys.exit(f"repeat: {setting.name}: {done.stderr[-2000:]}")
    return json.loads(done.stdout)


def encode_all(work: list[tuple[str, str, float]], out: Path, jobs: int) -> dict[str, str]:
    """Encode all work in this process; return the digest of each file."""
    from meshreel.cli.encode import workers
    from meshreel.encoder.sequence import Encoder
    from meshreel.encoder.settings.settings import Settings
    from meshreel.types import Mesh, MeshList
    from tests.small_options import small

    out.mkdir()
    found = {}
    with workers(jobs) as executor:
        for path, preset, quality in work:
            frames = tuple(Mesh.of(*arrays) for arrays in pickle.loads(Path(path).read_bytes()))
            name = f"{Path(path).name} {preset} {quality:g}"
            with (out / f"{name}.jsonl").open("w", encoding="utf-8") as lines:
                encoder = Encoder(MeshList(frames, FRAME_RATE), executor, digests=lines.write)
                interval = 0.4 if preset == "best" else None
                options = Settings(preset, quality, group_size=2, key_interval=interval).resolved()
                options = small(options) if name.startswith("small") else options
                encoder.encode(out / f"{name}.reel", options)
            found[name] = hashlib.sha256((out / f"{name}.reel").read_bytes()).hexdigest()
    return found


def first_difference(one: Path, other: Path) -> str:
    """Return the first line in which two files of digests differ."""
    lines = [path.read_text(encoding="utf-8").splitlines() for path in (one, other)]
    return next((a for a, b in zip(*lines, strict=False) if a != b), "no stage: only the bytes around the groups")


def compare(out: Path, work: list[tuple[str, str, float]]) -> dict[str, tuple[int, int, float]]:
    """Run all settings and print what differs; return the encodes, the different files and the seconds by promise."""
    counts, wanted, usual = dict[str, tuple[int, int, float]](), dict[str, str](), ""
    for setting in settings():
        began = time.monotonic()
        found = run(setting, out, work)
        wanted, usual = (wanted, usual) if wanted else (found, setting.name)
        different = [name for name in found if found[name] != wanted[name]]
        print(f"{setting.name}: {len(different)} of {len(found)} files differ", flush=True)
        for name in different:
            print("   ", name, first_difference(out / usual / f"{name}.jsonl", out / setting.name / f"{name}.jsonl"))
        encodes, faults, seconds = counts.get(setting.promise, (0, 0, 0.0))
        spent = seconds + time.monotonic() - began
        counts[setting.promise] = encodes + len(found), faults + len(different), spent
    return counts


def main() -> int:
    """Return 1 if files differ."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folders", nargs="*")
    parser.add_argument("--bodies", type=int, default=4)
    parser.add_argument("--quality", type=float, action="append")
    parser.add_argument("--preset", action="append")
    parser.add_argument("--no-rows", action="store_true")
    parser.add_argument("--work", type=json.loads)
    given = parser.parse_args()
    if given.work:
        work, out, jobs = given.work
        print(json.dumps(encode_all(work, Path(out), jobs)))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "in").mkdir()
        paths = map(str, write_sequences(Path(folder) / "in", given.bodies, given.folders))
        work = list(product(paths, given.preset or ["best", "paper"], given.quality or [50.0]))
        counts = compare(Path(folder), work)
    if not given.no_rows:
        from scripts.reliability import add_row

        for promise, (encodes, faults, seconds) in counts.items():
            note = f"{len(work)} sequences, presets and qualities"
            add_row(promise, " ".join(["./scripts/repeat", *sys.argv[1:]]), (encodes, "encodes"), faults, seconds, note)
    return 1 if any(faults for _, faults, _ in counts.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
