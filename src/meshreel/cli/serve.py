"""`meshreel serve`: serve a folder of .reel files as a gallery."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..errors import InputError
from ..server.app import make_app
from ..server.library import Library
from ..server.run import ServerOptions, run
from .console import Common


def command(
    folder: Path,
    /,
    *,
    cors: tuple[str, ...] = (),
    server: Annotated[ServerOptions, Parameter(name="*")] = ServerOptions(),
    common: Common = Common(),
) -> None:
    """Serve a folder of .reel files: a gallery, a page that plays each, and the files. Ctrl-C stops it.

    Parameters
    ----------
    folder
        The folder; its subfolders are included. It is listed again for each request.
    cors
        Origin whose pages may read the files, such as https://example.org, or * for all; can be repeated.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no folder; give one with .reel files, or use meshreel play for one file")

    def announce(urls: list[str]) -> None:
        text = f"serving {folder} at {' '.join(urls)}  (Ctrl-C stops)"
        common.result({"folder": str(folder), "addresses": urls}, text)

    run(make_app(Library(folder), cors=cors, hosts=server.hosts), server, announce)
