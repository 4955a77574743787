"""`meshreel info`: the contents of a .reel file and the bytes that each takes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from rich.table import Table

from ..coding.group import payload_bytes_by_purpose
from ..container.reader import Chunk, ReelReader
from ..container.sources import FileSource
from ..errors import FormatError
from ..format.layout import ChunkKind, Form
from .console import Common

COMPANION_NAMES = {
    ChunkKind.COLORS: "vertex colors",
    ChunkKind.ATLAS: "atlas",
    ChunkKind.PICTURES: "pictures",
    ChunkKind.COMPATIBLE: "pictures in H.264",
    ChunkKind.SPLATS: "splats",
}


def command(file: Path, /, *, common: Common = Common()) -> None:
    """Show the rate by content, the tracks over time, the groups and their forms, and what the encoder recorded.

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
    """Return the text with control characters escaped: a file from an untrusted source must not steer the terminal."""
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in text)


def describe_file(file: Path) -> dict[str, Any]:
    """Return everything that `info` shows, ready for JSON. A damaged chunk has an error; the others are read.

    Sizes and rates are those of the whole file, even if its end is missing. Ranges of frames are [first, last].
    """
    with FileSource(file) as source:
        try:
            reader = ReelReader(source)
        except FormatError as error:
            raise FormatError(f"{file}: {error}") from error
        there = source.size
        groups = [_describe_group(reader, chunk, there) for chunk in reader.groups]
        shown = reader.static_ranges(range(reader.frame_count))
        static = [chunk for chunk in reader.chunks if chunk.kind == ChunkKind.STATIC]
        states = [_describe_state(reader, chunk, there, shown.get(chunk.number, [])) for chunk in static]
    tracks = [_describe_track(reader, number, groups) for number in range(len(reader.tracks))]
    several = len(tracks) > 1
    of_tracks = [_renamed(track, several) for track in tracks]
    sizes = _sum([{"header and index": reader.head_size}, *(state["bytes_by_content"] for state in states), *of_tracks])
    return {
        "frames": reader.frame_count,
        "frame_rate": reader.frame_rate,
        "bytes": reader.size,
        "bytes_missing": reader.size - there,
        "mbps": megabits(reader.size, reader),
        "bytes_by_content": sizes,
        "mbps_by_content": {name: megabits(size, reader) for name, size in sizes.items()},
        "tracks": tracks,
        "background": states,
        "groups": groups,
        "metadata": reader.metadata,
    }


def megabits(size: int, reader: ReelReader) -> float:
    """Return the rate of `size` bytes spread over all frames, Mbit/s."""
    return size * 8 * reader.frame_rate / reader.frame_count / 1e6


def _describe_group(reader: ReelReader, chunk: Chunk, there: int) -> dict[str, Any]:
    """Describe a group of a file of which the first `there` bytes exist."""
    row: dict[str, Any] = {"chunk": chunk.number, "track": chunk.track}
    row |= {"first_frame": chunk.first_frame, "frames": chunk.frame_count}
    row |= {"form": chunk.form_name, "bytes": _size_of(reader, chunk), "layers": len(chunk.layers) - 1}
    row["predicted"] = reader.group_before(chunk) is not None
    return row | _contents(reader, chunk, there, payload_bytes_by_purpose)


def _size_of(reader: ReelReader, chunk: Chunk) -> int:
    """Return the bytes of a chunk and of all that belongs to it."""
    return chunk.size + sum(other.size for _, other in _companions(reader, chunk))


def _companions(reader: ReelReader, chunk: Chunk) -> Iterator[tuple[str, Chunk]]:
    """Yield the chunks that belong to a chunk, with the names of what they have."""
    for kind, name in COMPANION_NAMES.items():
        if (other := reader.companion_of(chunk, kind)) is not None:
            yield name if chunk.frame_count else f"background's {name}", other


def _describe_state(reader: ReelReader, chunk: Chunk, there: int, shown: Iterable[tuple[int, int]]) -> dict[str, Any]:
    """Describe a state of the background: the state that it changes, if any, and the frames that show it."""
    row: dict[str, Any] = {"chunk": chunk.number, "form": chunk.form_name, "bytes": _size_of(reader, chunk)}
    row["changes"] = chunk.depends_on[0] if chunk.depends_on else None
    row["ranges"] = _merged(shown)
    return row | _contents(reader, chunk, there, lambda payload: {"background": len(payload)})


def _describe_track(reader: ReelReader, number: int, groups: list[dict[str, Any]]) -> dict[str, Any]:
    """Describe a track: the frames in which its body appears, and the bytes of its contents."""
    own = [group for group in groups if group["track"] == number]
    there = [(g.first_frame, g.first_frame + g.frame_count) for g in reader.tracks[number] if g.form != Form.EMPTY]
    size = sum(group["bytes"] for group in own)
    row: dict[str, Any] = {"track": number, "ranges": _merged(there), "groups": len(own), "bytes": size}
    return row | {
        "mbps": megabits(size, reader),
        "bytes_by_content": _sum([group["bytes_by_content"] for group in own]),
    }


def _contents(
    reader: ReelReader, chunk: Chunk, there: int, sizes_of: Callable[[bytes], dict[str, int]]
) -> dict[str, Any]:
    """Return the bytes of a chunk by content; for a damaged chunk its error, and which of its bytes are missing."""
    sizes, errors = dict[str, int](), list[str]()
    for name, one in [("", chunk), *_companions(reader, chunk)]:
        try:
            payload = reader.read_chunk(one.number)
            found = {name: len(payload)} if name else sizes_of(payload)
        except FormatError as error:
            missing = min(max(one.end - there, 0), one.size)
            found = {"damaged": one.size - missing, "missing": missing}
            errors.append(str(error))
        sizes = _sum([sizes, {what: size for what, size in found.items() if size}])
    return {"bytes_by_content": sizes} | ({"error": errors[0]} if errors else {})


def _sum(rows: Iterable[dict[str, int]]) -> dict[str, int]:
    total = Counter[str]()
    for row in rows:
        total.update(row)
    return dict(total)


def _renamed(track: dict[str, Any], several: bool) -> dict[str, int]:
    """Return the bytes of a track by content; names include the track if there are several, save for lost bytes."""
    whole = ("damaged", "missing")
    prefix = f"track {track['track']}: " if several else ""
    return {name if name in whole else prefix + name: size for name, size in track["bytes_by_content"].items()}


def _merged(ranges: Iterable[tuple[int, int]]) -> list[list[int]]:
    """Return first and last frames of ranges (end excluded, in order), adjacent ones merged."""
    merged: list[list[int]] = []
    for start, end in ranges:
        if merged and merged[-1][1] == start - 1:
            merged[-1][1] = end - 1
        else:
            merged.append([start, end - 1])
    return merged


def rate_table(row: dict[str, Any]) -> Table:
    """Return a table of bytes and rate by content."""
    table = Table("content", "bytes", "Mbps", "share")
    for name, size in ((name, size) for name, size in row["bytes_by_content"].items() if size):
        table.add_row(name, str(size), f"{row['mbps_by_content'][name]:.4f}", f"{100 * size / row['bytes']:.1f} %")
    return table


def _tracks(row: dict[str, Any]) -> Table:
    table = Table("track", "appears in frames", "groups", "bytes", "Mbps")
    for track in row["tracks"]:
        size = (str(track["groups"]), str(track["bytes"]), f"{track['mbps']:.4f}")
        table.add_row(str(track["track"]), _listed(track["ranges"]), *size)
    return table


def _states(row: dict[str, Any]) -> Table:
    table = Table("background", "form", "changes", "shown in frames", "bytes")
    for state in row["background"]:
        changes = "" if state["changes"] is None else f"chunk {state['changes']}"
        table.add_row(f"chunk {state['chunk']}", state["form"], changes, _listed(state["ranges"]), str(state["bytes"]))
    return table


def _groups(row: dict[str, Any]) -> Table:
    several = len(row["tracks"]) > 1
    table = Table("group", *(["track"] if several else []), "frames", "form", "layers", "bytes", "by content")
    for number, group in enumerate(row["groups"]):
        sizes = ", ".join(f"{name} {size}" for name, size in group["bytes_by_content"].items())
        frames = _listed([[group["first_frame"], group["first_frame"] + group["frames"] - 1]])
        form = group["form"] + (", predicted" if group["predicted"] else "")
        cells = [str(number), *([str(group["track"])] if several else []), frames, form]
        table.add_row(*cells, str(group["layers"]), str(group["bytes"]), sizes)
    return table


def _listed(ranges: list[list[int]]) -> str:
    return ", ".join(f"{first}-{last}" for first, last in ranges) or "none"
