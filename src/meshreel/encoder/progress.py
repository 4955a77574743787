"""Progress of an encode: frames counted through the stages, reported to a callback."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, int, int], None]  # stage, frames done in it, frames of the sequence


class Stages:
    """Counts frames through the stages and reports the counts to a progress callback."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress = progress
        self._total = total
        self._done: dict[str, int] = {}

    def reach(self, stage: str, share: float) -> None:
        """Count frames of `stage` up to this share of all frames."""
        self.add(stage, max(round(share * self._total) - self._done.get(stage, 0), 0))

    def add(self, stage: str, count: int) -> None:
        """Count `count` further frames of `stage`."""
        self._done[stage] = self._done.get(stage, 0) + count
        if self._progress is not None:
            self._progress(stage, self._done[stage], self._total)
