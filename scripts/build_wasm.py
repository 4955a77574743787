"""Builds core/ to wasm: `build_wasm.py OUT.wasm`. The compiler is ziglang's, from PyPI; its output is reproducible."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SKIPPED = {  # an encoder's
    *("decimation.cpp", "deform.cpp", "deform_equations.cpp", "dense.cpp", "fit.cpp", "fit_equations.cpp"),
    *("integration.cpp", "lists.cpp", "ray_cast.cpp", "surface_tree.cpp", "template.cpp", "text.cpp", "topology.cpp"),
    *("tracking.cpp", "zero.cpp"),
}
# Strict arithmetic, as in CMakeLists.txt. Exceptions are those of the engine, with core/wasm/exceptions.cpp below them.
FLAGS = (
    *("-target", "wasm32-wasi", "-mexec-model=reactor", "-std=c++17", "-O3", "-msimd128", "-s"),
    *("-ffp-contract=off", "-fno-fast-math", "-fno-math-errno", "-fno-trapping-math"),
    *("-fwasm-exceptions", "-mexception-handling", "-fno-rtti"),
    *("-DEIGEN_DONT_VECTORIZE", "-DEIGEN_MPL2_ONLY", "-DNDEBUG"),
    # Eigen without `throw`: the order of blocks around one depends on the compiler's memory, and so on paths.
    "-U__EXCEPTIONS",
    *("-Wl,--gc-sections", "-Wl,-z,stack-size=1048576"),
)


def eigen() -> Path:
    """Eigen's headers, of the PyPI package cmeel-eigen."""
    places = [Path(entry) / "cmeel.prefix/include/eigen3" for entry in sys.path]
    found = next((place for place in places if place.is_dir()), None)
    if found is None:
        sys.exit("build_wasm: no Eigen headers; pip install cmeel-eigen")
    return found


def main(arguments: list[str]) -> int:
    """The exit code."""
    if len(arguments) != 1:
        print("usage: build_wasm.py OUT.wasm", file=sys.stderr)
        return 2
    sources = sorted(path for path in (ROOT / "core/src").glob("*.cpp") if path.name not in SKIPPED)
    sources += [path for folder in ("core/decoder", "core/wasm") for path in sorted((ROOT / folder).glob("*.cpp"))]
    names = (ROOT / "core/wasm/exports.txt").read_text(encoding="utf-8").split()
    includes = [f"-I{ROOT / 'core/include'}", "-isystem", str(eigen())]
    out = Path(arguments[0])
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent) as folder:
        made = Path(folder) / "core.wasm"
        exports = [f"-Wl,--export={name}" for name in names]
        compiler = [sys.executable, "-m", "ziglang", "c++", *FLAGS, *includes, *exports]
        subprocess.run([*compiler, *map(str, sources), "-o", str(made)], check=True)
        made.chmod(0o644)  # the linker thinks it can be run
        made.replace(out)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
