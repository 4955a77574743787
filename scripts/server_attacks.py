"""Single attacks on `meshreel serve` over loopback: crowding clients, nonsense, paths, ranges, files that change.

Each takes the server and the number of the trial, and returns what is wrong, "" if nothing is. Its docstring is the
promise that it tests. scripts/attack_server.py runs them in numbers.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import random
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path

from meshreel.server.run import IDLE
from tests.server.conftest import with_long_head

GRACE = 5.0  # s beyond a limit, on a busy machine
BIG = 32 * 2**20  # bytes, more than a connection buffers
MOST_GROWTH = 64  # MB
SECRET = b"nobody may read this"
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
    """Return the bytes received until the connection ends, None if it does not within some seconds."""
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


@dataclass
class Lateness:
    """The time by which a task that sleeps for 10 ms again and again has woken too late, all in all."""

    seconds: float = 0.0

    async def tick(self) -> None:
        while True:
            began = time.monotonic()
            await asyncio.sleep(0.01)
            self.seconds += time.monotonic() - began - 0.01


async def bystander(served: Served) -> None:
    """Fetch a file again and again over one connection, and note what is wrong or late.

    What this process itself was held up by, on a busy machine, is no wait for the server.
    """
    wanted = (served.folder / "walk.reel").read_bytes()
    async with connected(served) as (reader, writer), asyncio.TaskGroup() as group:
        lateness = Lateness()
        group.create_task(lateness.tick())
        while True:
            began, late = time.monotonic(), lateness.seconds
            writer.write(get("/files/walk.reel"))
            try:
                status, _, body = await answer(reader)
            except (OSError, EOFError) as error:
                served.faults.append(f"the connection of another client ended: {error}")
                return
            served.worst = max(served.worst, time.monotonic() - began - (lateness.seconds - late))
            if (status, body) != (200, wanted):
                served.faults.append(f"another client got {status}")
            await asyncio.sleep(0.05)


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
        received = await rest(reader, IDLE + GRACE)
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
    doors = ["/files/", "/watch/", "/player/", "/"]
    asked = chance.choice(doors) + way + chance.choice(targets)
    async with connected(served) as (reader, writer):
        writer.write(get(asked, "Connection: close"))
        received = await rest(reader, IDLE + GRACE)
    if received is None or SECRET in received:
        return f"{asked} gives what it may not" if received else "no end"
    return "" if received[9:12] in (b"404", b"400") else f"{asked}: {received[:12]!r}"


async def ranges(served: Served, number: int) -> str:
    """A header Range gives its bytes, or the whole file, or is refused."""
    chance, data = random.Random(number), (served.folder / "walk.reel").read_bytes()
    ends = ["", "0", "1", "7", str(len(data) - 1), str(len(data)), "9" * 40, "-1", "x"]
    asked = f"bytes={chance.choice(ends)}-{chance.choice(ends)}"
    async with connected(served) as (reader, writer):
        writer.write(get("/files/walk.reel", f"Range: {asked}"))
        status, headers, body = await answer(reader)
    if status == 206:
        first, last = headers["content-range"].removeprefix("bytes ").partition("/")[0].split("-")
        data = data[int(first) : int(last) + 1]
    return "" if status in (400, 416) or body == data else f"{asked!r}: {status}, {len(body)} bytes"


async def changed(served: Served, number: int) -> str:
    """A file that is cut while it is sent ends the connection; after a change, the next answer is the truth."""
    file = served.folder / f"changed{number}.reel"
    make_big(file)
    async with connected(served) as (reader, writer):
        writer.write(get(f"/files/{file.name}", "Connection: close"))
        await reader.readuntil(b"\r\n\r\n")
        await reader.readexactly(2**17)
        change = number % 3
        if change == 0:
            os.truncate(file, 9)
        else:
            file.unlink()
        if change == 1:
            file.write_bytes(b"new")
        received = await rest(reader, 60)
    if received is None or (change == 0 and len(received) + 2**17 == BIG):
        return "not ended"
    async with connected(served) as (reader, writer):
        writer.write(get(f"/files/{file.name}"))
        status, _, body = await answer(reader)
    is_true = (status, body) == (404, body) if change == 2 else (status, body) == (200, file.read_bytes())
    file.unlink(missing_ok=True)
    return "" if is_true else f"then {status}"


async def gallery(served: Served, number: int) -> str:
    """Clients that ask for the gallery of 300 files, and leave or stay, delay no other."""
    async with connected(served) as (reader, writer):
        writer.write(get("/", "Connection: close"))
        if number % 2:
            await asyncio.sleep(random.Random(number).uniform(0, 0.2))
            return ""
        received = await rest(reader, 60)
    return "no end" if received is None else "" if b"walk" in received else f"answered {received[:60]!r}"


async def heads(served: Served, number: int) -> str:
    """Files with heads of 1 and 64 MiB of nothing end no gallery, and take none of the server's memory."""
    before, file = served.count("memory"), served.folder / f"head{number}.reel"
    await asyncio.to_thread(with_long_head, file, 64 if number % 2 else 0.999)
    try:
        fault = await gallery(served, 0)
    finally:
        file.unlink()
    grown = (served.count("memory") - before) / 1e3
    return fault or (f"{grown:.0f} MB more" if grown > MOST_GROWTH else "")


async def crowd(served: Served, number: int) -> str:
    """Clients beyond the limit are told 503."""
    async with connected(served) as (reader, writer):
        with contextlib.suppress(OSError):
            writer.write(get("/gallery.css"))
        try:
            status, _, _ = await answer(reader)
        except (OSError, EOFError):
            return ""
        await asyncio.sleep(1)  # the place stays taken
        return "" if status in (200, 503) else f"{number}: {status}"


def make_big(file: Path) -> None:
    with file.open("wb") as empty:
        empty.truncate(BIG)
