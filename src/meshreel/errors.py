"""Errors that meshreel raises on purpose. Messages say what is wrong, the value, and what to do."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class MeshreelError(Exception):
    """Base of all errors raised on purpose; the message is one line, fit for a terminal, without keys of URLs."""

    def __init__(self, *texts: object) -> None:
        super().__init__(*(without_secret(text) if isinstance(text, str) else text for text in texts))


class InputError(MeshreelError):
    """A mesh, a sequence or an option from outside cannot be used; the message names file, frame, value and remedy."""


class FormatError(MeshreelError):
    """Bytes from outside are not a valid .reel stream, or have a version that this reader does not know."""


class NoReferenceError(MeshreelError):
    """No reference surface can be made from these frames; the encoder then codes them one by one."""


SCHEME = re.compile(r"(?<![\w+.-])[\w+.-]{2,}://?")  # as a Path, with one slash
_USER = re.compile(r"(?:[^\s/?#]*|[^\s/?#:]+:(?!\d+/)\S*)@")  # keys of stores may have slashes
_FURTHER = re.compile(r"([^\s?#]*|[^?#\n]*(?=[?#][\w.%-]+=))[?#](?:\.\.\.(?=\W|$))?(\S*)")
_MOST = 4096  # characters of a message: more is no line for a terminal (guess)


def without_secret(text: str) -> str:
    """Return a text whose URLs lack users, queries and fragments, which may be keys: for messages and pages."""
    if ":/" not in text:
        return text
    text, found, at = text if len(text) <= _MOST else f"{text[:_MOST]} ...", "", 0
    for scheme in SCHEME.finditer(text):
        if scheme.start() >= at:
            found, at = found + text[at : scheme.end()], scheme.end()
            if user := _USER.match(text, at):
                at = user.end()
            if further := _FURTHER.match(text, at):
                found, at = f"{found}{further[1]}?...", further.start(2) + len(further[2].rstrip(":;,.)]'\""))
    return found + text[at:]


@contextmanager
def needed(text: str) -> Iterator[None]:
    """Raise InputError with a text, which tells what to install, where an import in the block fails."""
    try:
        yield
    except ImportError as error:
        raise InputError(text) from error


def path_of(name: object) -> str | Path:
    """Return a path or a URL that an object names. Raises InputError for anything else."""
    path = Path(name) if isinstance(name, os.PathLike) and isinstance(os.fspath(name), str) else name
    if not isinstance(path, str | Path):
        raise InputError(f"{type(name).__name__} {name!r:.60}: is no path; give a str, a pathlib.Path or a URL")
    if "\0" in str(path):
        raise InputError(f"{name!r}: no path has a null character; mend it")
    return path
