"""Cost of playing in a browser that is slowed down, in place of a headset; decoding for aarch64.

Values are those of the player's `?bench` page in headless Chromium, by `web/headset.mjs`.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource
from meshreel.edit.edits import concat
from meshreel.errors import InputError

from ..experiments.headset import AARCH64, HOLDS

SECONDS = 3.0  # of playing that is measured
BUFFERED = 3.0  # s that the player decodes ahead, and that come before the measured ones
Values = dict[str, float | None]


def headset_values(data: bytes, level: int, throttle: float, rate: float) -> Values:
    """Return the cost of playing levels up to `level`; the better of two tries if the first loses pictures.

    InputError without the checkout, Node or Chromium.
    """
    with tempfile.TemporaryDirectory() as name:
        once, long = Path(name, "once.reel"), Path(name, "long.reel")
        once.write_bytes(data)
        reader = ReelReader(BytesSource(data))
        concat([once] * ceil((SECONDS + BUFFERED) * reader.header.frame_rate / reader.frame_count), long)
        with playing(long) as address:
            query = f"{address}?layers={level}&controls=0"
            command = ["node", "headset.mjs", query, *map(str, (SECONDS, throttle, rate))]
            tries = list[dict[str, float]]()
            while len(tries) < 2 and not (tries and tries[0]["shown_share"] >= HOLDS):
                tries.append(_values(json.loads(_output(command, WEB)), rate))
    best = max(tries, key=lambda values: values["shown_share"])  # other jobs only take pictures away
    return {**best}


def _values(found: dict[str, Any], rate: float) -> dict[str, float]:
    report, pictures = found["report"], found["pictures"]
    return {
        "decode_group_ms": report["decodeMs"]["median"],
        "decode_load": report["decodeLoad"],
        "main_ms": float(np.median(pictures)),
        "main_99_ms": float(np.percentile(pictures, 99)),
        "dropped": report["dropped"],
        "fps": found["drawn"] / found["seconds"],
        "shown_share": min(found["drawn"] / (found["seconds"] * rate), 1.0),
        "heap_mb": found["heap"] / 1e6,
        "upload_mb_s": found["uploaded"] / found["seconds"] / 1e6,
        "triangles": report["triangles"],
    }


def aarch64_values(data: bytes) -> Values:
    """Return whether a decoder for aarch64, under QEMU, returns the same frames as this machine's, to the bit."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name, "file.reel")
        path.write_bytes(data)
        told = _output([str(ROOT / "scripts" / AARCH64), str(path)], ROOT, PYTHON=sys.executable)
    size, _, same = told.splitlines()[0].rsplit(": ", 1)[1].split(", ")[:3]
    return {"decoded_mb": int(size.split()[0]) / 1e6, "same": float(same.startswith("equal"))}


def _output(command: list[str], folder: Path, **environment: str) -> str:
    known = {**os.environ, **environment}
    try:
        done = subprocess.run(command, cwd=folder, env=known, capture_output=True, text=True, check=True)
    except FileNotFoundError as error:
        raise InputError(f"{command[0]}: {error.strerror}; run in a checkout, after `scripts/setup web`") from None
    except subprocess.CalledProcessError as error:
        text = f"{command[0]} failed: {(error.stderr or error.stdout)[-200:]}"
        raise InputError(f"{text}; `scripts/setup web` brings what it needs") from None
    return done.stdout


ROOT = Path(__file__).parents[4]  # of the checkout
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
