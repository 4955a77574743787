"""Splats of a track: those of a chain of groups, decoded on access and bound to the mesh of each frame.

In: a reader, and the mesh of a frame with what led to it. Out: Gaussians in metres.
"""

from __future__ import annotations

from ..coding.appearance.splats import decode_splats
from ..coding.colored import atlas_base, canvas_of
from ..coding.layers.coder import LayersState
from ..container.reader import Chunk, ReelReader
from ..format.layout import ChunkKind, Form
from ..geometry.splats import Bound, Carrier, Splats, bind
from ..types import Mesh
from .cache import Refusals


class TrackSplats:
    """Splats of one track, from at most `layers` layers beyond the first; None: from all."""

    def __init__(self, reader: ReelReader, layers: int | None) -> None:
        self._reader, self._layers = reader, layers
        self._refusals = Refusals()
        self._splats: tuple[int, Splats] | None = None  # of the chunk that was asked for last
        self._carriers: tuple[int, list[Carrier]] | None = None  # of the frames of the group that was asked for last

    def of(self, chunk: Chunk) -> Chunk | None:
        """Return the chunk of the splats that a group has: those of the first group of its chain; None: none."""
        first = chunk
        while (before := self._reader.group_before(first)) is not None:
            first = before
        return self._reader.companion_of(first, ChunkKind.SPLATS)

    def bound(
        self, of: Chunk, chunk: Chunk, payload: bytes, frames: list[Mesh], before: LayersState | None, index: int
    ) -> Bound:
        """Return the splats of a frame of a group, whose frames are in metres. FormatError on damaged bytes."""
        if self._carriers is None or self._carriers[0] != chunk.number:
            layers = None if chunk.form != Form.LAYERS else self._layers
            canvas = canvas_of(payload, [len(mesh.vertices) for mesh in frames], layers, before)
            self._carriers = chunk.number, canvas.carriers(frames, self._reader.header.scale)
        if self._splats is None or self._splats[0] != of.number:
            whole = None if self._layers is None else self._layers + 1
            group = self._reader.chunks[of.depends_on[0]]
            base = atlas_base(self._reader.read_chunk(group.number, 1))
            data = self._reader.read_chunk(of.number, whole)
            self._refusals.check(of)
            with self._refusals.of(of):
                self._splats = of.number, decode_splats(data, len(base.faces))
        return bind(self._splats[1], self._carriers[1][index])
