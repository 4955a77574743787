"""ASGI application of the server. In: a library of files and the folder of the built player. Out: HTTP responses."""

from __future__ import annotations

import asyncio
import os
import re
from collections.abc import Mapping, Sequence
from hashlib import blake2b
from pathlib import Path

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.cors import CORSMiddleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.staticfiles import NotModifiedResponse, StaticFiles

from ..errors import InputError
from ..web import begun
from .library import OF_STUDIES, SUFFIX, Library, as_text
from .pages import gallery_page, player_page, policy

EXPOSED = ("Accept-Ranges", "Content-Length", "Content-Range", "ETag")
# Not from the system, whose list may be wrong (on Windows, it is in the registry) or missing.
TYPES = {".css": "text/css", ".html": "text/html", ".js": "text/javascript", ".txt": "text/plain"}
TYPES |= {".wasm": "application/wasm"}
BYTES = "application/octet-stream"  # .reel files and unknown types
SAFE = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}
FRESH = SAFE | {"Cache-Control": "no-cache"}  # browsers may keep it, but must revalidate it
LASTING = SAFE | {"Cache-Control": "public, max-age=31536000, immutable"}  # for addresses that name their contents
SUM = 12  # bytes of the sum in such an address
_OWN = Path(__file__).parent
_ORIGIN = re.compile(r"\*|https?://[^\s/?#@]+")


def make_app(
    library: Library, player: Path | None = None, cors: Sequence[str] = (), hosts: Sequence[str] = ("*",)
) -> Starlette:
    """Return the application for a library: it answers requests for `hosts`, and pages of the origins `cors` may read.

    "*" allows all of them. `/` plays the file of a library with `only` one, otherwise it is a gallery; `/watch/NAME`
    plays a file and `/files/NAME` sends it, or a file of a study. Raises InputError for a malformed origin.
    """
    pages = _Pages(library, player or _OWN.parent / "player")
    packed = [Middleware(GZipMiddleware)]
    routes = [
        Route("/", pages.home, middleware=packed),
        Route("/watch/{name:path}", pages.watch, middleware=packed),
        Route("/files/{name:path}", pages.file),
        Route("/gallery.{kind}", pages.own),
        Route("/player/{path:path}", pages.player, middleware=packed),
    ]
    for origin in cors:
        if not _ORIGIN.fullmatch(origin):
            raise InputError(f"--cors {origin!r}: give scheme, host and port alone, as https://example.org, or *")
    sharing = Middleware(
        CORSMiddleware,
        allow_origins=[origin.lower() for origin in cors],
        allow_methods=("GET", "HEAD"),
        allow_headers=("Range", "If-Range", "If-None-Match"),
        allow_private_network=True,  # pages on the web may request files from the local network
        expose_headers=EXPOSED,
    )
    middleware = [Middleware(TrustedHostMiddleware, allowed_hosts=hosts, www_redirect=False)]
    middleware += [sharing] if cors else []
    return Starlette(routes=routes, middleware=middleware, exception_handlers={OSError: _gone})


class _Pages:
    """Responses to all requests. The player's files are read once: after a build, start the server again."""

    def __init__(self, library: Library, player: Path) -> None:
        self._library, self._player = library, player
        built = {path.name: path.read_bytes() for path in sorted(player.glob("*")) if path.is_file()}
        self._names = set(built)
        self._edition = blake2b(b"".join(built.values()), digest_size=SUM).hexdigest()
        self._styles = built.get("page.css", b"").decode()
        self._gallery: asyncio.Future[str] | None = None

    async def home(self, request: Request) -> Response:
        """Return the only file's player, or the gallery, which is made once for all clients that wait."""
        if self._library.only is not None:
            return self._watch(self._library.only)
        if self._gallery is None or self._gallery.done():
            self._gallery = asyncio.wrap_future(begun(self._drawn))
        made, left = self._gallery, asyncio.ensure_future(_has_left(request))
        try:
            await asyncio.wait((made, left), return_when=asyncio.FIRST_COMPLETED)
        finally:
            left.cancel()
        return _page(made.result(), policy()) if made.done() else Response()

    def _drawn(self) -> str:
        title = as_text(self._library.folder.resolve().name) or "meshreel"
        return gallery_page(title, self._library.entries(), f"/player/{self._edition}")

    async def watch(self, request: Request) -> Response:
        name = request.path_params["name"]
        await self._path(name)
        return self._watch(name)

    async def file(self, request: Request) -> Response:
        """Return a .reel file, or what a study needs beside it, or ranges of it."""
        path = await self._path(request.path_params["name"], (SUFFIX, *OF_STUDIES))
        return await _file(request, path, BYTES, FRESH)

    async def own(self, request: Request) -> Response:
        """Return the style or the script of the gallery."""
        if (kind := f".{request.path_params['kind']}") not in (".css", ".js"):
            raise HTTPException(404)
        return await _file(request, _OWN / f"gallery{kind}", TYPES[kind], FRESH)

    async def player(self, request: Request) -> Response:
        """Return a file of the player, in Brotli if it can. Browsers keep addresses with the sum over all."""
        path = request.path_params["path"]
        name = path.removeprefix(f"{self._edition}/")
        if name not in self._names or name.endswith(".br"):
            raise HTTPException(404, "there is no such file")
        headers, kind = LASTING if name != path else FRESH, TYPES.get(Path(name).suffix, BYTES)
        headers |= {"Content-Security-Policy": policy()} if kind == "text/html" else {}
        if f"{name}.br" in self._names:
            headers |= {"Vary": "Accept-Encoding"}
            if "br" in request.headers.get("accept-encoding", "").replace(" ", "").split(","):
                return await _file(request, self._player / f"{name}.br", kind, headers | {"Content-Encoding": "br"})
        return await _file(request, self._player / name, kind, headers)

    async def _path(self, name: str, endings: tuple[str, ...] = (SUFFIX,)) -> Path:
        path = await run_in_threadpool(self._library.path_of, name, endings)
        if path is None:
            raise HTTPException(404, f"there is no file {name}")
        return path

    def _watch(self, name: str) -> Response:
        return _page(player_page(name, f"/player/{self._edition}", self._styles), policy(self._styles))


async def _has_left(request: Request) -> None:
    """Wait until the client has left."""
    while (await request.receive())["type"] != "http.disconnect":
        pass


def _page(text: str, rules: str) -> Response:
    return HTMLResponse(text, headers=FRESH | {"Content-Security-Policy": rules})


async def _file(request: Request, path: Path, kind: str, headers: Mapping[str, str]) -> Response:
    """Return a file, or ranges of it. Raises OSError if it is not there any more."""
    found = await run_in_threadpool(path.stat)
    if not os.access(path, os.R_OK):
        raise HTTPException(403, "cannot be read: Permission denied")
    response = FileResponse(path, headers=headers, media_type=kind, stat_result=found)
    is_known = StaticFiles().is_not_modified(response.headers, request.headers)
    return NotModifiedResponse(response.headers) if is_known else response


async def _gone(_: Request, error: Exception) -> Response:
    """Answer for a file that was found, but then disappeared or cannot be read."""
    assert isinstance(error, OSError)
    return PlainTextResponse(f"cannot be read: {error.strerror or type(error).__name__}", 404)
