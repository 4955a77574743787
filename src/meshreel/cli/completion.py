"""`meshreel completion`: the script by which a shell completes commands and flags."""

from __future__ import annotations

from importlib import import_module
from typing import Literal

from . import COMMANDS, make_app, place_of
from .console import Common


def command(shell: Literal["bash", "zsh", "fish"], /, *, common: Common = Common()) -> None:
    """Print the script by which a shell completes commands and flags.

    Commands whose packages are not installed have no flags in it.

    Parameters
    ----------
    shell
        The shell: append the script to ~/.bashrc, or write it where zsh or fish look for completions.
    """
    script = make_app([name for name in COMMANDS if _is_usable(name)]).generate_completion(shell=shell)
    if common.json or common.quiet:
        common.result({"shell": shell, "script": script})
    else:
        print(script)


def _is_usable(name: str) -> bool:
    try:
        import_module(place_of(name).partition(":")[0])
    except ImportError:
        return False
    return True
