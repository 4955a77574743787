"""Fresh processes: values come as they are there; a timeout, a crash and an error cost an exception each."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from meshreel_bench.measure.worker import WorkerError, in_fresh_process


def numbers(count):
    yield from range(count)


def ending(how):
    """Yield once, then end in some way."""
    yield os.getpid()
    if how == "crash":
        os.abort()
    if how == "exit":
        os._exit(3)
    if how == "raise":
        raise ValueError("not\ntoday")
    time.sleep(600)


def threads():
    print("codecs may print")
    yield os.environ["OMP_NUM_THREADS"]


def test_values_come_from_another_process_with_one_thread():
    assert list(in_fresh_process(numbers, 3, limit_s=60)) == [0, 1, 2]
    assert list(in_fresh_process(threads)) == ["1"]


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("crash", "ended by signal SIGABRT"),
        ("exit", "ended by exit code 3"),
        ("raise", "^ValueError: not today$"),
        ("hang", "longer than 5 s of wall time"),
    ],
)
def test_a_process_that_ends_or_takes_too_long_says_why(how, reason):
    values = in_fresh_process(ending, how, limit_s=60 if how != "hang" else 5)
    pid = next(values)
    with pytest.raises(WorkerError, match=reason):
        next(values)
    with pytest.raises(OSError, match="No such process"):
        os.kill(pid, 0)


def starting():
    """Yield the process that it has started and leaves."""
    yield subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"]).pid


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("whole", [True, False])
def test_what_a_codec_has_started_ends_with_its_process(whole):
    values = in_fresh_process(starting, limit_s=60)
    pid = next(values)
    assert list(values) == [] if whole else values.close() is None
    deadline = time.monotonic() + 30
    while _runs(pid):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def _runs(pid):
    """Return whether a process runs; one that has ended may wait for its adopter."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
