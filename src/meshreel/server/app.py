"""The server as an ASGI application. In: a library of files and the folder of the built player. Out: answers.

Files go out in pieces, whole or by range, with an ETag and as they are: a .reel file does not get smaller.
"""

from __future__ import annotations

import mimetypes
import os
from pathlib import Path

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from .library import SUFFIX, Library
from .pages import PLAIN, POLICY, STYLE, gallery_page, player_page
from .posters import Posters

TYPES = {".js": "text/javascript", ".wasm": "application/wasm", ".css": "text/css", SUFFIX: "application/octet-stream"}
EXPOSED = ("Accept-Ranges", "Content-Length", "Content-Range", "ETag")
SAFE = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}


def built_player() -> Path:
    """The folder of the player that comes with the package."""
    return Path(__file__).parents[1] / "player"


def make_app(library: Library, player: Path | None = None, cors: tuple[str, ...] = ()) -> Starlette:
    """Serves a library; `cors` are the origins whose pages may read from it, "*" for all.

    `/` plays the file where there is one alone, else it is a gallery; `/watch/NAME` plays a file, `/files/NAME` is it.
    """
    for suffix, media in TYPES.items():  # the system's own list may have others, or none
        mimetypes.add_type(media, suffix)
    routes = [
        Route("/", _Pages(library).home),
        Route("/watch/{name:path}", _Pages(library).watch),
        Route("/posters/{name:path}.png", _PosterRoute(library).poster),
        Route("/style.css", lambda _: Response(STYLE, media_type="text/css", headers=SAFE)),
        Mount("/player", _Static(directory=player or built_player())),
        Mount("/files", _ReelFiles(library)),
    ]
    middleware = []
    if cors:
        allowed = ("GET", "HEAD"), ("Range", "If-Range", "If-None-Match")
        middleware = [
            Middleware(
                CORSMiddleware,
                allow_origins=cors,
                allow_methods=allowed[0],
                allow_headers=allowed[1],
                expose_headers=EXPOSED,
            )
        ]
    return Starlette(routes=routes, middleware=middleware, exception_handlers={OSError: _gone})


class _Static(StaticFiles):
    """Files of a folder; a new build is seen at once."""

    def file_response(self, *arguments: object, **options: object) -> Response:
        response = super().file_response(*arguments, **options)  # type: ignore[arg-type]
        response.headers.update(SAFE | {"Cache-Control": "no-cache"})
        return response


class _ReelFiles(_Static):
    """The files of a library, and no others of its folder."""

    def __init__(self, library: Library) -> None:
        super().__init__(directory=library.folder, check_dir=False)
        self._library = library

    def lookup_path(self, path: str) -> tuple[str, os.stat_result | None]:
        found = self._library.path_of(path.replace(os.sep, "/"))
        try:
            return ("", None) if found is None else (str(found), found.stat())
        except FileNotFoundError:
            return "", None


class _Pages:
    def __init__(self, library: Library) -> None:
        self._library = library

    async def home(self, _: Request) -> Response:
        """The one file, or all."""
        if self._library.only is not None:
            return _page(player_page(self._library.only))
        return _page(await run_in_threadpool(self._gallery))

    async def watch(self, request: Request) -> Response:
        """One file."""
        name = request.path_params["name"]
        if await run_in_threadpool(self._library.path_of, name) is None:
            raise HTTPException(404, f"there is no file {name}")
        return _page(player_page(name))

    def _gallery(self) -> str:
        title = self._library.folder.resolve().name or "meshreel"
        return gallery_page(title, [self._library.entry(name) for name in self._library.names()])


class _PosterRoute:
    def __init__(self, library: Library) -> None:
        self._library, self._posters = library, Posters()

    async def poster(self, request: Request) -> Response:
        """A file's poster, or a plain tile where there is nothing to show."""
        path = await run_in_threadpool(self._library.path_of, request.path_params["name"])
        if path is None:
            raise HTTPException(404, "there is no such file")
        picture = await run_in_threadpool(self._posters.of, path)
        headers = SAFE | {"Cache-Control": "no-cache"}
        if picture is None:
            return Response(PLAIN, media_type="image/svg+xml", headers=headers)
        return Response(picture, media_type="image/png", headers=headers)


def _page(text: str) -> Response:
    return HTMLResponse(text, headers=SAFE | {"Content-Security-Policy": POLICY})


async def _gone(_: Request, error: Exception) -> Response:
    """A file that went away, or cannot be read, after it was found."""
    assert isinstance(error, OSError)
    return PlainTextResponse(f"cannot be read: {error.strerror or error}", 404)
