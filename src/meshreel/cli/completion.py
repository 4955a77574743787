"""`meshreel completion`: a script that lets a shell complete commands and flags."""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module
from typing import Literal

from . import COMMANDS, make_app, place_of
from .console import Common


def command(shell: Literal["bash", "zsh", "fish"], /, *, common: Common = Common()) -> None:
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
