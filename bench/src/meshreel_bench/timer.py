"""Processor time by stage, and what keeps a process to one thread, so that such times can be compared."""

from __future__ import annotations

import time

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # environment of a process that is timed


class StageTimer:
    """A progress callback that charges processor time to the stage that reports."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._start = self._last = time.process_time()

    def __call__(self, stage: str, _done: int, _total: int) -> None:
        """The time since the last report belongs to `stage`."""
        now = time.process_time()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now

    def stop(self) -> float:
        """Processor time since the start, s."""
        return time.process_time() - self._start
