"""Installs the wheel of this checkout into new environments, bare and with extras, and prints how large they are.

One JSON line for each: MB in site-packages (bytecode included), by package, and what lies elsewhere: programs,
headers and a library of DracoPy, which decoding does not use. `--row` stores what is promised.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
import venv
from importlib.metadata import distributions
from pathlib import Path

from scripts.reliability import ROOT, add_row

PIP = (sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check")
MOST = {"": 25.0, "[encode]": 400.0}  # MB beyond NumPy, and in all


def installed(requirement: str, folder: Path) -> tuple[dict[str, float], float]:
    """Install a requirement into a new environment.

    Return the size of each package in site-packages, MB, the largest first, and what all have elsewhere.
    """
    venv.create(folder)
    python = next(path for name in ("bin/python", "Scripts/python.exe") if (path := folder / name).exists())
    subprocess.run([*PIP, "--python", str(python), "install", requirement], check=True, stderr=subprocess.DEVNULL)
    place = next(folder.rglob("site-packages")).resolve()
    sizes, elsewhere = dict[str, float](), 0.0
    for one in distributions(path=[str(place)]):
        for path in (Path(one.locate_file(file)).resolve() for file in one.files or ()):
            megabytes = path.stat().st_size / 1e6 if path.is_file() else 0.0
            if path.is_relative_to(place):
                sizes[one.metadata["Name"]] = sizes.get(one.metadata["Name"], 0.0) + megabytes
            else:
                elsewhere += megabytes
    return dict(sorted(sizes.items(), key=lambda item: -item[1])), elsewhere


def main() -> int:
    """Return 1 where an install is larger than promised."""
    started, large = time.monotonic(), 0
    with tempfile.TemporaryDirectory() as place:
        subprocess.run([*PIP, "wheel", str(ROOT), "--no-deps", "-w", place], check=True, stderr=subprocess.DEVNULL)
        [wheel] = Path(place).glob("meshreel-*.whl")
        numpy = sum(installed("numpy", Path(place, "numpy"))[0].values())
        for extra, most in MOST.items():
            sizes, elsewhere = installed(f"{wheel}{extra}", Path(place, f"env{extra}"))
            total = sum(sizes.values())
            rounded = {name: round(mb, 1) for name, mb in sizes.items()}
            line = {"install": f"meshreel{extra}", "mb": round(total, 1), "mb_elsewhere": round(elsewhere, 1)}
            print(json.dumps(line | {"packages": rounded}))
            measured, whose = (total, "in all") if extra else (total - numpy, f"beyond the {numpy:.0f} of NumPy")
            large += measured > most
            if "--row" in sys.argv:
                promise = f"`pip install meshreel{extra}` takes at most {most:.0f} MB of site-packages {whose}"
                counted, took = (round(measured, 1), "MB"), time.monotonic() - started
                note = f"and {elsewhere:.0f} MB elsewhere, programs, headers and a library of DracoPy"
                add_row(promise, "python -m scripts.install_sizes --row", counted, int(measured > most), took, note)
    return int(large > 0)


if __name__ == "__main__":
    sys.exit(main())
