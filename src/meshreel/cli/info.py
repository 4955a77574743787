"""`meshreel info`: what is in a .reel file, and where its bytes go."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rich.table import Table

from ..coding.group import payload_parts
from ..container.reader import ReelReader
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
    reader = ReelReader(FileSource(file))
    size = file.stat().st_size
    groups = [_describe_group(reader, number) for number in range(len(reader.index))]
    parts: dict[str, int] = {"header and index": size - sum(group["bytes"] for group in groups)}
    for group in groups:
        for name, count in group["parts"].items():
            parts[name] = parts.get(name, 0) + count
    frames = reader.frame_count
    return {
        "frames": frames,
        "frame_rate": reader.header.frame_rate,
        "bytes": size,
        "mbps": size * 8 * reader.header.frame_rate / max(frames, 1) / 1e6,
        "parts": parts,
        "groups": groups,
        "metadata": reader.metadata,
    }


def _describe_group(reader: ReelReader, number: int) -> dict[str, Any]:
    entry = reader.index[number]
    row = {"first_frame": entry.first_frame, "frames": entry.frame_count, "form": entry.form.name.lower()}
    row |= {"bytes": entry.size, "components": max(len(entry.layers) - 1, 0)}
    try:
        return row | {"parts": payload_parts(reader.read_chunk(number))}
    except FormatError as error:
        return row | {"parts": {"damaged": entry.size}, "error": str(error)}
