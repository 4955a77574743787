"""`meshreel info`: the contents of a .reel file and their sizes in bytes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.table import Table

from ..decoder.describe import describe_file
from ..decoder.video import open as open_video
from ..edit.metadata import LEAST_COVERED
from ..errors import FormatError
from ..format.view import ITEM as VIEW
from .console import Common, Flag

ALL = 0.99995  # share from which on a frame is covered to 100.0 %
MOST = 8  # rows of a table without --groups: all of them fit on a screen (guess)
MOST_CONTENTS = 24  # largest number of rows of contents; above it, tracks are added up
_LONGEST = 80  # largest number of shown characters of a recorded value


def command(file: Path, /, *, groups: Flag = False, common: Common = Common()) -> None:
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
    metadata = {
        name: _said(name, value) for name, value in row["metadata"].items() if not (row["view"] and name == VIEW)
    }
    short = {name: text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ..." for name, text in metadata.items()}
    recorded = ", ".join(f"{name} {text}" for name, text in (metadata if groups else short).items())
    # Control characters are escaped: an untrusted file must not control the terminal.
    recorded = "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in recorded)
    is_long, more = len(row["bytes_by_content"]) > MOST_CONTENTS and not groups, None if groups else MOST
    tables = [rate_table(row | _added_up(row) if is_long else row)]
    if row["background"] or len(row["tracks"]) > 1:
        tables += [_tracks(row, more), _states(row, more)]
    common.result(row, head, _looks(row), f"recorded at encode: {recorded or 'nothing'}", *tables, _groups(row, more))
    common.warn(f"background: {state['error']}" for state in row["background"] if "error" in state)
    common.warn([f"audio: {row['audio']['error']}"] if "error" in (row["audio"] or {}) else [])
    common.warn(f"group {i}: {group['error']}" for i, group in enumerate(row["groups"]) if "error" in group)


def _said(name: str, value: object) -> str:
    """Return recorded metadata as text; in words, the frame of whose surface the least share is decoded."""
    if name == LEAST_COVERED and isinstance(value, list) and [type(each) for each in value[1:]] == [int, int]:
        share, track, frame = value
        known = isinstance(share, float)
        if known and share >= ALL:
            return "none, each to 100 %"
        return f"frame {frame} of track {track}" + (f", to {100 * share:.3g} %" if known else "")
    return str(value)


def _decode_all(file: Path, row: dict[str, Any]) -> None:
    """Decode each shown group and state of the background; add an error to the row of one that does not decode."""
    with open_video(file) as video:
        decodable = [(state, state["ranges"][0][0], video.background) for state in row["background"] if state["ranges"]]
        for group in row["groups"]:
            if group["frames"]:
                decodable.append((group, group["first_frame"], video.tracks[group["track"]].__getitem__))
        for described, frame, decode in decodable:
            try:
                decode(frame)
            except FormatError as error:
                described.setdefault("error", str(error))


def _looks(row: dict[str, Any]) -> str:
    """Describe box, mesh, layers, colour, audio and first view in a line."""
    low, high = row["box_m"]
    box = " x ".join(f"{end - begin:.3g}" for begin, end in zip(low, high, strict=True))
    mesh, hidden = row["first_surface"], row["frames_hidden"]
    what = f"frame {mesh['frame']}: {mesh['vertices']} vertices, {mesh['faces']} faces" if mesh else "no surface found"
    parts = [f"box {box} m, {row['up']} is up", what, f"{row['layers']} layers", f"colour: {row['color']}"]
    if (sound := row["audio"]) is not None:
        begin = f", from {sound['start_s']:g} s" if "start_s" in sound else ""
        parts.append(f"audio: {sound.get('type', 'damaged')}, {sound['bytes']} bytes{begin}")
    if (view := row["view"]) is not None:
        begin, end = (" ".join(f"{round(number, 6):.3g}" for number in view[name]) for name in ("position", "target"))
        parts.append(f"first view: from {begin} to {end} m, {view['fov']:g} degrees")
    return "; ".join([*parts, *([f"{hidden} frames more are hidden"] if hidden else [])])


def _added_up(row: dict[str, Any]) -> dict[str, Any]:
    """Return bytes and rates by content of all tracks together."""
    sums_by_row: dict[str, dict[str, Any]] = {name: {} for name in ("bytes_by_content", "mbps_by_content")}
    for of, sums in sums_by_row.items():
        for name, size in row[of].items():
            what = name.partition(": ")[2] or name
            sums[what] = sums.get(what, 0) + size
    return sums_by_row


def rate_table(row: dict[str, Any]) -> Table:
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
        frames = _listed(state["ranges"], most)
        table.add_row(f"chunk {state['chunk']}", state["form"], changes, frames, str(state["bytes"]))
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
    """Return the table with a caption that counts the rows it lacks."""
    if most is not None and count > most:
        table.caption = f"{count - most} more: --groups shows all"
    return table


def _listed(ranges: list[list[int]], most: int | None = None) -> str:
    listed = ", ".join(f"{first}-{last}" for first, last in ranges[:most]) or "none"
    return listed if most is None or len(ranges) <= most else f"{listed}, ..."
