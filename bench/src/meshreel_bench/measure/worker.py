"""Functions in a fresh process with a time limit, timed decoding, and what processes cost: time by stage, work, memory.

A process has one thread for numerical libraries, so that times can be compared, and ends with its parent.
"""

from __future__ import annotations

import builtins
import multiprocessing
import os
import pickle
import platform
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import numpy as np

from meshreel import __version__
from meshreel.encoder.group.digests import processor
from meshreel.encoder.run.worker import end_with_parent
from meshreel.errors import InputError
from meshreel.geometry.work import since, so_far
from meshreel.types import Mesh, Texture

from ..rows import Decoding, Encoding, Maker

_SPAWN = multiprocessing.get_context("spawn")  # a forked process would have what its parent has in memory
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
_LONGEST = 300  # characters of an error's text
_LIVE: set[BaseProcess] = set()


class WorkerError(Exception):
    """Failure of a measuring process."""


def in_fresh_process(task: Callable[..., Iterator[Any]], *about: object, limit_s: float | None = None) -> Iterator[Any]:
    """Yield the values of `task(*about)`, run in a fresh process. WorkerError after `limit_s`, an error or a crash."""
    os.environ.update(_ONE_THREAD)  # of processes that start from now on: libraries here have read theirs
    here, there = _SPAWN.Pipe(duplex=False)
    process = _SPAWN.Process(target=_answer, args=(there, task, about))
    process.start()
    _LIVE.add(process)
    there.close()
    try:
        while (value := _received(here, process, limit_s)) is not None:
            yield value[0]
    finally:
        _end(process)
        process.join()
        _LIVE.discard(process)
        here.close()


def end_all() -> None:
    """End all processes that other threads wait for."""
    for process in list(_LIVE):
        _end(process)


def _end(process: BaseProcess) -> None:
    """End a process that nobody has joined, and those that it has started, but for those that left its group."""
    if sys.platform != "win32" and process.pid:
        with suppress(ProcessLookupError, PermissionError):  # it ended before it had a group
            os.killpg(process.pid, signal.SIGKILL)
    process.kill()


def _received(here: Connection, process: BaseProcess, limit_s: float | None) -> tuple[Any] | None:
    """Return the next value; None after the last one."""
    if not here.poll(limit_s):
        raise WorkerError(f"took longer than {limit_s:g} s of wall time")
    try:
        kind, value = here.recv()
    except EOFError:
        process.join()
        code = process.exitcode or 0
        ended = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        raise WorkerError(f"its process ended by {ended}") from None
    if kind == "error":
        raise WorkerError(value)
    return (value,) if kind == "value" else None


def _answer(there: Connection, task: Callable[..., Iterator[Any]], about: tuple[object, ...]) -> None:
    """Run the task in the fresh process; its standard output goes to standard error."""
    os.dup2(2, 1)
    if sys.platform != "win32":
        os.setsid()  # what a codec starts is ended with it
    end_with_parent()
    try:
        for value in task(*about):
            there.send(("value", value))
        there.send(("end", None))
    except (Exception, SystemExit) as error:  # a codec may raise anything
        reason = str(error) if isinstance(error, WorkerError) else f"{type(error).__name__}: {error}"
        there.send(("error", " ".join(reason.split())[:_LONGEST]))
    there.close()
    os._exit(0)  # threads that a codec has left do not matter


PASSES = 3
SLOW_MS = 2000.0  # a frame: a codec that takes so long in all passes so far is not timed again (guess)


def decode_timed(decoder: bytes, data: bytes, numbers: Sequence[int], frames: int) -> Iterator[Decoding | Mesh]:
    """Yield times, then the decoded meshes of some frames. Raises InputError where another number of frames comes.

    `decoder` was pickled before its codec has seen a sequence.
    """
    decode: Callable[[bytes], Sequence[Mesh]] = pickle.loads(decoder).decode
    start = time.process_time()
    opened = decode(data)
    if not hasattr(opened, "__getitem__") or len(opened) == 0:
        raise InputError(f"decodes a {type(opened).__name__} without frames, of {frames}")
    opened[0]
    first_ms = 1e3 * (time.process_time() - start)
    passes = [_pass_ms(decode, data)]
    while len(passes) < PASSES and len(passes) * passes[0] < SLOW_MS:
        passes.append(_pass_ms(decode, data))
    peak_mb, vertices, kept = peak_rss_mb(), list[int](), dict[int, Mesh]()
    reference = min(reference_s() for _ in range(PASSES))  # the best, as of the passes
    for number, mesh in enumerate(decode(data)):
        vertices.append(len(_checked(mesh, number).vertices))
        if number in numbers:  # textures are decoded when they are asked for: here
            kept[number] = mesh if mesh.texture is None else replace(mesh, texture=Texture.of(mesh.texture.pixels))
    if len(vertices) != frames:
        raise InputError(f"decodes {len(vertices)} frames of {frames}")
    yield Decoding(first_ms, min(passes), float(np.mean(vertices)), peak_mb, reference)
    yield from (kept[number] for number in numbers)


def _pass_ms(decode: Callable[[bytes], Sequence[Mesh]], data: bytes) -> float:
    """Return the time of a frame, with its share of opening: lazy and eager decoders are timed alike."""
    start = time.process_time()
    count = sum(1 for _ in decode(data))
    return 1e3 * (time.process_time() - start) / max(count, 1)


def _checked(mesh: Mesh, number: int) -> Mesh:
    """Return the mesh. Raises InputError where it cannot be measured."""
    if not isinstance(mesh, Mesh):
        raise InputError(f"decodes a {type(mesh).__name__}, which is no meshreel.Mesh, in frame {number}")
    if not np.isfinite(mesh.vertices).all():
        raise InputError(f"decodes coordinates that are not finite in frame {number}")
    if len(mesh.faces) and not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
        raise InputError(f"decodes faces of vertices that are not there in frame {number}")
    return mesh


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

    def a_frame(totals: Sequence[Mapping[Any, float]]) -> dict[str, float]:
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
    return Maker(__version__, _commit(), platform.platform(), platform.python_version(), processor(), os.cpu_count())


def _commit() -> str:
    """Return the commit of the checkout that this package runs from, with + where files differ."""
    try:
        head = _git("rev-parse", "HEAD")
        _git("ls-files", "--error-unmatch", Path(__file__).name)
        changed = _git("status", "--porcelain", "--", ":(top)src", ":(top)bench/src", ":(top)core")
    except (OSError, subprocess.SubprocessError):  # no git, or the package is installed
        return "none: installed"
    return head[:_DIGITS] + ("+" if changed else "")


def _git(*words: str) -> str:
    folder = Path(__file__).resolve().parent
    answer = subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=True, timeout=10)
    return answer.stdout.strip()
