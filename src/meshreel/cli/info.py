"""`meshreel info`: what is in a .reel file, and where its bytes go."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rich.table import Table

from ..coding.group import payload_parts
from ..container.reader import Chunk, ReelReader
from ..container.sources import FileSource
from ..errors import FormatError
from .console import Common


def command(file: Path, *, common: Common = Common()) -> None:
    """Show rate by part, groups, forms and the quality recorded when the file was encoded.

    Parameters
    ----------
    file
        The .reel file.
    """
    row = describe_file(file)
    table = Table("group", "frames", "form", "bytes", "parts")
    for number, group in enumerate(row["groups"]):
        parts = ", ".join(f"{name} {size}" for name, size in group["parts"].items())
        last = group["first_frame"] + group["frames"] - 1
        table.add_row(str(number), f"{group['first_frame']}-{last}", group["form"], str(group["bytes"]), parts)
    rates = Table("part", "bytes", "Mbps")
    for name, size in row["parts"].items():
        rates.add_row(name, str(size), f"{size * row['mbps'] / max(row['bytes'], 1):.4f}")
    head = f"{file}: {row['frames']} frames at {row['frame_rate']:g}/s, {row['bytes']} bytes, {row['mbps']:.3f} Mbps"
    common.result(row, head, rates, table, f"recorded at encode: {json.dumps(row['metadata'])}")


def describe_file(file: Path) -> dict[str, Any]:
    """Everything `info` shows, ready for JSON. A damaged group is reported with its error; the others are read."""
    with FileSource(file) as source:
        reader = ReelReader(source)
        groups = [_describe_group(reader, chunk) for chunk in reader.groups]
    parts = {"header and index": reader.head_size}
    for group in groups:
        for name, count in group["parts"].items():
            parts[name] = parts.get(name, 0) + count
    return {
        "frames": reader.frame_count,
        "frame_rate": reader.frame_rate,
        "bytes": reader.size,
        "mbps": reader.size * 8 * reader.frame_rate / reader.frame_count / 1e6,
        "parts": parts,
        "groups": groups,
        "metadata": reader.metadata,
    }


def _describe_group(reader: ReelReader, chunk: Chunk) -> dict[str, Any]:
    row = {"first_frame": chunk.first_frame, "frames": chunk.frame_count, "form": chunk.form.name.lower()}
    row |= {"bytes": chunk.size, "components": len(chunk.layers) - 1}
    try:
        return row | {"parts": payload_parts(reader.read_chunk(chunk.number))}
    except FormatError as error:
        return row | {"parts": {"damaged": chunk.size}, "error": str(error)}
