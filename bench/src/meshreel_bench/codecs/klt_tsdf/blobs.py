"""Blobs one after the other, each behind its length, a varint. In -> out: byte strings <-> one byte string."""

from __future__ import annotations

from collections.abc import Iterable

from meshreel.errors import FormatError
from meshreel.format.kinds import Blob, Varint

_BLOB = Blob(Varint())


def join(blobs: Iterable[bytes]) -> bytes:
    """Return all blobs behind their lengths."""
    return b"".join(map(_BLOB.pack, blobs))


def split(data: bytes, count: int) -> list[bytes]:
    """Return the `count` blobs of `data`. Raises FormatError where it holds fewer, or more."""
    blobs, offset = list[bytes](), 0
    for _ in range(count):
        blob, offset = _BLOB.unpack(data, offset)
        blobs.append(blob)
    if offset != len(data):
        raise FormatError(f"{len(data) - offset} bytes too many; the stream is damaged")
    return blobs
