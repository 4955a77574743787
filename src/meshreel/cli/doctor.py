"""`meshreel doctor`: installed packages and extras, and what this machine can do with them."""

from __future__ import annotations

import platform
import re
import webbrowser
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.resources import files
from typing import Any

from rich.table import Table

from .. import __version__
from .console import Common

_NEEDS = re.compile(r"([A-Za-z0-9._-]+)[^;]*(?:;.*extra == [\"']([a-z0-9]+)[\"'])?")
_CODECS = {"AV1 decoded": "libdav1d", "AV1 encoded": "libsvtav1", "H.264 encoded": "libx264"}


def command(*, common: Common = Common()) -> None:
    """Report installed packages by extra, the video codecs, and if a GPU and a browser are found."""
    row: dict[str, Any] = {"meshreel": __version__, "python": platform.python_version(), "system": platform.platform()}
    row |= {"extras": _extras(), "codecs": _codecs(), "gpu": _gpu()}
    row["browser"] = _browser()
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
