"""Processor time by stage, and peak memory."""

from __future__ import annotations

import sys
import time
from pathlib import Path


class StageTimer:
    """Progress callback that charges processor time to the stage that reports."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._start = self._last = time.process_time()

    def __call__(self, stage: str, _done: int, _total: int) -> None:
        """Charge the time since the last report to `stage`."""
        now = time.process_time()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now

    def stop(self) -> float:
        """Return the processor time since the start, s."""
        return time.process_time() - self._start


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
