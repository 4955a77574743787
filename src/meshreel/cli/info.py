"""`meshreel info`: what is in a .reel file, and where its bytes go."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

from rich.table import Table

from ..coding.group import payload_parts
from ..container.reader import Chunk, ReelReader
from ..container.sources import FileSource
from ..errors import FormatError
from ..format.layout import ChunkKind, Form
from .console import Common


def command(file: Path, /, *, common: Common = Common()) -> None:
    """Show rate by part, objects over time, groups, forms and the quality recorded when the file was encoded.

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
    recorded = _printable(", ".join(f"{name} {value}" for name, value in row["metadata"].items()))
    tables = [rate_table(row), *([_tracks(row), _states(row)] if row["background"] or len(row["tracks"]) > 1 else [])]
    common.result(row, head, f"recorded at encode: {recorded or 'nothing'}", *tables, _groups(row))
    common.warn(f"background: {state['error']}" for state in row["background"] if "error" in state)
    common.warn(f"group {i}: {group['error']}" for i, group in enumerate(row["groups"]) if "error" in group)


def _printable(text: str) -> str:
    """The text with what would steer a terminal as its code: a file may come from anyone."""
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in text)


def describe_file(file: Path) -> dict[str, Any]:
    """Everything `info` shows, ready for JSON. A damaged chunk is reported with its error; the others are read.

    Sizes and rates are those of the whole file, also where its end is missing. Spans of frames are [first, last].
    """
    with FileSource(file) as source:
        try:
            reader = ReelReader(source)
        except FormatError as error:
            raise FormatError(f"{file}: {error}") from error
        there = source.size
        groups = [_describe_group(reader, chunk, there) for chunk in reader.groups]
        shown = _shown(reader)
        static = [chunk for chunk in reader.chunks if chunk.kind == ChunkKind.STATIC]
        states = [_describe_state(reader, chunk, there, shown.get(chunk.number, [])) for chunk in static]
    tracks = [_describe_track(reader, number, groups) for number in range(len(reader.tracks))]
    parts = _sum([{"header and index": reader.head_size}, *(state["parts"] for state in states)])
    several = len(tracks) > 1
    for track in tracks:
        parts = _sum([parts, {_named(name, track, several): size for name, size in track["parts"].items()}])
    return {
        "frames": reader.frame_count,
        "frame_rate": reader.frame_rate,
        "bytes": reader.size,
        "bytes_missing": reader.size - there,
        "mbps": megabits(reader.size, reader),
        "parts": parts,
        "parts_mbps": {name: megabits(count, reader) for name, count in parts.items()},
        "tracks": tracks,
        "background": states,
        "groups": groups,
        "metadata": reader.metadata,
    }


def megabits(size: int, reader: ReelReader) -> float:
    """The rate of so many bytes spread over all frames, Mbit/s."""
    return size * 8 * reader.frame_rate / reader.frame_count / 1e6


def _describe_group(reader: ReelReader, chunk: Chunk, there: int) -> dict[str, Any]:
    """A group of a file of which so many bytes are there."""
    row: dict[str, Any] = {"chunk": chunk.number, "track": chunk.track}
    row |= {"first_frame": chunk.first_frame, "frames": chunk.frame_count}
    row |= {"form": chunk.form.name.lower(), "bytes": chunk.size, "layers": len(chunk.layers) - 1}
    row["predicted"] = reader.group_before(chunk) is not None
    return row | _parts(reader, chunk, there, payload_parts)


def _shown(reader: ReelReader) -> dict[int, list[tuple[int, int]]]:
    """The ranges of frames that each state of the background is shown in, by its chunk; it changes where groups do."""
    ranges: dict[int, list[tuple[int, int]]] = {}
    starts = sorted({group.first_frame for group in reader.groups})
    for start, end in pairwise([*starts, reader.frame_count]):
        if (chunk := reader.static_of_frame(start)) is not None:
            ranges.setdefault(chunk.number, []).append((start, end))
    return ranges


def _describe_state(reader: ReelReader, chunk: Chunk, there: int, shown: Iterable[tuple[int, int]]) -> dict[str, Any]:
    """A state of the background: the one it changes, if any, and the frames that are shown with it."""
    row: dict[str, Any] = {"chunk": chunk.number, "form": chunk.form.name.lower(), "bytes": chunk.size}
    row["changes"] = chunk.depends_on[0] if chunk.depends_on else None
    row["spans"] = _spans(shown)
    return row | _parts(reader, chunk, there, lambda payload: {"background": len(payload)})


def _describe_track(reader: ReelReader, number: int, groups: list[dict[str, Any]]) -> dict[str, Any]:
    """When a moving body is there, and what it is made of."""
    own = [group for group in groups if group["track"] == number]
    there = [(g.first_frame, g.first_frame + g.frame_count) for g in reader.tracks[number] if g.form != Form.EMPTY]
    size = sum(group["bytes"] for group in own)
    row: dict[str, Any] = {"track": number, "spans": _spans(there), "groups": len(own), "bytes": size}
    return row | {"mbps": megabits(size, reader), "parts": _sum([group["parts"] for group in own])}


def _parts(reader: ReelReader, chunk: Chunk, there: int, parts_of: Callable[[bytes], dict[str, int]]) -> dict[str, Any]:
    """The bytes of a chunk by what they are for, or its error, and how many of its bytes are there."""
    try:
        return {"parts": parts_of(reader.read_chunk(chunk.number))}
    except FormatError as error:
        missing = min(max(chunk.end - there, 0), chunk.size)
        parts = {"damaged": chunk.size - missing, "missing": missing}
        return {"parts": {name: size for name, size in parts.items() if size}, "error": str(error)}


def _sum(parts: Iterable[dict[str, int]]) -> dict[str, int]:
    total: dict[str, int] = {}
    for row in parts:
        for name, size in row.items():
            total[name] = total.get(name, 0) + size
    return total


def _named(name: str, track: dict[str, Any], several: bool) -> str:
    """What a part of a track is called among those of a file; what is lost is lost in all alike."""
    return f"track {track['track']}: {name}" if several and name not in ("damaged", "missing") else name


def _spans(ranges: Iterable[tuple[int, int]]) -> list[list[int]]:
    """First and last frame of what ranges (end excluded) that are in order cover without a gap."""
    spans: list[list[int]] = []
    for start, end in ranges:
        if spans and spans[-1][1] == start - 1:
            spans[-1][1] = end - 1
        else:
            spans.append([start, end - 1])
    return spans


def rate_table(row: dict[str, Any]) -> Table:
    table = Table("part", "bytes", "Mbps", "share")
    for name, size in ((name, size) for name, size in row["parts"].items() if size):
        table.add_row(name, str(size), f"{row['parts_mbps'][name]:.4f}", f"{100 * size / row['bytes']:.1f} %")
    return table


def _tracks(row: dict[str, Any]) -> Table:
    table = Table("track", "is there in frames", "groups", "bytes", "Mbps")
    for track in row["tracks"]:
        size = (str(track["groups"]), str(track["bytes"]), f"{track['mbps']:.4f}")
        table.add_row(str(track["track"]), _told(track["spans"]), *size)
    return table


def _states(row: dict[str, Any]) -> Table:
    table = Table("background", "form", "changes", "is shown in frames", "bytes")
    for state in row["background"]:
        changes = "" if state["changes"] is None else f"chunk {state['changes']}"
        table.add_row(f"chunk {state['chunk']}", state["form"], changes, _told(state["spans"]), str(state["bytes"]))
    return table


def _groups(row: dict[str, Any]) -> Table:
    several = len(row["tracks"]) > 1
    table = Table("group", *(["track"] if several else []), "frames", "form", "layers", "bytes", "parts")
    for number, group in enumerate(row["groups"]):
        parts = ", ".join(f"{name} {size}" for name, size in group["parts"].items())
        frames = _told([[group["first_frame"], group["first_frame"] + group["frames"] - 1]])
        form = group["form"] + (", predicted" if group["predicted"] else "")
        cells = [str(number), *([str(group["track"])] if several else []), frames, form]
        table.add_row(*cells, str(group["layers"]), str(group["bytes"]), parts)
    return table


def _told(spans: list[list[int]]) -> str:
    return ", ".join(f"{first}-{last}" for first, last in spans) or "none"
