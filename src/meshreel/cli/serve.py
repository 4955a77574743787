"""`meshreel play` and `serve`: play one .reel file in a browser, or serve a folder of them as a gallery."""

from __future__ import annotations

import threading
import webbrowser
from pathlib import Path

from ..decoder.video import open as open_video
from ..errors import InputError
from ..server.app import make_app
from ..server.library import Library
from ..server.run import ServerOptions, run
from .console import Common


def play(
    file: Path, /, *, browser: bool = True, server: ServerOptions = ServerOptions(), common: Common = Common()
) -> None:
    """Play a .reel file in a browser, on this machine or on a headset. Ctrl-C stops it.

    Parameters
    ----------
    file
        The .reel file.
    browser
        Open the page in the browser of this machine.
    """
    with open_video(file):  # a damaged file is an error before the server starts
        pass

    def announce(urls: list[str]) -> None:
        common.result({"file": str(file), "addresses": urls}, f"playing {file} at {' '.join(urls)}  (Ctrl-C stops)")
        if browser:  # in a thread: a text browser returns only when it is closed
            threading.Thread(target=_open, args=(urls[0], common), daemon=True).start()

    run(make_app(Library.of_file(file), hosts=server.hosts), server, announce)


def _open(address: str, common: Common) -> None:
    if not webbrowser.open(address):
        common.note(f"no browser was found: open {address}")


def serve(
    folder: Path, /, *, cors: tuple[str, ...] = (), server: ServerOptions = ServerOptions(), common: Common = Common()
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
