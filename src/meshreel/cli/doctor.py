"""`meshreel doctor`: what is installed, and what this machine can do with it."""

from __future__ import annotations

import os
import platform
import re
import shutil
import webbrowser
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.resources import files
from typing import Any, Literal

from rich.table import Table

from .. import __version__
from .console import Common

_NEEDS = re.compile(r"([A-Za-z0-9._-]+)[^;]*(?:;.*extra == [\"']([a-z0-9]+)[\"'])?")
_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "firefox")
_CODECS: dict[str, tuple[str, Literal["r", "w"]]] = {
    "AV1 decoded": ("libdav1d", "r"),
    "AV1 encoded": ("libsvtav1", "w"),
    "H.264 encoded": ("libx264", "w"),
}


def command(*, common: Common = Common()) -> None:
    """Tell what is installed, extra by extra, which video codecs there are, and whether there are a GPU and a browser."""
    row: dict[str, Any] = {"meshreel": __version__, "python": platform.python_version(), "system": platform.platform()}
    row |= {"cores": os.cpu_count(), "extras": _extras(), "codecs": _codecs(), "gpu": _gpu(), "browser": _browser()}
    row["player"] = (files("meshreel") / "player" / "meshreel-player.js").is_file()
    table = Table("extra", "installed", "missing")
    for extra, packages in row["extras"].items():
        there = ", ".join(f"{name} {found}" for name, found in packages.items() if found)
        table.add_row(extra, there, ", ".join(name for name, found in packages.items() if not found) or "nothing")
    codecs = ", ".join(f"{name}: {'yes' if there else 'no'}" for name, there in row["codecs"].items())
    lines = [
        f"meshreel {row['meshreel']}, Python {row['python']}, {row['system']}, {row['cores']} cores",
        table,
        f"codecs: {codecs or 'none (extra color)'}",
        f"GPU: {row['gpu'] or 'none found; only --splats and --sam3 use one'}",
        f"browser: {row['browser'] or 'none found; meshreel serve prints an address for another machine'}",
        f"player: {'built' if row['player'] else 'missing; run scripts/build-web, or install a wheel'}",
    ]
    common.result(row, *lines)


def _extras() -> dict[str, dict[str, str | None]]:
    """Return the packages of each extra, and of none, with their versions; None for those that are missing."""
    found: dict[str, dict[str, str | None]] = {}
    for line in requires("meshreel") or ():
        if (need := _NEEDS.match(line)) and need[1] != "meshreel":
            found.setdefault(need[2] or "(none)", {})[need[1]] = _version(need[1])
    return found


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _codecs() -> dict[str, bool]:
    """Return which codecs of textures PyAV has; nothing without it."""
    try:
        from av.codec import Codec
    except ImportError:
        return {}
    found = dict.fromkeys(_CODECS, False)
    for name, (codec, mode) in _CODECS.items():
        with suppress(ValueError):  # av's error of an unknown codec
            Codec(codec, mode)
            found[name] = True
    return found


def _gpu() -> str | None:
    """Return the GPU that torch finds, or that NVIDIA's driver is there without it; None: neither."""
    with suppress(ImportError):
        import torch

        return str(torch.cuda.get_device_name()) if torch.cuda.is_available() else None
    return "NVIDIA's driver is there, torch is not" if shutil.which("nvidia-smi") else None


def _browser() -> str | None:
    if (found := next(filter(None, map(shutil.which, _BROWSERS)), None)) is not None:
        return found
    with suppress(webbrowser.Error):
        return str(getattr(webbrowser.get(), "name", type(webbrowser.get()).__name__))
    return None
