"""Processor time by stage, the time of a fixed loop meanwhile, work, peak memory, and the machine of this process."""

from __future__ import annotations

import builtins
import os
import platform
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from meshreel import __version__
from meshreel.encoder.group.digests import processor
from meshreel.geometry.work import since, so_far

from ..rows import Encoding, Maker

NUMBERS, STEPS = 200_000, 200_000  # of the fixed loop
SAMPLES, PAUSE = 5, 1.0  # of the loop before and after what is measured, and s between two meanwhile (guess)
ON_TIME = hasattr(signal, "setitimer")  # not on Windows
LATE = ("scipy.spatial", "scipy.sparse.csgraph", "fast_simplification", "igl")  # imported where needed


def reference_s() -> float:
    """Return the processor time of a fixed loop that sorts, sums and counts, s: the speed of the machine at present."""
    numbers = np.random.default_rng(0).random(NUMBERS)
    start, total = time.process_time(), 0
    np.cumsum(numbers[np.argsort(numbers)])
    for number in range(STEPS):
        total += number ^ (number >> 3)
    return time.process_time() - start


class StageTimer:
    """Progress callback that charges processor time to the stage that reports.

    As a context manager it also counts work, and runs the fixed loop before, after and meanwhile, for a machine that
    others use is slower at times. The loop and imports are not charged.
    """

    def __enter__(self) -> StageTimer:
        self.stages: dict[str, float] = {}
        self.references = [reference_s() for _ in range(SAMPLES)]
        self._work, self._apart = so_far(), 0.0
        self._import, builtins.__import__ = builtins.__import__, self._late
        self._start = self._last = time.process_time()
        if ON_TIME:
            signal.signal(signal.SIGALRM, self._sample)  # on this thread, so that nothing runs beside the loop
            signal.setitimer(signal.ITIMER_REAL, PAUSE)
        return self

    def __call__(self, stage: str, _done: int, _total: int) -> None:
        """Charge the time since the last report to `stage`."""
        now = time.process_time() - self._apart
        self.stages[stage] = self.stages.get(stage, 0.0) + now - self._last
        self._last = now

    def __exit__(self, *_error: object) -> None:
        if ON_TIME:
            signal.signal(signal.SIGALRM, signal.SIG_IGN)  # first: a sample that is due would start the timer again
            signal.setitimer(signal.ITIMER_REAL, 0)
        builtins.__import__ = self._import
        self.seconds, self.work = time.process_time() - self._apart - self._start, since(self._work)
        self.references += [reference_s() for _ in range(SAMPLES)]

    def _late(self, name: str, *rest: Any, **named: Any) -> Any:
        """Import a module; what is imported where it is first needed is not charged."""
        is_late = name in LATE and name not in sys.modules
        start, module = time.process_time(), self._import(name, *rest, **named)
        self._apart += is_late * (time.process_time() - start)
        return module

    def _sample(self, *_signal: object) -> None:
        start = time.process_time()
        self.references.append(reference_s())
        self._apart += time.process_time() - start
        signal.setitimer(signal.ITIMER_REAL, PAUSE)


def cost_of(timers: Sequence[StageTimer], frames: int) -> Encoding:
    """Return the cost of a frame while these timers ran, and this process's peak memory."""

    def a_frame(totals: Sequence[Mapping[str, float]]) -> dict[str, float]:
        names = dict.fromkeys(name for total in totals for name in total)
        return {name: sum(total.get(name, 0.0) for total in totals) / frames for name in names}

    references = [each for timer in timers for each in timer.references]
    seconds, work = sum(timer.seconds for timer in timers) / frames, a_frame([timer.work for timer in timers])
    stages = a_frame([timer.stages for timer in timers])
    return Encoding(seconds, stages, peak_rss_mb(), float(np.mean(references)), work)


def peak_rss_mb() -> float | None:
    """Return the largest resident set of this process so far, MB; None where the platform has no such figure."""
    status = Path("/proc/self/status")
    if status.exists():  # Linux: getrusage would give a child its parent's peak
        [line] = [line for line in status.read_text().splitlines() if line.startswith("VmHWM:")]
        return int(line.split()[1]) * 1024 / 1e6
    try:
        import resource
    except ImportError:  # Windows
        return None
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


_DIGITS = 12  # of a commit


@cache
def maker() -> Maker:
    """Return version, commit and machine of this process."""
    machine = (platform.platform(), platform.python_version(), processor(), os.cpu_count())
    return Maker(__version__, _commit(), *machine)


def _commit() -> str:
    """Return the commit of the checkout that this package runs from, with + where files differ."""
    here = Path(__file__).resolve().parent
    try:
        head = _git(here, "rev-parse", "HEAD")
        _git(here, "ls-files", "--error-unmatch", Path(__file__).name)
        changed = _git(here, "status", "--porcelain", "--", ":(top)src", ":(top)bench/src", ":(top)core")
    except (OSError, subprocess.SubprocessError):  # no git, or the package is installed
        return "none: installed"
    return head[:_DIGITS] + ("+" if changed else "")


def _git(folder: Path, *words: str) -> str:
    answer = subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=True, timeout=10)
    return answer.stdout.strip()
