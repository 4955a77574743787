"""Benchmarks are not run here, which takes captured data and hours; but they do not rot unseen."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_what_every_benchmark_imports_is_there() -> None:
    folder = ROOT / "benchmarks"
    names = sorted(path.stem for path in folder.glob("*.py"))
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (folder, ROOT)))}
    command = [sys.executable, "-c", f"import {', '.join(names)}"]
    answer = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert len(names) > 10 and answer.returncode == 0, answer.stderr
