"""Sources behind URLs: a web server with range requests, or a store supported by fsspec. In: a URL. Out: bytes."""

from __future__ import annotations

import re
import time
from http import HTTPStatus
from http.client import HTTPException, HTTPResponse
from urllib.error import URLError
from urllib.request import Request, urlopen

from ..errors import InputError, without_secret
from .reader import FIRST_REQUEST

_TIMEOUT = 30.0  # s without an answer (guess)
_PATIENCE, _SLOWEST = 60.0, 8192  # s, and bytes a second that an answer must have had after them (guess)
_MOST = 1 << 29  # bytes of an answer without ranges, which is kept in memory (guess)
_BLOCK = 1 << 20  # bytes
_RANGE = re.compile(r"bytes (\d{1,18})-\d{1,18}/(\d{1,18})", re.ASCII)


class _UrlSource:
    """A file behind a URL: one request for each range.

    The first request fetches the first FIRST_REQUEST bytes, where the index of most files ends, and the size.
    """

    def __init__(self, url: str) -> None:
        self._url = url
        self._begin, self.size = self._request(0, FIRST_REQUEST)  # first bytes of the file
        self.bytes_read = len(self._begin)

    def get_bytes(self, offset: int, length: int) -> bytes:
        end = min(offset + length, self.size)
        if end <= len(self._begin):
            return self._begin[offset:end]
        data, _ = self._request(offset, end - offset)
        self.bytes_read += len(data)
        return data

    def close(self) -> None:
        """Do nothing: no connection stays open."""

    def _request(self, offset: int, length: int) -> tuple[bytes, int]:
        """Return the bytes of a range, or all bytes if the server has no ranges, and the size of the file."""
        raise NotImplementedError


class StoreSource(_UrlSource):
    """A file behind a URL of fsspec, such as s3:// (extra `remote`). Raises InputError if it cannot be read."""

    def _request(self, offset: int, length: int) -> tuple[bytes, int]:
        try:
            from fsspec.core import url_to_fs

            system, path = url_to_fs(self._url)
            size = int(system.size(path)) if offset == 0 else self.size
            data: bytes = system.cat_file(path, start=offset, end=min(offset + length, size))
        except ImportError as error:
            text = "a URL needs the extra `remote`, pip install 'meshreel[remote]', and some protocols a package more"
            raise InputError(f"{without_secret(self._url)}: {error}; {text}") from error
        except Exception as error:  # each file system has errors of its own
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            text = f"{without_secret(self._url)}: cannot be read ({reason.replace(self._url, '')})"
            raise InputError(f"{text}; check the URL and your rights") from error
        return data, size


class HttpSource(_UrlSource):
    """A file behind an http(s) URL, each request over a connection of its own.

    A server without ranges sends the whole file, which is then kept in memory. Raises InputError if the URL cannot be
    read.
    """

    def _request(self, offset: int, length: int) -> tuple[bytes, int]:
        try:
            request = Request(self._url, headers={"Range": f"bytes={offset}-{offset + length - 1}"})
            with urlopen(request, timeout=_TIMEOUT) as answer:
                is_whole = answer.status == HTTPStatus.OK
                data = _read(answer, _MOST if is_whole else length)
                span = _RANGE.fullmatch(answer.headers.get("Content-Range", ""))
        except (URLError, HTTPException, OSError, ValueError) as error:
            reason = getattr(error, "reason", None) or error
            raise InputError(f"{without_secret(self._url)}: cannot be read ({reason}); check the address") from error
        if is_whole and len(data) > _MOST:
            text = f"the server sends the whole file, of more than {_MOST} bytes"
            raise InputError(f"{without_secret(self._url)}: {text}; copy it here, or serve ranges of it")
        if is_whole and offset == 0:
            return data, len(data)
        if span is None or int(span[1]) != offset or len(data) > length:
            text = f"the server answered without bytes {offset} ..."
            raise InputError(f"{without_secret(self._url)}: {text}; open it again")
        return data, int(span[2])


def _read(answer: HTTPResponse, most: int) -> bytes:
    """Return an answer, or its first `most` + 1 bytes. Raises TimeoutError where it takes for ever."""
    parts, size, begin = list[bytes](), 0, time.monotonic()
    while size <= most and (part := answer.read1(min(_BLOCK, most + 1 - size))):
        parts.append(part)
        size += len(part)
        if (took := time.monotonic() - begin) > _PATIENCE and size < _SLOWEST * took:
            raise TimeoutError(f"{size} bytes in {took:.0f} s are too slow")
    return b"".join(parts)
