"""`meshreel info`: the contents of a .reel file and the bytes that each takes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.table import Table

from ..coding.group import payload_bytes_by_purpose
from ..container.reader import Chunk, ReelReader
from ..container.sources import FileSource
from ..decoder.video import Video
from ..decoder.video import open as open_video
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


MOST = 8  # rows of a table without --groups: all of them fit on a screen (guess)
MOST_CONTENTS = 24  # rows of contents; where there are more, tracks are added up
_LONGEST = 80  # characters of a value that the encoder recorded


def command(
    file: Path, /, *, groups: Annotated[bool, Parameter(negative="")] = False, common: Common = Common()
) -> None:
    """Show what is in a file: duration, box, vertices, rate by content, tracks, and what the encoder recorded.

    Parameters
    ----------
    file
        The .reel file.
    groups
        Show all groups, tracks and states of the background, however long the file is, and decode them: those that do
        not decode are warned of, even if their checksums are right.
    """
    row = describe_file(file)
    if groups:
        _decode_all(file, row)
    size = f"{row['bytes']} bytes"
    if missing := row["bytes_missing"]:
        size = f"{row['bytes'] - missing} of {size} ({missing} are missing: the file is truncated)"
    length = f"{row['frames']} frames at {row['frame_rate']:g}/s, {row['duration_s']:.4g} s"
    head = f"{file}: {length}, {size}, {row['mbps']:.4g} Mbps"
    metadata = {name: str(value) for name, value in row["metadata"].items()}
    short = {name: text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ..." for name, text in metadata.items()}
    recorded = _printable(", ".join(f"{name} {text}" for name, text in (metadata if groups else short).items()))
    is_long, more = len(row["bytes_by_content"]) > MOST_CONTENTS and not groups, None if groups else MOST
    tables = [rate_table(row | _added_up(row) if is_long else row)]
    if row["background"] or len(row["tracks"]) > 1:
        tables += [_tracks(row, more), _states(row, more)]
    told = f"recorded at encode: {recorded or 'nothing'}"
    common.result(row, head, _looks(row), told, *tables, _groups(row, more))
    common.warn(f"background: {state['error']}" for state in row["background"] if "error" in state)
    common.warn([f"audio: {row['audio']['error']}"] if "error" in (row["audio"] or {}) else [])
    common.warn(f"group {i}: {group['error']}" for i, group in enumerate(row["groups"]) if "error" in group)


def _decode_all(file: Path, row: dict[str, Any]) -> None:
    """Decode each group and state of the background that is shown; one that does not decode gets an error."""
    with open_video(file) as video:
        shown = [(state, state["ranges"][0][0], video.background) for state in row["background"] if state["ranges"]]
        for group in row["groups"]:
            if group["frames"]:
                shown.append((group, group["first_frame"], video.tracks[group["track"]].__getitem__))
        for described, frame, decode in shown:
            try:
                decode(frame)
            except FormatError as error:
                described.setdefault("error", str(error))


def _looks(row: dict[str, Any]) -> str:
    """Describe what is seen in a line: box, mesh, layers, colour."""
    low, high = row["box_m"]
    box = " x ".join(f"{end - begin:.3g}" for begin, end in zip(low, high, strict=True))
    mesh, hidden = row["first_surface"], row["frames_hidden"]
    what = f"frame {mesh['frame']}: {mesh['vertices']} vertices, {mesh['faces']} faces" if mesh else "no surface found"
    parts = [f"box {box} m, {row['up']} is up", what, f"{row['layers']} layers", f"colour: {row['color']}"]
    if (heard := row["audio"]) is not None:
        begin = f", from {heard['start_s']:g} s" if "start_s" in heard else ""
        parts.append(f"audio: {heard.get('type', 'damaged')}, {heard['bytes']} bytes{begin}")
    return "; ".join([*parts, *([f"{hidden} frames more are hidden"] if hidden else [])])


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
        surface = _first_surface(reader)
        audio = _describe_audio(reader, there)
        states = [_describe_state(reader, chunk, there, shown.get(chunk.number, [])) for chunk in static]
    tracks = [_describe_track(reader, number, groups) for number in range(len(reader.tracks))]
    several = len(tracks) > 1
    of_tracks = [_renamed(track, several) for track in tracks]
    heard = [] if audio is None else [audio["bytes_by_content"]]
    whole = {"header and index": reader.head_size}
    sizes = _sum([whole, *(state["bytes_by_content"] for state in states), *of_tracks, *heard])
    return {
        "frames": reader.frame_count,
        "frame_rate": reader.frame_rate,
        "duration_s": reader.duration,
        "box_m": [corner.tolist() for corner in reader.box],
        "up": reader.up,
        "first_surface": surface,
        "layers": max(group["layers"] for group in groups),
        "color": _color(reader),
        "audio": audio,
        "frames_hidden": reader.coded_count - reader.frame_count,
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


def _first_surface(reader: ReelReader) -> dict[str, int] | None:
    """Return number, vertices and faces of the first frame with a surface that is whole, among the first few."""
    video = Video(reader).at(colors=False)
    for frame in range(min(reader.frame_count, MOST)):
        with suppress(FormatError):
            if not (mesh := video[frame]).is_empty:
                return {"frame": frame, "vertices": len(mesh.vertices), "faces": len(mesh.faces)}
    return None


def _color(reader: ReelReader) -> str:
    kinds = {
        ChunkKind.COLORS: "vertices",
        ChunkKind.PICTURES: "textures (AV1)",
        ChunkKind.COMPATIBLE: "textures (H.264)",
        ChunkKind.SPLATS: "splats",
    }
    return ", ".join(name for kind, name in kinds.items() if any(c.kind == kind for c in reader.chunks)) or "none"


def _describe_audio(reader: ReelReader, there: int) -> dict[str, Any] | None:
    """Describe what is heard, and when it begins after the first frame; None where there is nothing."""
    if reader.audio is None:
        return None
    row = {"bytes": reader.audio.size} | _contents(reader, reader.audio, there, lambda payload: {"audio": len(payload)})
    with suppress(FormatError):
        if (found := Video(reader).audio) is not None:
            row |= {"type": found.media_type, "start_s": found.start}
    return row


def megabits(size: int, reader: ReelReader) -> float:
    """Return the rate of `size` bytes spread over all frames, Mbit/s."""
    return size * 8 * reader.frame_rate / reader.frame_count / 1e6


def _describe_group(reader: ReelReader, chunk: Chunk, there: int) -> dict[str, Any]:
    """Describe a group of a file of which the first `there` bytes exist."""
    row: dict[str, Any] = {"chunk": chunk.number, "track": chunk.track}
    first, end = _shown(reader, chunk)
    row |= {"first_frame": first, "frames": end - first}
    row |= {"form": chunk.form_name, "bytes": _size_of(reader, chunk), "layers": len(chunk.layers) - 1}
    row["predicted"] = reader.group_before(chunk) is not None
    return row | _contents(reader, chunk, there, payload_bytes_by_purpose)


def _shown(reader: ReelReader, chunk: Chunk) -> tuple[int, int]:
    """Return the first frame of a group that is shown, and where those end."""
    first = min(max(chunk.first_frame, 0), reader.frame_count)
    return first, max(min(chunk.first_frame + chunk.frame_count, reader.frame_count), first)


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
    there = [_shown(reader, group) for group in reader.tracks[number] if group.form != Form.EMPTY]
    there = [span for span in there if span[0] < span[1]]
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


def _added_up(row: dict[str, Any]) -> dict[str, Any]:
    """Return bytes and rates by content of all tracks together."""
    found: dict[str, dict[str, Any]] = {name: {} for name in ("bytes_by_content", "mbps_by_content")}
    for of, sums in found.items():
        for name, size in row[of].items():
            what = name.partition(": ")[2] or name
            sums[what] = sums.get(what, 0) + size
    return found


def rate_table(row: dict[str, Any]) -> Table:
    """Return a table of bytes and rate by content."""
    table = Table("content", "bytes", "Mbps", "share")
    for name, size in ((name, size) for name, size in row["bytes_by_content"].items() if size):
        table.add_row(name, str(size), f"{row['mbps_by_content'][name]:.4f}", f"{100 * size / row['bytes']:.1f} %")
    return table


def _tracks(row: dict[str, Any], most: int | None) -> Table:
    table = Table("track", "appears in frames", "groups", "bytes", "Mbps")
    for track in row["tracks"][:most]:
        size = (str(track["groups"]), str(track["bytes"]), f"{track['mbps']:.4f}")
        table.add_row(str(track["track"]), _listed(track["ranges"], most), *size)
    return _ended(table, len(row["tracks"]), most)


def _states(row: dict[str, Any], most: int | None) -> Table:
    table = Table("background", "form", "changes", "shown in frames", "bytes")
    for state in row["background"][:most]:
        changes = "" if state["changes"] is None else f"chunk {state['changes']}"
        shown = _listed(state["ranges"], most)
        table.add_row(f"chunk {state['chunk']}", state["form"], changes, shown, str(state["bytes"]))
    return _ended(table, len(row["background"]), most)


def _groups(row: dict[str, Any], most: int | None) -> Table:
    several = len(row["tracks"]) > 1
    table = Table("group", *(["track"] if several else []), "frames", "form", "layers", "bytes", "by content")
    for number, group in enumerate(row["groups"][:most]):
        sizes = ", ".join(f"{name} {size}" for name, size in group["bytes_by_content"].items())
        last = group["first_frame"] + group["frames"] - 1
        frames = _listed([[group["first_frame"], last]]) if group["frames"] else "hidden"
        form = group["form"] + (", predicted" if group["predicted"] else "")
        cells = [str(number), *([str(group["track"])] if several else []), frames, form]
        table.add_row(*cells, str(group["layers"]), str(group["bytes"]), sizes)
    return _ended(table, len(row["groups"]), most)


def _ended(table: Table, count: int, most: int | None) -> Table:
    """Return a table that says how many rows it lacks."""
    if most is not None and count > most:
        table.caption = f"{count - most} more: --groups shows all"
    return table


def _listed(ranges: list[list[int]], most: int | None = None) -> str:
    listed = ", ".join(f"{first}-{last}" for first, last in ranges[:most]) or "none"
    return listed if most is None or len(ranges) <= most else f"{listed}, ..."
