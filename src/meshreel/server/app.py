"""ASGI application of the server. In: a library of files and the folder of the built player. Out: HTTP responses."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.cors import CORSMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route
from starlette.staticfiles import NotModifiedResponse

from .. import __version__
from ..errors import InputError
from . import files
from .assets import FRESH, PAGE, SAFE, Asset, Player, is_unchanged
from .library import Facts, Library, as_text
from .pages import PLAIN, gallery_page, player_page, policy
from .posters import Posters

EXPOSED = ("Accept-Ranges", "Content-Length", "Content-Range", "ETag")
_ORIGIN = re.compile(r"\*|https?://[^\s/?#@]+")


def make_app(
    library: Library, player: Path | None = None, cors: Sequence[str] = (), hosts: Sequence[str] = ("*",)
) -> Starlette:
    """Return the application for a library: it answers requests for `hosts`, and pages of the origins `cors` may read.

    "*" allows all of them. `/` plays the file of a library with `only` one, otherwise it is a gallery; `/watch/NAME`
    plays a file and `/files/NAME` sends it. Raises InputError for a malformed origin.
    """
    built, posters = Player(player or Path(__file__).parents[1] / "player"), Posters()
    style = Asset.of(Path(__file__).with_name("gallery.css").read_bytes(), "text/css")
    pages = _Pages(library, built, posters)
    routes = [
        Route("/", pages.home),
        Route("/watch/{name:path}", pages.watch),
        Route("/files/{name:path}", pages.file),
        Route("/posters/{name:path}.png", pages.poster),
        Route("/style.css", lambda request: style.answer(request.headers, FRESH)),
        Route("/player/{path:path}", built.answer),
    ]

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        try:
            yield
        finally:
            posters.close()

    middleware = [Middleware(TrustedHostMiddleware, allowed_hosts=hosts, www_redirect=False), *_cors(cors)]
    return Starlette(routes=routes, middleware=middleware, exception_handlers={OSError: _gone}, lifespan=lifespan)


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


class _Pages:
    def __init__(self, library: Library, player: Player, posters: Posters) -> None:
        self._library, self._player, self._posters = library, player, posters
        self._facts = Facts(library)

    async def home(self, request: Request) -> Response:
        """Return the player of the only file, or the gallery."""
        if self._library.only is not None:
            return await run_in_threadpool(self._watch, request, self._library.only)
        return await run_in_threadpool(self._gallery, request)

    async def watch(self, request: Request) -> Response:
        """Return the page that plays one file."""
        name = request.path_params["name"]
        await self._path(name)
        return await run_in_threadpool(self._watch, request, name)

    async def file(self, request: Request) -> Response:
        """Return a file, or ranges of it."""
        path = await self._path(request.path_params["name"])
        try:
            opened = await run_in_threadpool(files.OpenFile.of, path)
        except PermissionError as error:
            raise HTTPException(403, f"cannot be read: {error.strerror}") from error
        return files.answer(opened, request.headers, request.method == "HEAD")

    async def poster(self, request: Request) -> Response:
        """Return the poster of a file, or a plain tile if it has none."""
        path = await self._path(request.path_params["name"])
        tag = await run_in_threadpool(files.tag_of, path)
        if tag is None:
            return _plain()
        headers = FRESH | {"ETag": f'{tag[:-1]}-{__version__}"'}
        if is_unchanged(request.headers, Headers(headers)):
            return NotModifiedResponse(Headers(headers))
        picture = await self._posters.of(path, tag)
        return _plain() if picture is None else Response(picture, media_type="image/png", headers=headers)

    async def _path(self, name: str) -> Path:
        path = await run_in_threadpool(self._library.path_of, name)
        if path is None:
            raise HTTPException(404, f"there is no file {name}")
        return path

    def _watch(self, request: Request, name: str) -> Response:
        edition, files = self._player.load()
        styles = files["page.css"].body.decode() if "page.css" in files else ""
        page = player_page(name, f"/player/{edition}" if edition else "/player", styles)
        headers = PAGE | {"Content-Security-Policy": policy(styles)}
        return Asset.of(page.encode(), "text/html").answer(request.headers, headers)

    def _gallery(self, request: Request) -> Response:
        title = as_text(self._library.folder.resolve().name) or "meshreel"
        page = gallery_page(title, self._facts.entries())
        return Asset.of(page.encode(), "text/html").answer(request.headers, PAGE)


def _plain() -> Response:
    """Return the plain tile, not to be cached: once the renderer is installed, there may be a poster."""
    return Response(PLAIN, media_type="image/svg+xml", headers=SAFE | {"Cache-Control": "no-store"})


async def _gone(_: Request, error: Exception) -> Response:
    """Answer for a file that was found, but then disappeared or cannot be read."""
    assert isinstance(error, OSError)
    return PlainTextResponse(f"cannot be read: {error.strerror or type(error).__name__}", 404)
