"""ASGI application of the server. In: a library of files and the folder of the built player. Out: HTTP responses.

Files are sent whole or by range, with an ETag and without compression, which would not make a .reel file smaller.
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
EXPOSED = ("Accept-Ranges", "Content-Length", "Content-Range", "ETag")
SAFE = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}
FRESH = SAFE | {"Cache-Control": "no-cache"}  # browsers may keep it, but must revalidate it
PAGE = FRESH | {"Content-Security-Policy": POLICY}
_ORIGIN = re.compile(r"\*|https?://[^\s/?#@]+")


def built_player() -> Path:
    """Return the folder of the player in the package."""
    return Path(__file__).parents[1] / "player"


def make_app(
    library: Library, player: Path | None = None, cors: Sequence[str] = (), hosts: Sequence[str] = ("*",)
) -> Starlette:
    """Return the application for a library: it answers requests for `hosts`, and pages of the origins `cors` may read.

    "*" allows all of them. `/` plays the file of a library with `only` one, otherwise it is a gallery; `/watch/NAME`
    plays a file and `/files/NAME` sends it. Raises InputError for a malformed origin.
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
            allow_private_network=True,  # pages on the web may request files from the local network
            expose_headers=EXPOSED,
        )
    ]


class _Static(StaticFiles):
    """Files of a folder, with the types above and revalidation, so that a new build shows at once."""

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
    """The files of a library, and no others in its folder."""

    def __init__(self, library: Library) -> None:
        super().__init__(directory=library.folder, check_dir=False)
        self._library = library

    def lookup_path(self, path: str) -> tuple[str, os.stat_result | None]:
        found = self._library.path_of(path.replace(os.sep, "/"))
        if found is None:
            return "", None
        try:  # here, because a response that has begun cannot become an error
            with found.open("rb") as file:
                return str(found), os.fstat(file.fileno())
        except PermissionError as error:
            raise HTTPException(403, f"cannot be read: {error.strerror}") from error


class _Pages:
    def __init__(self, library: Library) -> None:
        self._library = library

    async def home(self, _: Request) -> Response:
        """Return the player of the only file, or the gallery."""
        if self._library.only is not None:
            return HTMLResponse(player_page(self._library.only), headers=PAGE)
        return HTMLResponse(await run_in_threadpool(self._gallery), headers=PAGE)

    async def watch(self, request: Request) -> Response:
        """Return the page that plays one file."""
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
        self._one = anyio.CapacityLimiter(1)  # posters are drawn one at a time, in a thread of their own

    async def poster(self, request: Request) -> Response:
        """Return the poster of a file, or a plain tile if it has none."""
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
    """Return the plain tile, not to be cached: once the renderer is installed, there may be a poster."""
    return Response(PLAIN, media_type="image/svg+xml", headers=SAFE | {"Cache-Control": "no-store"})


async def _gone(_: Request, error: Exception) -> Response:
    """Answer for a file that was found, but then disappeared or cannot be read."""
    assert isinstance(error, OSError)
    return PlainTextResponse(f"cannot be read: {error.strerror or type(error).__name__}", 404)
