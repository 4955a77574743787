"""Posters, drawn one at a time by a process that can be killed. In: the path of a file. Out: cached bytes of a PNG."""

from __future__ import annotations

import asyncio
import json
import os
import struct
import subprocess
import sys
import threading
from collections import OrderedDict
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path

from .painter import PATIENCE, SIZE

PAINTER = (sys.executable, "-P", "-m", "meshreel.server.painter")  # -P: no module is from the folder that is served
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # the server needs the other cores
MOST_POSTERS = 256  # in memory (guess)
MOST_WAITING = 32  # different posters at once (guess); the tiles of others stay plain
LONGEST_WAIT = 30.0  # s of a request for its turn and its poster (guess); later, its tile stays plain
START = 60.0  # s until the process is ready (guess)
LARGEST = 2**20  # bytes of a PNG: more than its pixels have

Poster = tuple[Path, str]  # path and ETag


class NotStarted(Exception):
    """The system gave the server no process now: a poster may be drawn later."""


class Posters:
    """Cache of posters, one for each version of a file. A file that has none is not tried again."""

    def __init__(self) -> None:
        self._painter = _Painter()
        self._known: OrderedDict[Poster, bytes | None] = OrderedDict()
        self._drawn: dict[Poster, Future[bytes | None]] = {}
        self._lock = threading.RLock()  # a callback of what is done already runs within it
        self._thread = ThreadPoolExecutor(1, "posters")

    async def of(self, path: Path, tag: str) -> bytes | None:
        """Return a PNG; None where there is none, or none yet because too many are waited for."""
        wanted = (path, tag)
        with self._lock:
            if wanted in self._known:
                self._known.move_to_end(wanted)
                return self._known[wanted]
            drawing = self._drawn.get(wanted)
            if drawing is None and len(self._drawn) < MOST_WAITING:
                drawing = self._drawn[wanted] = self._thread.submit(self._painter.draw, path)
                drawing.add_done_callback(partial(self._keep, wanted))
        if drawing is None:
            return None
        with suppress(TimeoutError, NotStarted):  # after a time-out it is drawn all the same, for later requests
            return await asyncio.wait_for(asyncio.shield(asyncio.wrap_future(drawing)), LONGEST_WAIT)
        return None

    def close(self) -> None:
        """Kill the process; whoever waits gets None."""
        self._painter.close()
        self._thread.shutdown(wait=False)

    def _keep(self, drawn: Poster, drawing: Future[bytes | None]) -> None:
        with self._lock:
            self._drawn.pop(drawn, None)
            if isinstance(drawing.exception(), NotStarted):
                return
            self._known[drawn] = drawing.result()
            while len(self._known) > MOST_POSTERS:
                self._known.popitem(last=False)


class _Painter:
    """The process, started when it is needed first, and again after it was killed. For one thread, but for `close`."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._is_closed, self._lock = False, threading.Lock()

    def draw(self, path: Path) -> bytes | None:
        """Return a PNG, None if there is none, the process dies of it, or it takes too long. Raises NotStarted."""
        process = self._process
        if process is None or process.poll() is not None:  # it may have died of what it drew before
            process = self._start()
        picture = process and self._ask(process, json.dumps(str(path)).encode() + b"\n", PATIENCE)
        return picture or None

    def close(self) -> None:
        """Kill the process, and start none again; from any thread."""
        with self._lock:
            self._is_closed = True
            if self._process is not None:
                self._process.kill()

    def _start(self) -> subprocess.Popen[bytes] | None:
        pipe = subprocess.PIPE
        with self._lock:
            if self._is_closed:
                return None
            environment, silent = os.environ | ONE_THREAD, subprocess.DEVNULL
            try:
                self._process = process = subprocess.Popen(
                    PAINTER, stdin=pipe, stdout=pipe, stderr=silent, env=environment
                )
            except OSError as error:  # too many processes or open files
                raise NotStarted from error
        return None if self._ask(process, b"", START) is None else process

    def _ask(self, process: subprocess.Popen[bytes], line: bytes, limit: float) -> bytes | None:
        """Return the answer of the process to a line, None if it dies or exceeds the limit, upon which it is killed."""
        assert process.stdin is not None and process.stdout is not None
        timer = threading.Timer(limit, process.kill)
        timer.daemon = True
        timer.start()
        try:
            process.stdin.write(line)
            process.stdin.flush()
            (size,) = SIZE.unpack(process.stdout.read(SIZE.size))
            answer = process.stdout.read(min(size, LARGEST))
            if len(answer) == size:
                return answer
        except (OSError, struct.error):  # it is dead
            pass
        finally:
            timer.cancel()
        self._process = None
        process.kill()
        process.wait()
        process.stdout.close()
        with suppress(OSError):  # what it has not read
            process.stdin.close()
        return None
