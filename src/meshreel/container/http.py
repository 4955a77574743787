"""Source behind a URL: a web server with range requests, or a store supported by fsspec. In: a URL. Out: bytes."""

from __future__ import annotations

from typing import Any

from .. import web
from ..errors import InputError
from .reader import FIRST_REQUEST


class UrlSource:
    """A file behind a URL, http(s)://, or of fsspec, such as s3:// (extra `remote`): one request for each range.

    The first request fetches the first FIRST_REQUEST bytes, where the index of most files ends, and the size. A web
    server without ranges sends the whole file, which is then kept in memory. Raises InputError if it cannot be read.
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

        def act(system: Any, path: str) -> tuple[bytes, int]:
            size = int(system.size(path)) if offset == 0 else self.size
            data: bytes = system.cat_file(path, start=offset, end=min(offset + length, size))
            return web.checked(data, min(length, size - offset)), size

        try:
            if self._url.startswith(web.WEB):
                return web.fetch(self._url, offset, length, web.MOST)
            return web.in_store(self._url, act, web.time_for(length))
        except OSError as error:
            raise InputError(f"{self._url}: cannot be read ({error}); check the address and your rights") from None
