"""Points measured in processes of their own: who crashes, hangs or returns nonsense costs a row, and not the sweep.

In: a point, where its sequence is, a limit. Out: its row, or one that says why there is none (`FAILED`).
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from .rows import FAILED, Point, Row

if TYPE_CHECKING:  # the runner calls what is here
    from .runner import Bench

_LAST = 300  # characters of what a process said last
_RUNNING: set[subprocess.Popen[bytes]] = set()


def measure_apart(point: Point, bench: Bench, rows: Sequence[Row] = ()) -> Row:
    """The row of a point, measured in a fresh process that may take `bench.limit_s`; `rows` are those before it."""
    head: Row = {"point": point.key, "kind": point.kind, "experiment": bench.experiment}
    head |= {"sequence": point.sequence, "codec": point.codec, "options": point.options}
    with tempfile.TemporaryDirectory(prefix="meshreel-") as folder:
        answer = Path(folder) / "row.json"
        task = pickle.dumps((point, bench, list(rows), answer))
        process = subprocess.Popen(
            [sys.executable, "-m", "meshreel.evaluation.apart"],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,  # with all that it starts it is ended by one signal
        )
        _RUNNING.add(process)
        try:
            said = process.communicate(task, timeout=bench.limit_s)[1]
        except subprocess.TimeoutExpired:
            _end(process)
            return head | {FAILED: f"took longer than {bench.limit_s:g} s of wall time"}
        except BaseException:
            _end(process)
            raise
        finally:
            _RUNNING.discard(process)
        if process.returncode != 0 or not answer.exists():
            return head | {FAILED: _reason(process.returncode, said)}
        return dict(json.loads(answer.read_text(encoding="utf-8")))


def end_all() -> None:
    """Ends what other threads wait for; their rows say so, and are to be thrown away."""
    for process in list(_RUNNING):
        _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Ends a process and, where the system can, those that it has started."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError):  # it has just ended
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()


def _reason(code: int, said: bytes) -> str:
    lines = said.decode(errors="replace").strip().splitlines()
    ended = f"ended by signal {-code}" if code < 0 else f"exit code {code}"
    return f"{ended}: {lines[-1][:_LAST]}" if lines else ended


def main() -> None:
    """In the fresh process: a task from standard input, pickled by whoever started it; the row into its file."""
    from .runner import measure_point

    point, bench, rows, answer = pickle.load(sys.stdin.buffer)
    row = measure_point(point, bench, rows)
    answer.write_text(json.dumps(row, allow_nan=False), encoding="utf-8")


if __name__ == "__main__":
    main()
