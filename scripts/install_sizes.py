"""Installs the wheel of this checkout into new environments, bare and with extras, and prints how large they are.

One JSON line for each: MB of site-packages (bytecode included), by package. `--row` stores what is promised.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
import venv
from importlib.metadata import Distribution, distributions
from pathlib import Path

from scripts.reliability import ROOT, add_row

PIP = (sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check")
MOST = {"": 25.0, "[encode]": 400.0}  # MB beyond NumPy, and in all


def installed(requirement: str, folder: Path) -> dict[str, float]:
    """Install a requirement into a new environment; return the size of each package, MB, the largest first."""
    venv.create(folder)
    python = next(path for name in ("bin/python", "Scripts/python.exe") if (path := folder / name).exists())
    subprocess.run([*PIP, "--python", str(python), "install", requirement], check=True)
    found = next(folder.rglob("site-packages"))
    sizes = {one.metadata["Name"]: size(one) / 1e6 for one in distributions(path=[str(found)])}
    return dict(sorted(sizes.items(), key=lambda item: -item[1]))


def size(one: Distribution) -> int:
    """Return the bytes of a package's files."""
    return sum(path.stat().st_size for file in one.files or () if (path := Path(one.locate_file(file))).is_file())


def main() -> int:
    """Return 1 where an install is larger than promised."""
    started, large = time.monotonic(), 0
    with tempfile.TemporaryDirectory() as place:
        subprocess.run([*PIP, "wheel", str(ROOT), "--no-deps", "-w", place], check=True)
        [wheel] = Path(place).glob("meshreel-*.whl")
        numpy = sum(installed("numpy", Path(place, "numpy")).values())
        for extra, most in MOST.items():
            sizes = installed(f"{wheel}{extra}", Path(place, f"env{extra}"))
            total = sum(sizes.values())
            rounded = {name: round(mb, 1) for name, mb in sizes.items()}
            print(json.dumps({"install": f"meshreel{extra}", "mb": round(total, 1), "packages": rounded}))
            measured, whose = (total, "in all") if extra else (total - numpy, f"beyond the {numpy:.0f} of NumPy")
            large += measured > most
            if "--row" in sys.argv:
                promise = f"`pip install meshreel{extra}` takes at most {most:.0f} MB {whose}"
                counted = (round(measured, 1), "MB")
                took = time.monotonic() - started
                add_row(promise, "python -m scripts.install_sizes --row", counted, int(measured > most), took)
    return int(large > 0)


if __name__ == "__main__":
    sys.exit(main())
