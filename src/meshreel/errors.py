"""Everything meshreel raises on purpose: what is wrong, the value, and what to do."""


class MeshreelError(Exception):
    """Base of all errors raised on purpose; its text is one line fit for a terminal."""


class InputError(MeshreelError):
    """A mesh, a sequence or an option from outside cannot be used; names file, frame, value and remedy."""


class FormatError(MeshreelError):
    """Bytes from outside are not a valid .reel stream, or are of a version this reader does not know."""


class NoReferenceError(MeshreelError):
    """No reference surface can be made of these frames; the encoder codes them one by one instead."""
