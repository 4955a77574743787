"""Compares the conformance files as decoded for aarch64, under QEMU, with this machine and the golden digests.

Or other files, which have no golden digests, where some are named.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import subprocess
import sys
import tempfile
from array import array
from collections.abc import Iterator
from pathlib import Path

from build_wasm import ROOT, eigen

COMPILERS = {
    "aarch64": [sys.executable, "-m", "ziglang", "c++", "-target", "aarch64-linux-musl"],
    "here": [os.environ.get("CXX", "c++")],
}
RUNNERS = {"aarch64": ["qemu-aarch64-static"], "here": []}
# As strict_arithmetic.cmake has them.
STRICT = (
    *("-std=c++17", "-O2", "-ffp-contract=off", "-fno-fast-math", "-fno-math-errno", "-fno-trapping-math"),
    *("-DEIGEN_DONT_VECTORIZE", "-DEIGEN_MPL2_ONLY"),
)
SPLATS = 1e-9  # as tests/test_conformance.py has it: sines are of another library
GOLDEN = ROOT / "conformance" / "v1"


def sources() -> list[Path]:
    """The sources of the decoder's library, as its CMakeLists.txt lists them."""
    text = (ROOT / "core/decoder/CMakeLists.txt").read_text(encoding="utf-8")
    listed = re.search(r"add_library\(meshreel_objects OBJECT([^)]*)\)", text)
    assert listed is not None
    names = listed[1].replace("${CORE}", "../src").split()
    return [ROOT / "core/decoder" / name for name in names]


def build(machine: str, folder: Path) -> Path:
    """Compile the program for a machine."""
    program = folder / machine
    compiler = [*COMPILERS[machine], *STRICT, "-DMESHREEL_STATIC", "-static"]  # so that QEMU needs no libraries
    includes = [f"-I{ROOT / 'core/include'}", "-isystem", str(eigen())]
    parts = [*sources(), ROOT / "core/tests/frame_bytes.cpp"]
    subprocess.run([*compiler, *includes, *map(str, parts), "-o", str(program)], check=True)
    return program


def decode(machine: str, program: Path, path: Path) -> tuple[bytes, ...]:
    """The bytes of a file's frames, those of its parts, and the numbers of its splats."""
    outputs = [program.parent / f"{machine}.{kind}" for kind in ("frames", "parts", "splats")]
    subprocess.run([*RUNNERS[machine], str(program), str(path), *map(str, outputs)], check=True)
    return tuple(output.read_bytes() for output in outputs)


def digests(frames: bytes) -> Iterator[tuple[str, str]]:
    """Yield the digests of each frame's positions and faces."""
    at = 0
    while at < len(frames):
        vertices, faces = (int.from_bytes(frames[k : k + 8], "little") for k in (at, at + 8))
        middle, end = at + 16 + 24 * vertices, at + 16 + 24 * vertices + 12 * faces
        yield hashlib.sha256(frames[at + 16 : middle]).hexdigest(), hashlib.sha256(frames[middle:end]).hexdigest()
        at = end


def apart(a: bytes, b: bytes) -> float:
    """The largest difference of numbers."""
    if len(a) != len(b):
        return math.inf
    return max((abs(x - y) for x, y in zip(array("d", a), array("d", b), strict=True)), default=0.0)


def main() -> int:
    """The exit code."""
    bad = 0
    with tempfile.TemporaryDirectory() as name:
        programs = {machine: build(machine, Path(name)) for machine in COMPILERS}
        header = programs["aarch64"].read_bytes()[:20]
        assert header[:4] == b"\x7fELF" and header[18] == 0xB7, "not a program for aarch64"
        for path in list(map(Path, sys.argv[1:])) or sorted(GOLDEN.rglob("*.reel")):
            there, here = (decode(machine, programs[machine], path) for machine in COMPILERS)
            known, found = path.with_suffix(".json"), list(digests(there[0]))
            wanted = json.loads(known.read_text(encoding="utf-8")) if known.exists() else {}
            golden = "no digests of whole frames"
            if "frames_with_one_component" in wanted:
                rows = [*wanted["frames"], *wanted["frames_with_one_component"]]
                same = found == [(row["vertices_sha256"], row["faces_sha256"]) for row in rows]
                golden = f"{len(rows)} golden digests {'agree' if same else 'DIFFER'}"
                bad += not same
            same = there[:2] == here[:2] and apart(there[2], here[2]) <= SPLATS
            bad += not same
            digest = hashlib.sha256(there[0] + there[1]).hexdigest()[:16]
            equal = "equal" if same else "DIFFERENT"
            splats = f", splats to {apart(there[2], here[2]):.1g}" if there[2] else ""
            name = path.relative_to(GOLDEN) if path.is_relative_to(GOLDEN) else path
            print(f"{name}: {len(there[0] + there[1])} bytes, {digest}, {equal}{splats}; {golden}")
    print("aarch64: all the same" if bad == 0 else f"aarch64: {bad} differences")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
