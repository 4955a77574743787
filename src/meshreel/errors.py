"""Errors that meshreel raises on purpose. Messages say what is wrong, the value, and what to do."""

import re


class MeshreelError(Exception):
    """Base of all errors raised on purpose; the message is one line, fit for a terminal."""


class InputError(MeshreelError):
    """A mesh, a sequence or an option from outside cannot be used; the message names file, frame, value and remedy."""


class FormatError(MeshreelError):
    """Bytes from outside are not a valid .reel stream, or have a version that this reader does not know."""


class NoReferenceError(MeshreelError):
    """No reference surface can be made from these frames; the encoder then codes them one by one."""


def without_secret(url: str) -> str:
    """Return a URL without its query and its user, which may be keys, for messages and pages."""
    place, *query = url.split("?", 1)
    place = re.sub(r"^([\w+.-]+://)[^/@]*@", r"\1", place)
    return f"{place}?..." if query else place
