"""Campaign of attacks on `meshreel serve`: many trials of each kind, then signals while the server is busy.

A fault is a broken promise. Meanwhile one more client fetches a file and measures how long it waits.
`python scripts/attack_server.py [CONNECTIONS] [--no-rows]`.
"""

from __future__ import annotations

import asyncio
import random
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

from scripts.reliability import add_row
from scripts.server_attacks import (
    SECRET,
    Served,
    answer,
    begin,
    bystander,
    changed,
    connected,
    crowd,
    gallery,
    get,
    heads,
    make_big,
    nonsense,
    path,
    ranges,
)
from tests.golden import GOLDEN

PROMPT = 1.0  # s for an answer to another client
ENDED = 2.0  # s after a signal
MOST_THREADS = 40 + 8  # those that read files, and the server's own


async def trials(served: Served, attack: Callable[[Served, int], Awaitable[str]], count: int, side: int) -> list[str]:
    """Run trials, `side` at once; return their faults and those of a bystander."""
    served.faults, served.worst = [], 0.0
    turns = asyncio.Semaphore(side)

    async def one(number: int) -> None:
        async with turns:
            try:
                fault = await attack(served, number)
            except Exception as error:
                fault = repr(error)
            if fault:
                served.faults.append(fault)

    other = asyncio.create_task(bystander(served))
    await asyncio.sleep(0.2)
    await asyncio.gather(*map(one, range(count)))
    other.cancel()
    await asyncio.sleep(0.5)
    return served.faults


async def ended(folder: Path, number: int) -> list[str]:
    """Send SIGTERM at a random moment to a busy server; return a fault if its end takes more than 2 s."""
    served = begin(folder)
    make_big(folder / "big.reel")
    kinds = [nonsense, crowd, ranges, changed, gallery]
    tasks = [asyncio.create_task(kind(served, number * 100 + k)) for k in range(4) for kind in kinds]
    await asyncio.sleep(random.Random(number).uniform(0, 2))
    began = time.monotonic()
    served.process.send_signal(signal.SIGTERM)
    while served.process.poll() is None and time.monotonic() - began < 20:
        await asyncio.sleep(0.01)
    took = time.monotonic() - began
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    return [f"took {took:.1f} s"] * (took > ENDED)


def make_folder(root: Path) -> Path:
    folder = root / "videos"
    (folder / "sub").mkdir(parents=True)
    for number in range(300):
        shutil.copy(GOLDEN / "layers.reel", folder / "sub" / f"{number}.reel")
    shutil.copy(GOLDEN / "layers.reel", folder / "walk.reel")
    (root / "outside.reel").write_bytes(SECRET)
    (folder / "secret.txt").write_bytes(SECRET)
    make_big(folder / "big.reel")
    return folder


def told(served: Served) -> list[str]:
    """Return the tracebacks that the server has printed."""
    return served.errors.read_text(encoding="utf-8", errors="replace").split("Traceback")[1:]


class Report:
    """Printed lines and rows, and the number of all faults."""

    def __init__(self, command: str, has_rows: bool) -> None:
        self.command, self.has_rows, self.faults = command, has_rows, 0

    def add(self, promise: str, counted: tuple[int, str], faults: list[str], began: float, note: str) -> None:
        """Report a kind of attack."""
        self.faults += len(faults)
        print(f"{counted[0]:6} {counted[1]}, {len(faults)} faults: {promise} {note}", *faults[:5], sep="\n    ")
        sys.stdout.flush()
        if self.has_rows:
            add_row(promise.rstrip("."), self.command, counted, len(faults), time.monotonic() - began, note)


async def attack(folder: Path, connections: int, report: Report) -> None:
    """Run all kinds of attacks on one server, then end it and others by signals."""
    served = begin(folder)
    try:
        async with connected(served) as (reader, writer):
            writer.write(get("/"))
            await answer(reader)
        await asyncio.sleep(1)
        before, total, start = served.count("files"), 0, time.monotonic()
        for kind, count, side in (
            (crowd, 2 * connections, 2 * connections),
            (nonsense, 10 * connections, 20),
            (path, 10 * connections, 20),
            (ranges, 10 * connections, 20),
            (changed, max(connections // 4, 3), 5),
            (gallery, 2 * connections, 4),
            (heads, max(connections // 4, 3), 2),
        ):
            began, tracebacks = time.monotonic(), len(told(served))
            faults = await trials(served, kind, count, side)
            faults += told(served)[tracebacks:]
            faults += [f"another client waited {served.worst:.1f} s"] * (served.worst > PROMPT)
            note = f"another client waited {served.worst:.2f} s at most"
            report.add(kind.__doc__ or "", (count, "connections"), faults, began, note)
            total += count
        await asyncio.sleep(2)
        after, threads, memory = (served.count(name) for name in ("files", "threads", "memory"))
        leaks = [f"{after} open files"] * (after > before) + [f"{threads} threads"] * (threads > MOST_THREADS)
        note = f"{before} open files before, {after} after; {threads} threads; at most {memory / 1e3:.0f} MB"
        report.add("All attacks leave no files, threads or memory behind.", (total, "connections"), leaks, start, note)
    finally:
        served.process.kill()
        served.process.wait()
    began, count, faults = time.monotonic(), max(connections // 10, 2), []
    for number in range(count):
        faults += await ended(folder, number)
    report.add("SIGTERM ends a busy server within 2 s.", (count, "signals"), faults, began, "")


def main(arguments: list[str]) -> int:
    """Attack with so many connections; return 1 if a promise broke."""
    numbers = [int(one) for one in arguments if not one.startswith("-")] or [200]
    report = Report(" ".join(["./scripts/attack-server", *arguments]), "--no-rows" not in arguments)
    with tempfile.TemporaryDirectory() as root:
        asyncio.run(attack(make_folder(Path(root)), numbers[0], report))
    return 1 if report.faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
