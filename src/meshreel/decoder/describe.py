"""Description of a .reel file: its frames, tracks, states and groups, and their sizes in bytes.

In: a file. Out: a JSON object, which `meshreel info` shows. Only the first surface is decoded.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..coding.group import payload_bytes_by_purpose
from ..container.reader import Chunk, ReelReader
from ..container.sources import FileSource
from ..errors import FormatError
from ..format.edit import joined
from ..format.layout import ChunkKind, Form
from .video import Video

LOOKED_AT = 8  # largest number of frames in which the first surface is searched (guess)
COMPANION_NAMES = {
    ChunkKind.COLORS: "vertex colors",
    ChunkKind.ATLAS: "atlas",
    ChunkKind.PICTURES: "pictures",
    ChunkKind.COMPATIBLE: "pictures in H.264",
    ChunkKind.SPLATS: "splats",
}


def describe_file(file: Path) -> dict[str, Any]:
    """Return everything that `info` shows, ready for JSON. A damaged chunk has an error; the others are read.

    Sizes and rates are those of the whole file, even if its end is missing. Ranges of frames are [first, last].
    """
    with FileSource(file) as source:
        try:
            reader = ReelReader(source)
        except FormatError as error:
            raise FormatError(f"{file}: {error}") from error
        length = source.size
        groups = [_describe_group(reader, chunk, length) for chunk in reader.groups]
        ranges = reader.static_ranges(range(reader.frame_count))
        static = [chunk for chunk in reader.chunks if chunk.kind == ChunkKind.STATIC]
        surface = _first_surface(reader)
        audio = _describe_audio(reader, length)
        states = [_describe_state(reader, chunk, length, ranges.get(chunk.number, [])) for chunk in static]
    tracks = [_describe_track(reader, number, groups) for number in range(len(reader.tracks))]
    of_tracks = [_renamed(track, len(tracks) > 1) for track in tracks]
    audio_sizes = [] if audio is None else [audio["bytes_by_content"]]
    head = {"header and index": reader.head_size}
    sizes = _sum([head, *(state["bytes_by_content"] for state in states), *of_tracks, *audio_sizes])
    return {
        "frames": reader.frame_count,
        "frame_rate": reader.frame_rate,
        "duration_s": reader.duration,
        "box_m": [corner.tolist() for corner in reader.box],
        "up": reader.up,
        "view": None if reader.view is None else asdict(reader.view),
        "first_surface": surface,
        "layers": max(group["layers"] for group in groups),
        "color": _color(reader),
        "audio": audio,
        "frames_hidden": reader.coded_count - reader.frame_count,
        "bytes": reader.size,
        "bytes_missing": reader.size - length,
        "mbps": megabits(reader.size, reader),
        "bytes_by_content": sizes,
        "mbps_by_content": {name: megabits(size, reader) for name, size in sizes.items()},
        "tracks": tracks,
        "background": states,
        "groups": groups,
        "metadata": reader.metadata,
    }


def _first_surface(reader: ReelReader) -> dict[str, int] | None:
    """Return number, vertices and faces of the first undamaged frame with a surface, among the first few."""
    video = Video(reader).at(colors=False)
    for frame in range(min(reader.frame_count, LOOKED_AT)):
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


def _describe_audio(reader: ReelReader, length: int) -> dict[str, Any] | None:
    """Describe the audio file, and its start after the first frame; None if there is none."""
    if reader.audio is None:
        return None
    row: dict[str, Any] = {"bytes": reader.audio.size}
    row |= _contents(reader, reader.audio, length, lambda payload: {"audio": len(payload)})
    with suppress(FormatError):
        if (clip := Video(reader).audio) is not None:
            row |= {"type": clip.media_type, "start_s": clip.start}
    return row


def megabits(size: int, reader: ReelReader) -> float:
    """Return the rate of `size` bytes spread over all frames, Mbit/s."""
    return size * 8 * reader.frame_rate / reader.frame_count / 1e6


def _describe_group(reader: ReelReader, chunk: Chunk, length: int) -> dict[str, Any]:
    """Describe a group of a file of which the first `length` bytes exist."""
    row: dict[str, Any] = {"chunk": chunk.number, "track": chunk.track}
    row |= {"first_frame": chunk.shown.start, "frames": len(chunk.shown)}
    row |= {"form": chunk.form_name, "bytes": _size_of(reader, chunk), "layers": len(chunk.layers) - 1}
    row["predicted"] = reader.group_before(chunk) is not None
    return row | _contents(reader, chunk, length, payload_bytes_by_purpose)


def _size_of(reader: ReelReader, chunk: Chunk) -> int:
    return chunk.size + sum(other.size for _, other in _companions(reader, chunk))


def _companions(reader: ReelReader, chunk: Chunk) -> Iterator[tuple[str, Chunk]]:
    """Yield the companions of a chunk, with the names of their contents."""
    for kind, name in COMPANION_NAMES.items():
        if (other := reader.companion_of(chunk, kind)) is not None:
            yield name if chunk.frame_count else f"background's {name}", other


def _describe_state(reader: ReelReader, chunk: Chunk, length: int, shown: Iterable[tuple[int, int]]) -> dict[str, Any]:
    """Describe a state of the background: the state that it changes, if any, and the frames that show it."""
    row: dict[str, Any] = {"chunk": chunk.number, "form": chunk.form_name, "bytes": _size_of(reader, chunk)}
    row["changes"] = chunk.depends_on[0] if chunk.depends_on else None
    row["ranges"] = _merged(range(*ends) for ends in shown)
    return row | _contents(reader, chunk, length, lambda payload: {"background": len(payload)})


def _describe_track(reader: ReelReader, number: int, groups: list[dict[str, Any]]) -> dict[str, Any]:
    """Describe a track: the frames in which its body appears, and the bytes of its contents."""
    track_groups = [group for group in groups if group["track"] == number]
    spans = (group.shown for group in reader.tracks[number] if group.form != Form.EMPTY)
    size = sum(group["bytes"] for group in track_groups)
    row: dict[str, Any] = {"track": number, "ranges": _merged(spans), "groups": len(track_groups), "bytes": size}
    return row | {
        "mbps": megabits(size, reader),
        "bytes_by_content": _sum([group["bytes_by_content"] for group in track_groups]),
    }


def _contents(
    reader: ReelReader, chunk: Chunk, length: int, sizes_of: Callable[[bytes], dict[str, int]]
) -> dict[str, Any]:
    """Return the bytes of a chunk by content; for a damaged chunk its error, and the number of missing bytes."""
    sizes, errors = dict[str, int](), list[str]()
    for name, part in [("", chunk), *_companions(reader, chunk)]:
        try:
            payload = reader.read_chunk(part.number)
            sizes_of_part = {name: len(payload)} if name else sizes_of(payload)
        except FormatError as error:
            missing = min(max(part.end - length, 0), part.size)
            sizes_of_part = {"damaged": part.size - missing, "missing": missing}
            errors.append(str(error))
        sizes = _sum([sizes, {what: size for what, size in sizes_of_part.items() if size}])
    return {"bytes_by_content": sizes} | ({"error": errors[0]} if errors else {})


def _sum(rows: Iterable[dict[str, int]]) -> dict[str, int]:
    total = Counter[str]()
    for row in rows:
        total.update(row)
    return dict(total)


def _renamed(track: dict[str, Any], several: bool) -> dict[str, int]:
    """Return the bytes of a track by content; names include the track if there are several, except for lost bytes."""
    unnamed = ("damaged", "missing")
    prefix = f"track {track['track']}: " if several else ""
    return {name if name in unnamed else prefix + name: size for name, size in track["bytes_by_content"].items()}


def _merged(ranges: Iterable[range]) -> list[list[int]]:
    """Return first and last frames of ranges in order, adjacent ones merged."""
    return [[run.start, run.stop - 1] for run in joined(ranges)]
