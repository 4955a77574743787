"""HTTP source: the bytes of a file on a web server, by range requests. In: a URL. Out: bytes."""

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


class HttpSource:
    """A file behind an http(s) URL: one request for each range, each over a connection of its own.

    The first request fetches the first FIRST_REQUEST bytes, where the index of most files ends, and the size. A server
    without ranges sends the whole file, which is then kept in memory. Raises InputError if the URL cannot be read.
    """

    def __init__(self, url: str) -> None:
        self._url = url
        self._begin, self._size = self._request(0, FIRST_REQUEST)  # the bytes known from the beginning

    @property
    def size(self) -> int:
        return self._size

    def get_bytes(self, offset: int, length: int) -> bytes:
        end = min(offset + length, self._size)
        if end <= len(self._begin):
            return self._begin[offset:end]
        return self._request(offset, end - offset)[0]

    def close(self) -> None:
        """Do nothing: no connection stays open."""

    def _request(self, offset: int, length: int) -> tuple[bytes, int]:
        """Return the bytes of a range, or all bytes if the server has no ranges, and the size of the file."""
        try:
            request = Request(self._url, headers={"Range": f"bytes={offset}-{offset + length - 1}"})
            with urlopen(request, timeout=_TIMEOUT) as answer:
                is_whole = answer.status == HTTPStatus.OK
                data: bytes = answer.read(None if is_whole else length + 1)  # an answer by range may not end
                found = _RANGE.fullmatch(answer.headers.get("Content-Range", ""))
        except (URLError, HTTPException, OSError, ValueError) as error:
            reason = getattr(error, "reason", None) or error
            raise InputError(f"{self._url}: cannot be read ({reason}); check the address") from error
        if is_whole and offset == 0:
            return data, len(data)
        if found is None or int(found[1]) != offset or len(data) > length:
            raise InputError(f"{self._url}: the server answered without bytes {offset} ...; open it again")
        return data, int(found[2])
