"""A file as browsers play it. In: a .reel file. Out: an address, and what a script of `web/` finds there."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).parents[3]  # of the checkout
WEB = ROOT / "web"


@contextmanager
def playing(file: Path) -> Iterator[str]:
    """Yield the address at which `meshreel play` serves a file meanwhile."""
    play = [sys.executable, "-u", "-m", "meshreel", "play", str(file), "--no-browser", "--json"]
    with subprocess.Popen(play, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            yield json.loads(server.stdout.readline())["addresses"][0]
        finally:
            server.send_signal(signal.SIGINT)
