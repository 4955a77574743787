"""The attacks of scripts/attack-server, fewer of each kind than its report has."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the extra `play` is not installed")

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no signals for one process on Windows")
def test_no_attack_breaks_a_promise():
    command = [sys.executable, "-m", "scripts.attack_server", "10", "--no-rows"]
    attacked = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=500)
    assert attacked.returncode == 0, attacked.stdout + attacked.stderr
