"""Splats of a track: decoded on access for a chain of groups, and bound to the mesh of each frame.

In: a reader, and the mesh of a frame with the state before it. Out: Gaussians in metres.
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
        self._splats: tuple[int, int, Splats] | None = None  # chunk used last, number of its mesh's faces, its splats
        self._carriers: tuple[int, list[Carrier]] | None = None  # group used last, and carriers of its frames

    def of(self, chunk: Chunk) -> Chunk | None:
        """Return the chunk of a group's splats: its own, or that of the group before it, and so on; None: no splats."""
        group: Chunk | None = chunk if chunk.form in (Form.LAYERS, Form.LAPLACIAN) else None
        while group is not None:
            if (companion := self._reader.companion_of(group, ChunkKind.SPLATS)) is not None:
                return companion
            group = self._reader.group_before(group)
        return None

    def bound(
        self, of: Chunk, chunk: Chunk, payload: bytes, frames: list[Mesh], before: LayersState | None, index: int
    ) -> Bound | None:
        """Return the splats of a frame of a group, whose frames are in metres; None if they are on another mesh.

        Raises FormatError on damaged bytes.
        """
        if self._carriers is None or self._carriers[0] != chunk.number:
            layers = None if chunk.form != Form.LAYERS else self._layers
            canvas = canvas_of(payload, [len(mesh.vertices) for mesh in frames], layers, before)
            self._carriers = chunk.number, canvas.carriers(frames, self._reader.header.scale)
        if self._splats is None or self._splats[0] != of.number:
            whole = None if self._layers is None else self._layers + 1
            count = len(atlas_base(self._reader.read_chunk(of.depends_on[0], 1)).faces)
            data = self._reader.read_chunk(of.number, whole)
            self._refusals.check(of)
            with self._refusals.of(of):
                self._splats = of.number, count, decode_splats(data, count)
        carrier, (_, count, splats) = self._carriers[1][index], self._splats
        return bind(splats, carrier) if len(carrier.faces) == count * 4**carrier.levels else None
