"""Answers from memory: pages, and the files of the built player. In: bytes. Out: responses, in Brotli or gzip.

The build of the player brings `NAME.br` beside its larger files: on a slow line their Brotli shows the first frame
half a second sooner.
"""

from __future__ import annotations

import gzip
import threading
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.staticfiles import NotModifiedResponse, StaticFiles

from .library import Version, version_of
from .pages import policy

# Not from the system, whose list may be wrong (on Windows, it is in the registry) or missing.
TYPES = {
    ".css": "text/css",
    ".html": "text/html",
    ".js": "text/javascript",
    ".json": "application/json",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".txt": "text/plain",
    ".wasm": "application/wasm",
}
BYTES = "application/octet-stream"  # .reel files and unknown types
SAFE = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}
FRESH = SAFE | {"Cache-Control": "no-cache"}  # browsers may keep it, but must revalidate it
LASTING = SAFE | {"Cache-Control": "public, max-age=31536000, immutable"}  # for addresses that name their contents
PAGE = FRESH | {"Content-Security-Policy": policy()}
SUM = 12  # bytes of a sum that names contents: nobody finds two contents with one by chance


@dataclass(frozen=True, slots=True)
class Asset:
    """Bytes with their type, also compressed."""

    body: bytes
    media: str
    packed: dict[str, bytes]  # by coding, the smallest first; those alone that help
    digest: str  # sum over the body

    @staticmethod
    def of(body: bytes, media: str, brotli: bytes | None = None) -> Asset:
        """Compress a body; `brotli` is the same, compressed already."""
        codings = ({"br": brotli} if brotli is not None else {}) | {"gzip": gzip.compress(body, mtime=0)}
        packed = {coding: data for coding, data in codings.items() if len(data) < len(body)}
        return Asset(body, media, packed, blake2b(body, digest_size=SUM).hexdigest())

    def answer(self, asked: Headers, headers: dict[str, str]) -> Response:
        """Return the response to a request with the headers `asked`; each coding has an ETag of its own."""
        accepted = asked.get("accept-encoding", "")
        coding = next((coding for coding in self.packed if takes(accepted, coding)), None)
        headers = headers | {"ETag": f'"{self.digest}"', "Vary": "Accept-Encoding"}
        if coding is not None:
            headers |= {"ETag": f'"{self.digest}-{coding}"', "Content-Encoding": coding}
        response = Response(self.body if coding is None else self.packed[coding], 200, headers, self.media)
        return NotModifiedResponse(response.headers) if is_unchanged(asked, response.headers) else response


def takes(accepted: str, coding: str) -> bool:
    """Return whether a header Accept-Encoding allows a coding."""
    weights = {}
    for item in accepted.lower().split(","):
        name, _, weight = item.replace(" ", "").partition(";q=")
        weights[name] = weight
    weight = weights.get(coding, weights.get("*", "0"))
    return weight.strip("0.") != "" or weight == ""


def is_unchanged(asked: Headers, headers: Headers) -> bool:
    """Return whether the client has what a response with these headers would send."""
    return StaticFiles().is_not_modified(headers, asked)


class Player:
    """Files of the built player, read again when one of them has changed.

    Their addresses may begin with the `edition`, a sum over all of them: such an address is never used for other
    contents, so that browsers need not ask again.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._lock = folder, threading.Lock()
        self._seen: list[tuple[str, Version]] = []
        self._edition, self._files = "", dict[str, Asset]()

    def load(self) -> tuple[str, dict[str, Asset]]:
        """Return the edition and the files by name; "" and none where the player is not built."""
        with self._lock:
            files = sorted(path for path in self._folder.glob("*") if path.is_file())
            seen = [(path.name, version_of(path.stat())) for path in files]
            if seen != self._seen:
                bodies = {path.name: path.read_bytes() for path in files}
                self._files = {
                    name: Asset.of(body, TYPES.get(Path(name).suffix.lower(), BYTES), bodies.get(f"{name}.br"))
                    for name, body in bodies.items()
                    if not name.endswith(".br")
                }
                digests = (f"{name} {blake2b(body, digest_size=SUM).hexdigest()}\n" for name, body in bodies.items())
                self._edition = blake2b("".join(digests).encode(), digest_size=SUM).hexdigest() if files else ""
                self._seen = seen
            return self._edition, self._files

    async def answer(self, request: Request) -> Response:
        """Return a file of the player."""
        edition, files = await run_in_threadpool(self.load)
        path = request.path_params["path"]
        name = path.removeprefix(f"{edition}/")
        if name not in files:
            raise HTTPException(404, "there is no such file")
        lasting = LASTING if name != path else FRESH
        return files[name].answer(request.headers, PAGE if files[name].media == "text/html" else lasting)
