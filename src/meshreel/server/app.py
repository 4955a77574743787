"""The server as an ASGI application. In: a library of files and the folder of the built player. Out: answers.

Files go out in pieces, whole or by range, with an ETag and as they are: a .reel file does not get smaller.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

import anyio
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.cors import CORSMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import NotModifiedResponse, StaticFiles
from starlette.types import Scope

from ..errors import InputError
from .library import Library, as_text
from .pages import PLAIN, POLICY, STYLE, gallery_page, player_page
from .posters import Posters, poster_tag

# Fixed here: the system's own list may have others (Windows: that of its registry), or none.
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
BYTES = "application/octet-stream"  # .reel files, and what is not known
EXPOSED = ("Accept-Ranges", "Content-Length", "Content-Range", "ETag")
SAFE = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}
FRESH = SAFE | {"Cache-Control": "no-cache"}  # may be kept, but is asked for each time
PAGE = FRESH | {"Content-Security-Policy": POLICY}
_ORIGIN = re.compile(r"\*|https?://[^\s/?#@]+")


def built_player() -> Path:
    """The folder of the player that comes with the package."""
    return Path(__file__).parents[1] / "player"


def make_app(
    library: Library, player: Path | None = None, cors: Sequence[str] = (), hosts: Sequence[str] = ("*",)
) -> Starlette:
    """Serves a library to who asks for one of `hosts`; `cors` are the origins whose pages may read, "*" for all.

    `/` plays the file where there is one alone, else it is a gallery; `/watch/NAME` plays a file, `/files/NAME` is it.
    Raises InputError where an origin is none.
    """
    pages = _Pages(library)
    routes = [
        Route("/", pages.home),
        Route("/watch/{name:path}", pages.watch),
        Route("/posters/{name:path}.png", _PosterRoute(library).poster),
        Route("/style.css", lambda _: Response(STYLE, media_type="text/css", headers=FRESH)),
        Mount("/player", _Static(directory=player or built_player(), check_dir=False)),
        Mount("/files", _ReelFiles(library)),
    ]
    middleware = [Middleware(TrustedHostMiddleware, allowed_hosts=hosts, www_redirect=False), *_cors(cors)]
    return Starlette(routes=routes, middleware=middleware, exception_handlers={OSError: _gone})


def _cors(origins: Sequence[str]) -> list[Middleware]:
    for origin in origins:
        if not _ORIGIN.fullmatch(origin):
            raise InputError(f"--cors {origin!r}: give scheme, host and port alone, as https://example.org, or *")
    if not origins:
        return []
    return [
        Middleware(
            CORSMiddleware,
            allow_origins=[origin.lower() for origin in origins],
            allow_methods=("GET", "HEAD"),
            allow_headers=("Range", "If-Range", "If-None-Match"),
            allow_private_network=True,  # a page on the web may ask a server in the local network
            expose_headers=EXPOSED,
        )
    ]


class _Static(StaticFiles):
    """Files of a folder, with types of our own; a new build is seen at once."""

    def file_response(
        self,
        full_path: str | os.PathLike[str],
        stat_result: os.stat_result,
        scope: Scope,
        status_code: int = 200,
    ) -> Response:
        media = TYPES.get(Path(full_path).suffix.lower(), BYTES)
        headers = PAGE if media == "text/html" else FRESH
        response = FileResponse(full_path, status_code, headers, media, stat_result=stat_result)
        if self.is_not_modified(response.headers, Headers(scope=scope)):
            return NotModifiedResponse(response.headers)
        return response


class _ReelFiles(_Static):
    """The files of a library, and no others of its folder."""

    def __init__(self, library: Library) -> None:
        super().__init__(directory=library.folder, check_dir=False)
        self._library = library

    def lookup_path(self, path: str) -> tuple[str, os.stat_result | None]:
        found = self._library.path_of(path.replace(os.sep, "/"))
        if found is None:
            return "", None
        try:  # now: once an answer has begun it can only break off
            with found.open("rb") as file:
                return str(found), os.fstat(file.fileno())
        except PermissionError as error:
            raise HTTPException(403, f"cannot be read: {error.strerror}") from error


class _Pages:
    def __init__(self, library: Library) -> None:
        self._library = library

    async def home(self, _: Request) -> Response:
        """The one file, or all."""
        if self._library.only is not None:
            return HTMLResponse(player_page(self._library.only), headers=PAGE)
        return HTMLResponse(await run_in_threadpool(self._gallery), headers=PAGE)

    async def watch(self, request: Request) -> Response:
        """One file."""
        name = request.path_params["name"]
        if await run_in_threadpool(self._library.path_of, name) is None:
            raise HTTPException(404, f"there is no file {name}")
        return HTMLResponse(player_page(name), headers=PAGE)

    def _gallery(self) -> str:
        title = as_text(self._library.folder.resolve().name) or "meshreel"
        return gallery_page(title, [self._library.entry(name) for name in self._library.names()])


class _PosterRoute:
    def __init__(self, library: Library) -> None:
        self._library, self._posters = library, Posters()
        self._one = anyio.CapacityLimiter(1)  # drawn one by one, in a thread that no file waits for

    async def poster(self, request: Request) -> Response:
        """A file's poster, or a plain tile where there is nothing to show."""
        path = await run_in_threadpool(self._library.path_of, request.path_params["name"])
        if path is None:
            raise HTTPException(404, "there is no such file")
        tag = await run_in_threadpool(poster_tag, path)
        if tag is None:
            return _plain()
        headers = Headers(FRESH | {"ETag": tag})
        if StaticFiles().is_not_modified(headers, request.headers):
            return NotModifiedResponse(headers)
        picture = await anyio.to_thread.run_sync(self._posters.of, path, tag, limiter=self._one)
        return _plain() if picture is None else Response(picture, media_type="image/png", headers=headers)


def _plain() -> Response:
    """Without a tag, and not to be kept: with the renderer installed there may be a poster."""
    return Response(PLAIN, media_type="image/svg+xml", headers=SAFE | {"Cache-Control": "no-store"})


async def _gone(_: Request, error: Exception) -> Response:
    """A file that went away, or cannot be read, after it was found."""
    assert isinstance(error, OSError)
    return PlainTextResponse(f"cannot be read: {error.strerror or type(error).__name__}", 404)
