"""Sources behind URLs: a web server with range requests, or a store supported by fsspec. In: a URL. Out: bytes."""

from __future__ import annotations

import re
from http import HTTPStatus
from http.client import HTTPException
from urllib.error import URLError
from urllib.request import Request, urlopen

from ..errors import InputError
from .reader import FIRST_REQUEST

_TIMEOUT = 30.0  # s without an answer (guess)
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
            raise InputError(f"{self._url}: {error}; {text}") from error
        except Exception as error:  # each file system has errors of its own
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            raise InputError(f"{self._url}: cannot be read ({reason}); check the URL and your rights") from error
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
                data: bytes = answer.read(None if is_whole else length + 1)  # a server's answer may be endless
                span = _RANGE.fullmatch(answer.headers.get("Content-Range", ""))
        except (URLError, HTTPException, OSError, ValueError) as error:
            reason = getattr(error, "reason", None) or error
            raise InputError(f"{self._url}: cannot be read ({reason}); check the address") from error
        if is_whole and offset == 0:
            return data, len(data)
        if span is None or int(span[1]) != offset or len(data) > length:
            raise InputError(f"{self._url}: the server answered without bytes {offset} ...; open it again")
        return data, int(span[2])
