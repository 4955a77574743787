"""Worker processes that end with their parent. Imports nothing heavy, so that a new worker watches at once."""

from __future__ import annotations

import multiprocessing
import os
import threading
from functools import cache


@cache
def end_with_parent() -> None:
    """Watch the process that started this one, where there is one, and end when it does, however it ended."""
    if multiprocessing.parent_process() is not None:
        threading.Thread(target=_watch, name="ends with its parent", daemon=True).start()


def _watch() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()  # a pipe or a handle that the system closes with the parent
    os._exit(1)
