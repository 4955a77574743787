"""Worker processes that end with their parent and tell it how far they are.

Imports nothing heavy, so that a new worker watches at once.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable
from fractions import Fraction
from functools import cache

Told = tuple[int, str, int]  # number of a call, stage, further frames that have passed it
_listener: Callable[[Told], object] | None = None


def tell_to(listener: Callable[[Told], object]) -> None:
    """Let calls in this process tell how far they are; without a listener they do not."""
    global _listener
    _listener = listener


def tell(number: int, stage: str, count: Fraction) -> None:
    """Report to the parent, if it listens, how many further frames of a call have passed a stage."""
    if _listener is not None:
        _listener((number, stage, int(count)))


def die_with_parent() -> None:
    """Ask Linux to kill this process when the thread that started it ends, also where a library holds Python's lock."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, int(signal.SIGKILL))  # 1: PR_SET_PDEATHSIG of linux/prctl.h


@cache
def end_with_parent() -> None:
    """Watch the process that started this one, where there is one, and end when it does, however it ended."""
    if (parent := multiprocessing.parent_process()) is None:
        return

    def watch() -> None:
        parent.join()  # a pipe or a handle that the system closes with the parent
        os._exit(1)

    threading.Thread(target=watch, name="ends with its parent", daemon=True).start()
