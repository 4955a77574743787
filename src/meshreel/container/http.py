"""Sources behind URLs: a web server with range requests, or a store supported by fsspec. In: a URL. Out: bytes."""

from __future__ import annotations

from typing import Any

from .. import web
from ..errors import InputError
from .reader import FIRST_REQUEST


class _UrlSource:
    """A file behind a URL: one request for each range.

    The first request fetches the first FIRST_REQUEST bytes, where the index of most files ends, and the size. Raises
    InputError if the URL cannot be read.
    """

    def __init__(self, url: str) -> None:
        self._url = url
        self._begin, self.size = self._answer(0, FIRST_REQUEST)  # first bytes of the file
        self.bytes_read = len(self._begin)

    def get_bytes(self, offset: int, length: int) -> bytes:
        end = min(offset + length, self.size)
        if end <= len(self._begin):
            return self._begin[offset:end]
        data, _ = self._answer(offset, end - offset)
        self.bytes_read += len(data)
        return data

    def close(self) -> None:
        """Do nothing: no connection stays open."""

    def _answer(self, offset: int, length: int) -> tuple[bytes, int]:
        try:
            return self._request(offset, length)
        except OSError as error:
            raise InputError(f"{self._url}: cannot be read ({error}); check the address and your rights") from None

    def _request(self, offset: int, length: int) -> tuple[bytes, int]:
        """Return the bytes of a range, or all bytes if the server has no ranges, and the size of the file."""
        raise NotImplementedError


class StoreSource(_UrlSource):
    """A file behind a URL of fsspec, such as s3:// (extra `remote`)."""

    def _request(self, offset: int, length: int) -> tuple[bytes, int]:
        def act(system: Any, path: str) -> tuple[bytes, int]:
            size = int(system.size(path)) if offset == 0 else self.size
            data: bytes = system.cat_file(path, start=offset, end=min(offset + length, size))
            return web.checked(data, min(length, size - offset)), size

        return web.in_store(self._url, act, web.time_for(length))


class HttpSource(_UrlSource):
    """A file behind an http(s) URL, each request over a connection of its own.

    A server without ranges sends the whole file, which is then kept in memory.
    """

    def _request(self, offset: int, length: int) -> tuple[bytes, int]:
        return web.fetch(self._url, offset, length, web.MOST)
