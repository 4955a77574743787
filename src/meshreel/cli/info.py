"""`meshreel info`: what is in a .reel file, and where its bytes go."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.table import Table

from ..coding.group import payload_parts
from ..container.reader import Chunk, ReelReader
from ..container.sources import FileSource
from ..errors import FormatError
from ..format.layout import ChunkKind
from .console import Common


def command(file: Path, /, *, common: Common = Common()) -> None:
    """Show rate by part, groups, forms and the quality recorded when the file was encoded.

    Parameters
    ----------
    file
        The .reel file.
    """
    row = describe_file(file)
    size = f"{row['bytes']} bytes"
    if missing := row["bytes_missing"]:
        size = f"{row['bytes'] - missing} of {size} ({missing} are missing: the file is truncated)"
    head = f"{file}: {row['frames']} frames at {row['frame_rate']:g}/s, {size}, {row['mbps']:.4g} Mbps"
    recorded = ", ".join(f"{name} {value}" for name, value in row["metadata"].items())
    common.result(row, head, f"recorded at encode: {recorded or 'nothing'}", _rates(row), _groups(row))
    common.warn(f"group {i}: {group['error']}" for i, group in enumerate(row["groups"]) if "error" in group)


def describe_file(file: Path) -> dict[str, Any]:
    """Everything `info` shows, ready for JSON. A damaged group is reported with its error; the others are read.

    Sizes and rates are those of the whole file, also where its end is missing.
    """
    with FileSource(file) as source:
        try:
            reader = ReelReader(source)
        except FormatError as error:
            raise FormatError(f"{file}: {error}") from error
        there = source.size
        groups = [_describe_group(reader, chunk, there) for chunk in reader.groups]
        static = sum(chunk.size for chunk in reader.chunks) - sum(chunk.size for chunk in reader.groups)
    parts = {"header and index": reader.head_size} | ({"static": static} if static else {})
    for group in groups:
        for name, count in group["parts"].items():
            parts[name] = parts.get(name, 0) + count
    return {
        "frames": reader.frame_count,
        "frame_rate": reader.frame_rate,
        "bytes": reader.size,
        "bytes_missing": reader.size - there,
        "mbps": megabits(reader.size, reader),
        "parts": parts,
        "parts_mbps": {name: megabits(count, reader) for name, count in parts.items()},
        "groups": groups,
        "metadata": reader.metadata,
    }


def megabits(size: int, reader: ReelReader) -> float:
    """The rate of so many bytes spread over all frames, Mbit/s."""
    return size * 8 * reader.frame_rate / reader.frame_count / 1e6


def _describe_group(reader: ReelReader, chunk: Chunk, there: int) -> dict[str, Any]:
    """A group of a file of which so many bytes are there."""
    row: dict[str, Any] = {"first_frame": chunk.first_frame, "frames": chunk.frame_count}
    row |= {"form": chunk.form.name.lower(), "bytes": chunk.size, "layers": len(chunk.layers) - 1}
    row["predicted"] = any(reader.chunks[n].kind == ChunkKind.GROUP for n in chunk.depends_on)
    try:
        return row | {"parts": payload_parts(reader.read_chunk(chunk.number))}
    except FormatError as error:
        missing = min(max(chunk.end - there, 0), chunk.size)
        parts = {"damaged": chunk.size - missing, "missing": missing}
        return row | {"parts": {name: size for name, size in parts.items() if size}, "error": str(error)}


def _rates(row: dict[str, Any]) -> Table:
    table = Table("part", "bytes", "Mbps", "share")
    for name, size in ((name, size) for name, size in row["parts"].items() if size):
        table.add_row(name, str(size), f"{row['parts_mbps'][name]:.4f}", f"{100 * size / row['bytes']:.1f} %")
    return table


def _groups(row: dict[str, Any]) -> Table:
    table = Table("group", "frames", "form", "layers", "bytes", "parts")
    for number, group in enumerate(row["groups"]):
        parts = ", ".join(f"{name} {size}" for name, size in group["parts"].items())
        first, last = group["first_frame"], group["first_frame"] + group["frames"] - 1
        form = group["form"] + (", predicted" if group["predicted"] else "")
        table.add_row(str(number), f"{first}-{last}", form, str(group["layers"]), str(group["bytes"]), parts)
    return table
