"""`meshreel play` and `serve`: play one .reel file in a browser, or serve a folder of them as a gallery."""

from __future__ import annotations

import threading
import webbrowser
from contextlib import nullcontext
from importlib.resources import as_file, files
from pathlib import Path
from tempfile import TemporaryDirectory

from ..decoder.video import open as open_video
from ..errors import FormatError, InputError
from ..io.meshes import EXTENSIONS
from ..server.app import make_app
from ..server.library import Library
from ..server.run import ServerOptions, run
from .console import Common, called_as

SAMPLE = "sample.reel"  # in the package of the server: what `meshreel demo` leaves


def play(
    input: Path | None = None,
    /,
    *,
    browser: bool = True,
    server: ServerOptions = ServerOptions(),
    common: Common = Common(),
) -> None:
    """Play a .reel file in a browser, on this machine or on a headset. Ctrl-C stops it.

    Parameters
    ----------
    input
        The .reel file; or a folder of meshes or of a rig, which is encoded fast for this play alone. Without
        one, a sample plays: people in a room, recorded by simulated cameras.
    browser
        Open the page in the browser of this machine.
    """
    sample = files("meshreel") / "server" / SAMPLE
    with (
        TemporaryDirectory(prefix="meshreel-") as scratch,
        as_file(sample) if input is None else nullcontext(input) as file,
    ):
        if file.is_dir():
            file = _encoded(file, Path(scratch), common)
        try:
            with open_video(file):  # a damaged file is an error before the server starts
                pass
        except FormatError as error:
            if file.suffix.lower() in EXTENSIONS:
                error.add_note(f"encode it first: {called_as()} encode {file} -o {file.with_suffix('.reel')}")
            raise

        def announce(urls: list[str]) -> None:
            common.result({"file": str(file), "addresses": urls}, f"playing {file} at {' '.join(urls)}  (Ctrl-C stops)")
            if browser:  # in a thread: a text browser returns only when it is closed
                threading.Thread(target=_open, args=(urls[0], common), daemon=True).start()

        run(make_app(Library.of_file(file), hosts=server.hosts), server, announce)


def _encoded(folder: Path, scratch: Path, common: Common) -> Path:
    """Encode meshes or a recording fast, into a folder that is deleted after the play; return the file."""
    from ..encoder.sequence import encode  # with packages that playing needs none of
    from ..geometry.derived_sequences import upright
    from .sources import Reading, open_source

    file = scratch / f"{folder.resolve().stem}.reel"
    try:
        source = open_source([str(folder)], Reading(), common)
    except InputError as error:
        if any(folder.glob("*.reel")):
            error.add_note(f"show its .reel files with: {called_as()} serve {folder}")
        raise
    with common.stages() as progress:
        summary = encode(upright(source.sequence, None), file, effort="fast", progress=progress.encode)
    common.warn((*source.warnings, *summary.warnings))
    common.note(f"encoded fast, for this play alone; to keep it: {called_as()} encode {folder} -o {file.name}")
    return file


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
