"""`meshreel doctor`, `player` and `completion`: what is installed, the player's files, and a script for a shell."""

from __future__ import annotations

import platform
import re
import webbrowser
from contextlib import suppress
from importlib import import_module
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, Literal

from rich.table import Table

from .. import __version__
from ..errors import InputError
from ..io.write import check_free, make_folder, write_file
from . import COMMANDS, make_app, place_of
from .console import Common, Force

_NEEDS = re.compile(r"([A-Za-z0-9._-]+)[^;]*(?:;.*extra == [\"']([a-z0-9]+)[\"'])?")
_CODECS = {"AV1 decoded": "libdav1d", "AV1 encoded": "libsvtav1", "H.264 encoded": "libx264"}
EMBED = """\
<script type="module" src="{folder}/load.js"></script>
<meshreel-player src="walk.reel" controls loop style="width: 640px; aspect-ratio: 16 / 9"></meshreel-player>"""


def doctor(*, common: Common = Common()) -> None:
    """Report installed packages by extra, the video codecs, and if a GPU and a browser are found."""
    row: dict[str, Any] = {"meshreel": __version__, "python": platform.python_version(), "system": platform.platform()}
    row |= {"extras": _extras(), "codecs": _codecs(), "gpu": _gpu(), "browser": _browser()}
    row["player"] = (files("meshreel") / "player" / "meshreel-player.js").is_file()
    table = Table("extra", "installed", "missing")
    for extra, packages in row["extras"].items():
        present = ", ".join(f"{name} {release}" for name, release in packages.items() if release)
        table.add_row(extra, present, ", ".join(name for name, release in packages.items() if not release) or "nothing")
    codecs = ", ".join(f"{name}: {'yes' if present else 'no'}" for name, present in row["codecs"].items())
    common.result(
        row,
        f"meshreel {row['meshreel']}, Python {row['python']}, {row['system']}",
        table,
        f"codecs: {codecs or 'none (extra color)'}",
        f"GPU: {row['gpu'] or 'none found; only --sam3 uses one'}",
        f"browser: {row['browser'] or 'none found; meshreel serve prints an address for another machine'}",
        f"player: {'built' if row['player'] else 'missing; run scripts/build-web, or install a wheel'}",
    )


def _extras() -> dict[str, dict[str, str | None]]:
    """Return the packages of each extra, and those needed always, with versions; None for missing packages."""
    extras: dict[str, dict[str, str | None]] = {}
    for line in requires("meshreel") or ():
        if (need := _NEEDS.match(line)) and need[1] != "meshreel":
            packages = extras.setdefault(need[2] or "(none)", {})
            try:
                packages[need[1]] = version(need[1])
            except PackageNotFoundError:
                packages[need[1]] = None
    return extras


def _codecs() -> dict[str, bool]:
    """Return the codecs of textures, True for those that PyAV has; nothing without PyAV."""
    try:
        from av import codecs_available
    except ImportError:
        return {}
    return {name: codec in codecs_available for name, codec in _CODECS.items()}


def _browser() -> str | None:
    """Return the browser that `meshreel play` and `Video.show` open; None without one."""
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return None
    return str(getattr(browser, "name", type(browser).__name__))


def _gpu() -> str | None:
    """Return the GPU that torch finds; None without one, or without torch."""
    try:
        import torch
    except ImportError:
        return None
    return str(torch.cuda.get_device_name()) if torch.cuda.is_available() else None


def player(*, copy_to: Path | None = None, force: Force = False, common: Common = Common()) -> None:
    """Copy the player's files for a web server, or print the folder where they are.

    Parameters
    ----------
    copy_to
        The folder to copy them to, made if needed. The files stay together.
    """
    with as_file(files("meshreel") / "player") as folder:
        built = sorted(path for path in folder.iterdir() if path.is_file())
        if not any(path.name == "meshreel-player.js" for path in built):
            raise InputError(f"{folder}: the player is not built; run scripts/build-web, or install a wheel")
        if copy_to is None:
            common.result({"folder": str(folder), "files": [path.name for path in built]}, str(folder))
            return
        check_free((copy_to / path.name for path in built), force)
        make_folder(copy_to)
        for path in built:
            write_file(copy_to / path.name, path.read_bytes())
    embed = EMBED.format(folder=copy_to.resolve().name)  # "." has no name
    text = f"{copy_to}: {len(built)} files; in a page beside that folder:\n{embed}"
    common.result({"folder": str(copy_to), "files": [path.name for path in built]}, text)


def completion(shell: Literal["bash", "zsh", "fish"], /, *, common: Common = Common()) -> None:
    """Print a script that lets a shell complete commands and flags.

    It lacks the flags of commands whose packages are not installed.

    Parameters
    ----------
    shell
        The shell: append the script to ~/.bashrc, or write it where zsh or fish look for completions.
    """
    usable = list[str]()
    for name in COMMANDS:
        with suppress(ImportError):
            import_module(place_of(name).partition(":")[0])
            usable.append(name)
    script = make_app(usable).generate_completion(shell=shell)
    if common.json or common.quiet:
        common.result({"shell": shell, "script": script})
    else:
        print(script)
