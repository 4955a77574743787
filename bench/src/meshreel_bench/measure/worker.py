"""Functions in a fresh process with a time limit, and timed decoding: the best of three passes over all frames.

A crash, an error or an endless loop raises an exception. A process has one thread for numerical libraries, so that
times can be compared, and ends with its parent. Decoded meshes are those of the fresh process: bytes alone decide them.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

import numpy as np

from meshreel.encoder.run.worker import end_with_parent
from meshreel.errors import InputError
from meshreel.types import Mesh, Texture

from ..rows import Decoding
from .clock import peak_rss_mb, reference_s

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


def decoded_apart(decoder: bytes, data: bytes, numbers: Sequence[int], frames: int) -> tuple[Decoding, list[Mesh]]:
    """Return times, and the decoded meshes of some frames. Raises InputError where another number of frames comes."""
    times, *meshes = in_fresh_process(_decode, decoder, data, tuple(numbers), frames)
    return times, meshes


def _decode(decoder: bytes, data: bytes, numbers: Sequence[int], frames: int) -> Iterator[Decoding | Mesh]:
    """Yield times, then the meshes; `decoder` was pickled before its codec has seen a sequence."""
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
    shown = decode(data)
    for number, mesh in enumerate(shown):
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
