"""Answers from .reel files: whole or a range (RFC 9110), never mixed from two versions. In: a file. Out: a response.

An open file is what is sent, whatever its name leads to by now. Where it changes meanwhile, the connection is closed.
"""

from __future__ import annotations

import logging
import os
import re
import sys
import time
from dataclasses import dataclass
from email.utils import formatdate
from hashlib import blake2b
from pathlib import Path
from typing import BinaryIO

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.responses import Response, StreamingResponse
from starlette.staticfiles import NotModifiedResponse
from starlette.types import Receive, Scope, Send

from ..container.reader import FIRST_REQUEST
from ..errors import FormatError
from ..format.layout import Checksum, Preamble
from ..format.records import least_size, unpack
from .assets import BYTES, FRESH, SUM, is_unchanged
from .library import Version, version_of

LOG = logging.getLogger(__name__)
PIECE = 65_536  # bytes that are read and sent at once (guess)
_RANGE = re.compile(r"bytes=(\d*)-(\d*)", re.ASCII | re.IGNORECASE)
_MOST_DIGITS = 18  # of a number of bytes that may exist


@dataclass(frozen=True, slots=True)
class OpenFile:
    """A file that is open for reading, with its facts from then."""

    file: BinaryIO
    found: os.stat_result
    tag: str  # ETag

    @staticmethod
    def of(path: Path) -> OpenFile:
        """Open a file and read its tag. Raises OSError."""
        file = path.open("rb", buffering=0)
        try:
            found = os.fstat(file.fileno())
            return OpenFile(file, found, f'"{_sum(file, version_of(found))}"')
        except BaseException:
            file.close()
            raise

    def read(self, piece: range) -> bytes | None:
        """Return bytes of the file; None if it is not what it was, or not readable any more."""
        try:
            self.file.seek(piece.start)
            data = self.file.read(len(piece))
            now = os.fstat(self.file.fileno())
        except OSError:
            return None
        is_same = (now.st_size, now.st_mtime_ns) == (self.found.st_size, self.found.st_mtime_ns)
        return data if is_same and len(data) == len(piece) else None


def tag_of(path: Path) -> str | None:
    """Return the ETag of a file, None if it cannot be read."""
    try:
        opened = OpenFile.of(path)
    except OSError:
        return None
    opened.file.close()
    return opened.tag


def _sum(file: BinaryIO, version: Version) -> str:
    """Return a sum over a version of a file and its head, whose index has a checksum of every layer.

    Files of equal size and time differ in it, unless they differ within the layers alone: then one of them is damaged.
    """
    head = file.read(FIRST_REQUEST)
    try:
        size = unpack(Preamble, head)[0].head_size
    except FormatError:
        size = 0  # not a .reel file
    if size > len(head):  # the checksum of the head is at its end
        file.seek(size - least_size(Checksum))
        head += file.read(least_size(Checksum))
    return blake2b(repr(version).encode() + head, digest_size=SUM).hexdigest()


def answer(opened: OpenFile, asked: Headers, is_head: bool) -> Response:
    """Return the response to a request with the headers `asked`; it closes the file."""
    size, modified = opened.found.st_size, opened.found.st_mtime
    is_old = time.time() - modified > 1  # or it may change again within the second that Last-Modified names
    date = {"Last-Modified": formatdate(modified, usegmt=True)} if is_old else {}
    headers = Headers(FRESH | date | {"ETag": opened.tag, "Accept-Ranges": "bytes"})
    if is_unchanged(asked, headers):
        opened.file.close()
        return NotModifiedResponse(headers)
    is_current = asked.get("if-range") in (None, opened.tag, headers.get("last-modified"))
    stated = asked.getlist("range") if is_current and not is_head else []
    wanted = parse_range(stated[0], size) if len(stated) == 1 else None
    if wanted is not None and not wanted:
        opened.file.close()
        return Response(status_code=416, headers={**headers, "Content-Range": f"bytes */{size}"})
    return _FileResponse(opened, dict(headers), wanted, is_head)


def parse_range(text: str, size: int) -> range | None:
    """Return the range of a header Range in a file of `size` bytes; it is empty where it begins behind the file.

    None where the header is to be ignored: of another unit, malformed, or of several ranges, which no player asks for.
    """
    parts = _RANGE.fullmatch(text)
    if parts is None or not any(parts.groups()):
        return None
    first, last = (_number(digits) for digits in parts.groups())
    if not parts[1]:
        return range(max(size - last, 0), size) if size else None
    if parts[2] and last < first:
        return None
    return range(first, min(last + 1, size) if parts[2] else size)


def _number(digits: str) -> int:
    digits = digits.lstrip("0")
    return int(digits or "0") if len(digits) <= _MOST_DIGITS else sys.maxsize


class _FileResponse(StreamingResponse):
    """A file in pieces. Where it changes, the response stays incomplete, upon which uvicorn closes the connection."""

    def __init__(self, opened: OpenFile, headers: dict[str, str], asked: range | None, is_head: bool) -> None:
        size = opened.found.st_size
        sent = range(size) if asked is None else asked
        if asked is not None:
            headers["Content-Range"] = f"bytes {asked.start}-{asked.stop - 1}/{size}"
        headers["Content-Length"] = str(len(sent))
        self._opened, self._sent = opened, range(0) if is_head else sent
        super().__init__((), 200 if asked is None else 206, headers, BYTES)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._opened.file.close()

    async def stream_response(self, send: Send) -> None:
        await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})
        for at in range(0, len(self._sent), PIECE):
            data = await run_in_threadpool(self._opened.read, self._sent[at : at + PIECE])
            if data is None:
                LOG.warning("%r has changed while it was sent: closed the connection", self._opened.file.name)
                return
            await send({"type": "http.response.body", "body": data, "more_body": True})
        await send({"type": "http.response.body", "body": b"", "more_body": False})
