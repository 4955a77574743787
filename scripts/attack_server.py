"""Attacks on `meshreel serve` over loopback: slow and crowding clients, nonsense, paths, hostile files, signals.

Each kind has a number of trials; a fault is a broken promise. Meanwhile one more client fetches a file and measures how
long it waits. `python scripts/attack_server.py [CONNECTIONS] [--no-rows]`.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, field
from pathlib import Path

from meshreel.server.connections import Limits
from meshreel.server.files import parse_ranges
from meshreel.server.painter import PATIENCE
from scripts.reliability import add_row
from tests.coding.draco_bombs import bombs, reel_of
from tests.golden import GOLDEN

GRACE = 5.0  # s beyond a limit, on a busy machine
PROMPT = 1.0  # s for an answer to another client
ENDED = 2.0  # s after a signal
MOST_THREADS = 40 + 8  # those that read files, and the server's own
BIG = 32 * 2**20  # bytes, more than a connection buffers
SECRET = b"nobody may read this"
BOMBS = [reel_of(mesh) for mesh, _ in bombs().values()]
HOST = b"Host: localhost\r\n"


@dataclass
class Served:
    """A server with its folder, and what another client of it experiences."""

    folder: Path
    process: subprocess.Popen[bytes]
    port: int
    errors: Path
    worst: float = 0.0  # s
    faults: list[str] = field(default_factory=list)

    def count(self, name: str) -> int:
        """Return a number of the process: open files, threads, or the most memory that it had, kB (Linux alone)."""
        try:
            if name == "files":
                return len(os.listdir(f"/proc/{self.process.pid}/fd"))  # noqa: PTH208
            status = Path(f"/proc/{self.process.pid}/status").read_text()
        except OSError:
            return 0
        return int(status.split({"threads": "Threads:", "memory": "VmHWM:"}[name])[1].split()[0])


def begin(folder: Path) -> Served:
    """Start a server for a folder next to a file that it may not give."""
    errors = folder.parent / "errors.txt"
    command = [sys.executable, "-P", "-m", "meshreel", "serve", str(folder), "--json"]
    with errors.open("ab") as file:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=file)
    assert process.stdout is not None
    address = json.loads(process.stdout.readline())["addresses"][0]
    return Served(folder, process, int(address.rstrip("/").rpartition(":")[2]), errors)


Line = tuple[asyncio.StreamReader, asyncio.StreamWriter]


@contextlib.asynccontextmanager
async def connected(served: Served, buffer: int | None = None) -> AsyncIterator[Line]:
    """Connect; with a `buffer`, the system takes only so many bytes that are not read."""
    line = socket.socket()
    line.setblocking(False)
    if buffer is not None:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    await asyncio.get_running_loop().sock_connect(line, ("127.0.0.1", served.port))
    reader, writer = await asyncio.open_connection(sock=line)
    try:
        yield reader, writer
    finally:
        writer.transport.abort()


def get(path: str, *headers: str) -> bytes:
    lines = "".join(f"{header}\r\n" for header in headers)
    return f"GET {path} HTTP/1.1\r\n".encode("latin-1") + HOST + lines.encode("latin-1") + b"\r\n"


async def rest(reader: asyncio.StreamReader, seconds: float) -> bytes | None:
    """Return what comes until the connection ends, None if it does not within some seconds."""
    received = bytearray()
    try:
        async with asyncio.timeout(seconds):
            while data := await reader.read(2**20):
                received += data
    except ConnectionError:
        pass
    except TimeoutError:
        return None
    return bytes(received)


async def answer(reader: asyncio.StreamReader) -> tuple[int, dict[str, str], bytes]:
    head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").split("\r\n")
    headers = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in head[1:])}
    return int(head[0].split()[1]), headers, await reader.readexactly(int(headers.get("content-length", "0")))


async def bystander(served: Served) -> None:
    """Fetch a file again and again over one connection, and note what is wrong or late."""
    wanted = (served.folder / "walk.reel").read_bytes()
    async with connected(served) as (reader, writer):
        while True:
            began = time.monotonic()
            writer.write(get("/files/walk.reel"))
            try:
                status, _, body = await answer(reader)
            except (OSError, EOFError) as error:
                served.faults.append(f"the connection of another client ended: {error}")
                return
            served.worst = max(served.worst, time.monotonic() - began)
            if (status, body) != (200, wanted):
                served.faults.append(f"another client got {status}")
            await asyncio.sleep(0.05)


async def silent(served: Served, _: int) -> str:
    """A client that connects and sends nothing is dropped."""
    async with connected(served) as (reader, _):
        return "" if await rest(reader, Limits().request + GRACE) == b"" else "not dropped"


async def slow(served: Served, number: int) -> str:
    """A client that sends its request a byte a second is dropped, also after a request that was answered."""
    async with connected(served) as (reader, writer):
        if number % 2:
            writer.write(get("/style.css"))
            await answer(reader)
        ended = asyncio.create_task(rest(reader, Limits().request + GRACE))
        for byte in get("/" + "a" * 100):
            writer.write(bytes([byte]))
            await asyncio.wait([ended], timeout=1)
            if ended.done():
                break
        return "" if await ended == b"" else "not dropped"


async def stalled(served: Served, _: int) -> str:
    """A client that takes no more of its answer is dropped."""
    async with connected(served, 4096) as (reader, writer):
        writer.write(get("/files/big.reel"))
        await asyncio.sleep(Limits().stall + GRACE)
        received = await rest(reader, GRACE)
        return "" if received is not None and len(received) < BIG else "not dropped"


async def nonsense(served: Served, number: int) -> str:
    """Bytes that are no request are refused, or end the connection."""
    chance = random.Random(number)
    valid = bytearray(get("/files/walk.reel", "Range: bytes=0-9", "Content-Length: 5", "Transfer-Encoding: chunked"))
    for _ in range(chance.randrange(1, 9)):
        place = chance.randrange(len(valid))
        valid[place : place + chance.choice([0, 1, 9])] = chance.randbytes(chance.choice([0, 1, 4, 999]))
    data = chance.randbytes(chance.randrange(1, 2**15)) if number % 2 else bytes(valid)
    async with connected(served) as (reader, writer):
        writer.write(data + b"\r\n\r\n")
        with contextlib.suppress(OSError):
            writer.write_eof()
        received = await rest(reader, Limits().request + GRACE)
    if received is None:
        return "no end"
    return f"answered {received[:60]!r}" if b" 500 " in received[:40] else ""


async def path(served: Served, number: int) -> str:
    """A path does not lead out of the folder, nor to a file that is no .reel file."""
    chance = random.Random(number)
    up = ["..", "%2e%2e", ".%2e", "%252e%252e", "..%c0%af", "....", "..;", "..%00", "%2e%2e%5c", "sub/.."]
    step = ["/", "%2f", "\\", "%5c", "//", "/./", "%252f", ":", "%00/"]
    way = "".join(chance.choice(up) + chance.choice(step) for _ in range(chance.randrange(1, 6)))
    targets = ["outside.reel", "outside.reel%00", "videos/secret.txt", str(served.folder.parent / "outside.reel")]
    doors = ["/files/", "/watch/", "/posters/", "/player/", "/"]
    asked = chance.choice(doors) + way + chance.choice(targets)
    async with connected(served) as (reader, writer):
        writer.write(get(asked, "Connection: close"))
        received = await rest(reader, Limits().request + GRACE)
    if received is None or SECRET in received:
        return f"{asked} gives what it may not" if received else "no end"
    return "" if received[9:12] in (b"404", b"400") else f"{asked}: {received[:12]!r}"


async def ranges(served: Served, number: int) -> str:
    """A header Range gives the bytes that RFC 9110 says, or the whole file."""
    chance, data = random.Random(number), (served.folder / "walk.reel").read_bytes()
    ends = ["", "0", "1", "7", str(len(data) - 1), str(len(data)), "9" * 40, "-1", "x"]
    specs = [f"{chance.choice(ends)}-{chance.choice(ends)}" for _ in range(chance.choice([1, 1, 1, 2, 5, 200]))]
    asked = chance.choice(["bytes=", "bytes=", "Bytes=", "items=", "bytes "]) + ",".join(specs)
    found = parse_ranges(asked, len(data))
    async with connected(served) as (reader, writer):
        writer.write(get("/files/walk.reel", f"Range: {asked}"))
        status, headers, body = await answer(reader)
    wanted = 200 if found is None else 206 if found else 416
    one = data if found is None else data[found[0].start : found[0].stop] if len(found) == 1 else b""
    is_right = status == wanted and (body == one or (found is not None and len(found) > 1))
    return "" if is_right else f"{asked!r}: {status}, {len(body)} bytes, {headers.get('content-range')}"


async def changed(served: Served, number: int) -> str:
    """A file that is cut, replaced or deleted while it is sent ends the connection; the next answer is the truth."""
    file = served.folder / f"changed{number}.reel"
    make_big(file)
    async with connected(served) as (reader, writer):
        writer.write(get(f"/files/{file.name}", "Connection: close"))
        await reader.readuntil(b"\r\n\r\n")
        change = number % 3
        if change == 0:
            os.truncate(file, 9)
        else:
            file.unlink()
        if change == 1:
            file.write_bytes(b"new")
        received = await rest(reader, Limits().stall + GRACE)
    if received is None or (change == 0 and len(received) == BIG):
        return "not ended"
    async with connected(served) as (reader, writer):
        writer.write(get(f"/files/{file.name}"))
        status, _, body = await answer(reader)
    is_true = (status, body) == (404, body) if change == 2 else (status, body) == (200, file.read_bytes())
    file.unlink(missing_ok=True)
    return "" if is_true else f"then {status}"


async def hostile(served: Served, number: int) -> str:
    """A poster of a file that claims what it has not got is a plain tile, within its time."""
    file = served.folder / f"hostile{number}.reel"
    file.write_bytes(BOMBS[number % len(BOMBS)])
    async with connected(served) as (reader, writer):
        writer.write(get(f"/posters/{file.name}.png"))
        async with asyncio.timeout(3 * PATIENCE):
            status, headers, _ = await answer(reader)
    return "" if status == 200 and "svg" in headers["content-type"] else f"{status} {headers}"


async def crowd(served: Served, number: int) -> str:
    """Clients beyond the limit are told 503 or dropped, and those before them are served."""
    async with connected(served) as (reader, writer):
        with contextlib.suppress(OSError):
            writer.write(get("/style.css"))
        try:
            status, headers, _ = await answer(reader)
        except (OSError, EOFError):
            return ""
        await asyncio.sleep(1)  # the place stays taken
        return "" if status == 200 or (status == 503 and "retry-after" in headers) else f"{number}: {status}"


def make_big(file: Path) -> None:
    with file.open("wb") as empty:
        empty.truncate(BIG)


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
    """Send SIGTERM at a random moment to a server that is busy with everything; return what is left after 2 s."""
    served = begin(folder)
    make_big(folder / "big.reel")
    kinds = [silent, slow, stalled, hostile, changed]
    tasks = [asyncio.create_task(kind(served, number * 100 + k)) for k in range(4) for kind in kinds]
    await asyncio.sleep(random.Random(number).uniform(0, 2))
    painters = children(served.process.pid)
    began = time.monotonic()
    served.process.send_signal(signal.SIGTERM)
    while served.process.poll() is None and time.monotonic() - began < 20:
        await asyncio.sleep(0.01)
    took = time.monotonic() - began
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    left = [pid for pid in painters if runs(pid)]
    return [f"took {took:.1f} s"] * (took > ENDED) + [f"{len(left)} processes are left"] * bool(left)


def children(pid: int) -> list[int]:
    """Return the processes that a process has started and that run."""
    return [int(one) for one in subprocess.run(["pgrep", "-P", str(pid)], capture_output=True).stdout.split()]


def runs(pid: int) -> bool:
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True).stdout.strip()
    return state != b"" and not state.startswith(b"Z")


def make_folder(root: Path) -> Path:
    folder = root / "videos"
    (folder / "sub").mkdir(parents=True)
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
        await hostile(served, 0)  # starts what draws posters
        async with connected(served) as (reader, writer):
            writer.write(get("/"))
            await answer(reader)
        await asyncio.sleep(1)
        before, total, start = served.count("files"), 0, time.monotonic()
        for kind, count, side in (
            (silent, connections, connections),
            (slow, connections, connections),
            (stalled, connections, connections),
            (crowd, 2 * connections, 2 * connections),
            (nonsense, 10 * connections, 20),
            (path, 10 * connections, 20),
            (ranges, 10 * connections, 20),
            (changed, max(connections // 4, 3), 5),
            (hostile, len(BOMBS), 8),
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
    report.add("SIGTERM ends a busy server and what it started within 2 s.", (count, "signals"), faults, began, "")


def main(arguments: list[str]) -> int:
    """Attack with so many connections; return 1 if a promise broke."""
    numbers = [int(one) for one in arguments if not one.startswith("-")] or [200]
    report = Report(" ".join(["./scripts/attack-server", *arguments]), "--no-rows" not in arguments)
    with tempfile.TemporaryDirectory() as root:
        asyncio.run(attack(make_folder(Path(root)), numbers[0], report))
    return 1 if report.faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
