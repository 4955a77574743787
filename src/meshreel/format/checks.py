"""What the records of a head must satisfy beyond their bytes; FormatError where they do not."""

from __future__ import annotations

import json
from typing import Any, NoReturn

from ..errors import FormatError
from .layout import ChunkKind, Header, Index

LARGEST = 1e15  # of every number in a header: keeps all that is computed from them finite
SMALLEST = 1e-15


def check_header(header: Header, frame_count: int) -> None:
    """Positive rate and scale, corners in order, an interval of time between each two frames or none."""
    for name in ("frame_rate", "scale"):
        value = getattr(header, name)
        if not SMALLEST <= value <= LARGEST:
            raise FormatError(f"Header.{name}: {value} is not within {SMALLEST} .. {LARGEST}")
    for name in ("origin", "minimum", "maximum"):
        value = getattr(header, name)
        if any(abs(number) > LARGEST for number in value):
            raise FormatError(f"Header.{name}: {value} is beyond {LARGEST}")
    if any(low > high for low, high in zip(header.minimum, header.maximum, strict=True)):
        raise FormatError(f"Header.minimum: {header.minimum} is above maximum {header.maximum}")
    if header.intervals and len(header.intervals) != frame_count - 1:
        raise FormatError(f"Header.intervals: {len(header.intervals)} for {frame_count} frames")
    if 0 in header.intervals:
        raise FormatError("Header.intervals: one is 0, two frames at the same time")


def check_index(index: Index) -> None:
    """At least one frame, bytes in every layer, references only to earlier STATIC chunks and the last GROUP."""
    last_group = -1
    for number, entry in enumerate(index.chunks):
        if (entry.kind == ChunkKind.STATIC) != (entry.frames == 0):
            raise FormatError(f"chunk {number}: {entry.kind.name} of {entry.frames} frames")
        if not entry.layers or any(layer.size == 0 for layer in entry.layers):
            raise FormatError(f"chunk {number}: a chunk or a layer without bytes")
        for other in entry.depends_on:
            if other >= number or (index.chunks[other].kind != ChunkKind.STATIC and other != last_group):
                raise FormatError(
                    f"chunk {number}: depends on {other}, which is neither a static chunk before it nor the last group"
                )
        if entry.kind == ChunkKind.GROUP:
            last_group = number
        elif last_group in entry.depends_on:
            raise FormatError(f"chunk {number}: a static chunk that depends on group {last_group}")
    if sum(entry.frames for entry in index.chunks) == 0:
        raise FormatError("no frames: the index names no group")


def parse_metadata(text: str) -> dict[str, Any]:
    """The JSON object of Header.metadata."""
    try:
        metadata = json.loads(text, parse_constant=_refuse)
        json.dumps(
            metadata, allow_nan=False, ensure_ascii=False
        ).encode()  # 1e999 and half a surrogate can be read only
    except (ValueError, RecursionError) as error:
        raise FormatError(f"Header.metadata: not JSON: {text!r:.40}") from error
    if not isinstance(metadata, dict):
        raise FormatError(f"Header.metadata: not a JSON object: {text!r:.40}")
    return metadata


def _refuse(constant: str) -> NoReturn:
    raise ValueError(constant)  # NaN and Infinity, which are not JSON
