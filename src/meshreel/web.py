"""Requests to web servers and to stores that fsspec supports: none is without end. In: a URL. Out: bytes."""

from __future__ import annotations

import re
import time
from base64 import b64encode
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from http import HTTPStatus
from http.client import HTTPResponse
from threading import Thread
from typing import Any, TypeVar
from urllib.error import HTTPError
from urllib.parse import unquote, urlsplit, urlunsplit
from urllib.request import Request, urlopen

from .errors import InputError, without_secret

WEB = ("http://", "https://")
MOST = 1 << 29  # bytes of an answer without ranges, which is kept in memory (guess)
LONGEST = 3600.0  # s for a request (guess)
_TIMEOUT = 30.0  # s without an answer (guess)
_PATIENCE, _SLOWEST = 60.0, 8192  # s, and bytes a second that an answer must have had after them (guess)
_BLOCK = 1 << 20  # bytes
_RANGE = re.compile(r"bytes (\d{1,18})-\d{1,18}/(\d{1,18})", re.ASCII)
T = TypeVar("T")


def begun(call: Callable[[], T]) -> Future[T]:
    """Begin a call in a thread, for which the end of the process does not wait."""
    done = Future[T]()

    def run() -> None:
        try:
            done.set_result(call())
        except BaseException as error:
            done.set_exception(error)

    Thread(target=run, daemon=True).start()
    return done


def in_store(url: str, act: Callable[[Any, str], T], seconds: float = LONGEST) -> T:
    """Return the result of `act` for the file system of a URL and the path there.

    Raises OSError of one line, also after some seconds, and InputError if a package is missing.
    """

    try:
        from fsspec.core import url_to_fs

        # The place is found here, not in the other thread: fsspec keeps file systems for each.
        return _asked(url, lambda: begun(partial(act, *url_to_fs(url))), seconds)
    except ImportError as error:
        text = "a URL needs the extra `remote`, pip install 'meshreel[remote]', and some protocols a package more"
        raise InputError(f"{url}: {error}; {text}") from None


def fetch(url: str, offset: int, length: int, most: int) -> tuple[bytes, int]:
    """Return a range of the file at an http(s) address, or all of it if the server has no ranges, and its size.

    Raises OSError of one line, also for more than `most` bytes, and after some time.
    """
    return _asked(url, lambda: begun(partial(_fetch, url, offset, length, most)), LONGEST)


def time_for(length: int) -> float:
    """Return the time that a request for so many bytes may take, s."""
    return min(_PATIENCE + length / _SLOWEST, LONGEST)


def _asked(url: str, ask: Callable[[], Future[T]], seconds: float) -> T:
    """Return an answer within some seconds. Raises OSError of one line, with no more if the URL has secrets.

    It has no context: errors of libraries have addresses, and open files, which cannot be sent to another process.
    """
    try:
        return ask().result(seconds)
    except ImportError:
        raise
    except _RefusedError as error:
        text = str(error)
    except Exception as error:  # each file system has errors of its own
        kind = type(error).__name__
        text = f"{kind}: {error}" if str(error) and without_secret(url) == url else kind
    raise OSError(" ".join(text.split()))


class _RefusedError(OSError):
    """An answer that is not taken, in words without secrets."""


def _fetch(url: str, offset: int, length: int, most: int) -> tuple[bytes, int]:
    parts = urlsplit(url)
    user, _, host = parts.netloc.rpartition("@")
    request = Request(urlunsplit(parts._replace(netloc=host, fragment="")))
    request.add_header("Range", f"bytes={offset}-{offset + length - 1}")
    if user:
        request.add_unredirected_header("Authorization", f"Basic {b64encode(unquote(user).encode()).decode()}")
    try:
        answer = urlopen(request, timeout=_TIMEOUT)
    except HTTPError as error:
        raise _RefusedError(f"the server answers {error.code}") from None
    with answer:
        is_whole = answer.status == HTTPStatus.OK
        data = _read(answer, most if is_whole else length)
        span = _RANGE.fullmatch(answer.headers.get("Content-Range", ""))
        size = int(answer.headers.get("Content-Length") or len(data)) if is_whole else int(span[2]) if span else 0
    if is_whole and len(data) > most:
        raise _RefusedError(f"the server sends the whole file, of more than {most} bytes; copy it here, or send ranges")
    if not (is_whole and offset == 0) and (span is None or int(span[1]) != offset):
        raise _RefusedError(f"the server answered without bytes {offset} ...; open it again")
    return checked(data, size if is_whole else min(length, size - offset)), size


def checked(data: bytes, size: int) -> bytes:
    """Return the data of an answer. Raises OSError if it has another size."""
    if len(data) != size:
        raise _RefusedError(f"{len(data)} of {size} bytes came; open it again")
    return data


def _read(answer: HTTPResponse, most: int) -> bytes:
    """Return an answer, or its first `most` + 1 bytes. Raises OSError where it takes for ever."""
    parts, size, begin = list[bytes](), 0, time.monotonic()
    while size <= most and (part := answer.read1(min(_BLOCK, most + 1 - size))):
        parts.append(part)
        size += len(part)
        if (took := time.monotonic() - begin) > _PATIENCE and size < _SLOWEST * took:
            raise _RefusedError(f"{size} bytes in {took:.0f} s are too slow")
    return b"".join(parts)
