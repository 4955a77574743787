"""Splats of a track: decoded on access for a chain of groups, and bound to the mesh of each frame.

In: a reader, and a decoded group. Out: Gaussians in metres.
"""

from __future__ import annotations

from .. import _core
from ..container.reader import Chunk, ReelReader
from ..format.layout import ChunkKind, Form
from ..geometry.splats import Bound
from .cache import Refusals


class TrackSplats:
    """Splats of one track, from at most `layers` layers beyond the first; None: from all."""

    def __init__(self, reader: ReelReader, layers: int | None) -> None:
        self._reader, self._layers = reader, layers
        self._refusals = Refusals()
        self._splats: tuple[int, _core.Splats] | None = None  # of the chunk used last

    def of(self, chunk: Chunk) -> Chunk | None:
        """Return the chunk of a group's splats: its own, or that of the group before it, and so on; None: no splats."""
        group: Chunk | None = chunk if chunk.form in (Form.LAYERS, Form.LAPLACIAN) else None
        while group is not None:
            if (companion := self._reader.companion_of(group, ChunkKind.SPLATS)) is not None:
                return companion
            group = self._reader.group_before(group)
        return None

    def bound(self, of: Chunk, group: _core.Group | None, index: int) -> Bound | None:
        """Return the splats of a frame of a group in metres; None if they are on another mesh.

        Raises FormatError on damaged bytes.
        """
        if self._splats is None or self._splats[0] != of.number:
            whole = None if self._layers is None else self._layers + 1
            owner = self._reader.read_chunk(of.depends_on[0], 1)
            data = self._reader.read_chunk(of.number, whole)
            self._refusals.check(of)
            with self._refusals.of(of):
                self._splats = of.number, _core.read_splats(data, owner)
        assert group is not None
        bound = self._splats[1].bind(group, index, self._reader.header.scale)
        return None if bound is None else Bound(*bound)
