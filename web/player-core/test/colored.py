"""Paints .reel files, for tests of colours: `colored.py [--flat] FILE...` adds colours of all vertices to each.

They are predicted where groups are; with `--flat` all are the same. Writes a JSON object to standard output: of each
name the painted file, and for each of its frames the SHA-256 of the colours that Python decodes, from all layers and
from one beyond the first.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import accumulate
from pathlib import Path

import numpy as np

from meshreel.coding.appearance.colors import EncodedColors
from meshreel.coding.background import decode_background, decode_change
from meshreel.coding.colored import background_canvas, canvas_of, encode_group_colors
from meshreel.coding.group import continue_group
from meshreel.coding.layers.coder import LayersState
from meshreel.container.reader import Chunk, ReelReader
from meshreel.container.writer import Companion, ReelWriter
from meshreel.decoder.video import Video
from meshreel.decoder.video import open as open_video
from meshreel.format.layout import ChunkKind
from meshreel.types import Mesh

OPTIONS = 1 / 64
Colors = Callable[[np.ndarray, int], np.ndarray]  # of vertices in a frame


class Painter:
    """Chunks as they are, each with its colours behind it."""

    def __init__(self, reader: ReelReader, writer: ReelWriter, colors_at: Colors) -> None:
        self._reader = reader
        self._colors_at = colors_at
        self._writer = writer
        self._numbers: dict[int, int] = {}  # of chunks in the file that is written, by those in the one that is read
        self._states: dict[int, LayersState | None] = {}
        self._backgrounds: dict[int, Mesh] = {}

    def add(self, chunk: Chunk) -> None:
        """Copy a chunk, and add its colours."""
        payload = self._reader.read_chunk(chunk.number)
        ends = tuple(accumulate(layer.size for layer in chunk.layers))
        needed = [self._numbers[other] for other in chunk.depends_on]
        if chunk.kind == ChunkKind.STATIC:
            self._numbers[chunk.number] = self._writer.add_static(payload, needed)
            self._add_colors(chunk, self._background(chunk, payload))
            return
        place = (chunk.first_frame, chunk.frame_count)
        self._numbers[chunk.number] = self._writer.add_group(*place, payload, ends, needed, chunk.track)
        if coded := self._group(chunk, payload):
            self._add_colors(chunk, coded)

    def _background(self, chunk: Chunk, payload: bytes) -> EncodedColors:
        before = self._backgrounds[chunk.depends_on[0]] if chunk.depends_on else None
        mesh = decode_background(payload) if before is None else decode_change(payload, before)
        self._backgrounds[chunk.number] = mesh
        canvas = background_canvas(payload)
        added = mesh.vertices[len(mesh.vertices) - canvas.meshes[0].vertices :]
        return encode_group_colors(canvas, [self._colors_at(added, 0)], OPTIONS, None)

    def _group(self, chunk: Chunk, payload: bytes) -> EncodedColors | None:
        before = self._reader.group_before(chunk)
        state = None if before is None else self._states[before.number]
        meshes, after = continue_group(payload, chunk.frame_count, None, state)
        canvas = canvas_of(payload, [len(mesh.vertices) for mesh in meshes], None, state)
        if canvas.meshes == ():
            return None
        colors = [self._colors_at(mesh.vertices, t) for t, mesh in enumerate(meshes)]
        coded = encode_group_colors(canvas, colors, OPTIONS, None if state is None else state.colors)
        self._states[chunk.number] = None if after is None else replace(after, colors=coded.state)
        return coded

    def _add_colors(self, chunk: Chunk, coded: EncodedColors) -> None:
        number = self._numbers[chunk.number]
        before = self._reader.group_before(chunk) if chunk.kind == ChunkKind.GROUP else None
        last = None if before is None else self._writer.companion_of(self._numbers[before.number], ChunkKind.COLORS)
        needed = [number] if last is None else [number, last]
        self._writer.add_companion(Companion(ChunkKind.COLORS, coded.payload, coded.layers), needed)


def flat(vertices: np.ndarray, _: int) -> np.ndarray:
    """One colour."""
    return np.full(vertices.shape, (201, 44, 87), np.uint8)


def waves(vertices: np.ndarray, t: int) -> np.ndarray:
    """Colours of places, which change slowly with time."""
    return np.clip(128 + 110 * np.sin(9 * vertices + 0.2 * t), 0, 255).astype(np.uint8)


def painted(data: bytes, colors_at: Colors) -> bytes:
    """The file with colours."""
    file = io.BytesIO()
    with open_video(data) as video, ReelWriter(file, video.reader.header) as writer:
        painter = Painter(video.reader, writer, colors_at)
        for chunk in video.reader.chunks:
            painter.add(chunk)
    return file.getvalue()


def digests(video: Video) -> list[str]:
    """SHA-256 of the colours of each frame."""
    colors = [mesh.colors for mesh in video]
    return [hashlib.sha256(b"" if some is None else some.tobytes()).hexdigest() for some in colors]


def main(arguments: list[str]) -> None:
    """Writes the object."""
    found = {}
    is_flat = arguments[:1] == ["--flat"]
    for path in map(Path, arguments[is_flat:]):
        file = painted(path.read_bytes(), flat if is_flat else waves)
        with open_video(file) as video:
            text = base64.b64encode(file).decode()
            found[path.stem] = {"file": text, "frames": digests(video), "framesOfOneLayer": digests(video.at(1))}
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main(sys.argv[1:])
