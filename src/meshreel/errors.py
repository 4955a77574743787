"""Errors that meshreel raises on purpose. Messages say what is wrong, the value, and what to do."""

import re


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


_URL = r"(?<![\w+.-])([\w+.-]{2,}:)(//?)"  # as a Path, with one slash
_USER = re.compile(rf"{_URL}(?:[^\s/?#]*|[^\s/?#:]+:(?!\d+/)\S*)@")  # keys of stores may have slashes
_END = r"(?=[:;,.)\]'\"]*(?:\s|$))"
_FURTHER = re.compile(rf"{_URL}([^\s?#]*|[^?#\n]*(?=[?#][\w.%-]+=))[?#](?:\.\.\.{_END}|\S*?{_END})")


def without_secret(text: str) -> str:
    """Return a text whose URLs lack users, queries and fragments, which may be keys: for messages and pages."""
    return _FURTHER.sub(r"\1\2\3?...", _USER.sub(r"\1\2", text)) if ":/" in text else text
