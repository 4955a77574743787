"""Tracks of moving bodies and the background of a .reel file, decoded on access.

In: a reader. Out: read-only meshes in metres. A track decodes a group and the groups that it is predicted from; the
background is decoded once and kept until another state of it is shown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..coding.background import decode_background, decode_change
from ..coding.colored import Canvas, background_canvas, canvas_of, decode_group_colors, paint_background
from ..coding.group import continue_group, skip_group
from ..coding.layers.coder import MOST_NUMBERS, LayersState
from ..container.reader import Chunk, ReelReader
from ..errors import FormatError
from ..format.budget import Chain, together
from ..format.layout import ChunkKind, Form
from ..geometry.splats import Bound
from ..shapes import UInt8
from ..types import Frames, Mesh, Placement
from .cache import MOST_KEPT, NO_GROUP, CachedGroup, CachedStates, Refusals, memory_of, read_only
from .pictures import Decoders, TrackPictures
from .splats import TrackSplats

MOST_TOGETHER = 8 * MOST_NUMBERS  # bytes: the groups of one frame take no more memory than the largest legal group


class Track(Frames):
    """Moving body over the whole file: a mesh for each frame, empty in frames without the body."""

    def __init__(
        self,
        reader: ReelReader,
        number: int,
        layers: int | None = None,
        colored: bool = True,
        decoders: Decoders | None = None,
    ) -> None:
        """Decode track `number` from at most `layers` layers of each group beyond its first; None: from all.

        Pass one `decoders` to all tracks to share their memory limit.
        """
        self.reader = reader
        self._colored = colored and reader.is_colored
        self.number = number
        self.layers = layers
        self._place = placement(reader)
        self._group = NO_GROUP
        self._states = CachedStates({})
        self._pictures = TrackPictures(reader, decoders or Decoders())
        self._splats = TrackSplats(reader, layers)
        self._refusals = Refusals()  # of frames
        self._lost = Refusals()  # of states, which may be valid if frames of the same group are damaged

    def __len__(self) -> int:
        return self.reader.frame_count

    def __getitem__(self, index: int) -> Mesh:
        """Return frame `index` in metres. Raises IndexError out of range and FormatError if its group is damaged."""
        return self.frame_and_memory(index)[0]

    def frame_and_memory(self, index: int) -> tuple[Mesh, int]:
        """Return frame `index` and the memory of all frames of its group in bytes."""
        chunk = self.reader.chunk_of_frame(index, self.number)
        group = self._decoded(chunk)
        return group.frames[index - chunk.first_frame], group.nbytes

    def splats(self, index: int) -> Bound | None:
        """Return the splats of frame `index` in metres; None if its groups have none. Raises as indexing does."""
        chunk = self.reader.chunk_of_frame(index, self.number)
        if (of := self._splats.of(chunk)) is None:
            return None
        frames, (before, _) = self._decoded(chunk).frames, self._state_before(chunk)
        return self._splats.bound(of, chunk, self._read(chunk), frames, before, index - chunk.first_frame)

    def _decoded(self, chunk: Chunk) -> CachedGroup:
        """Return a group, from the cache if it was the last one decoded."""
        group = self._group  # read once: another thread may replace it
        if group.number == chunk.number:
            return group
        state, states = self._state_before(chunk)
        payload = self._read(chunk)
        with self._refusals.of(chunk):
            meshes, after = continue_group(payload, chunk.frame_count, self.layers, state, self._place)
        meshes, after = self._painted(chunk, payload, meshes, state, after)
        views = {
            id(mesh): read_only(turned(mesh, self.reader)) for mesh in meshes
        }  # the frames of an empty group are one mesh
        meshes = [views[id(mesh)] for mesh in meshes]
        self._states = states.add(chunk.number, after, state, self._most)
        self._group = group = CachedGroup(chunk.number, meshes, memory_of(meshes))
        return group

    def _state_before(self, chunk: Chunk) -> tuple[LayersState | None, CachedStates]:
        """Return the state that a group is predicted from, and a cache with it; earlier frames are not decoded."""
        chain = [chunk]
        states = self._states
        self._refusals.check(chunk)
        while (before := self.reader.group_before(chain[-1])) is not None and before.number not in states.known:
            self._lost.check(before, chain)
            chain.append(before)
        state = None if before is None else states.known[before.number]
        states = CachedStates({}) if before is None else states.copy()
        for link in reversed(chain[1:]):
            payload = self._read(link)
            with self._lost.of(link):
                after = skip_group(payload, link.frame_count, self.layers, state)
            after = self._state_with_colors(link, payload, state, after)
            states = states.add(link.number, after, state, self._most)
            state = after
        return state, states

    def _painted(
        self, chunk: Chunk, payload: bytes, meshes: list[Mesh], before: LayersState | None, after: LayersState | None
    ) -> tuple[list[Mesh], LayersState | None]:
        """Return the frames of a group with its colours, and the state for the next group with its colours."""
        if not self._colored or self.reader.companion_of(chunk, ChunkKind.COLORS) is None:
            return meshes, after
        counts = [len(mesh.vertices) for mesh in meshes]
        with self._refusals.of(chunk):
            canvas = canvas_of(payload, counts, self.layers, before)
        layers = None if chunk.form != Form.LAYERS else self.layers
        colors, after = self._colors(chunk, canvas, layers, before, after)
        meshes = [replace(mesh, colors=own) for mesh, own in zip(meshes, colors, strict=True)]
        with self._refusals.of(chunk):
            return self._pictures.textured(chunk, meshes, canvas), after

    def _state_with_colors(
        self, chunk: Chunk, payload: bytes, before: LayersState | None, after: LayersState | None
    ) -> LayersState | None:
        """Return a state with the colours that the next group may be predicted from; no frame is painted."""
        if after is None or not self._colored or self.reader.companion_of(chunk, ChunkKind.COLORS) is None:
            return after
        levels = len(after.scalars)  # without the patches, from which nothing is predicted
        canvas = canvas_of(payload, [after.count] * chunk.frame_count, levels, before)
        return self._colors(chunk, canvas, levels, before, after)[1]

    def _colors(
        self, chunk: Chunk, canvas: Canvas, layers: int | None, before: LayersState | None, after: LayersState | None
    ) -> tuple[list[UInt8[np.ndarray, "_ 3"]], LayersState | None]:
        """Decode the colours of a group that has some, from at most `layers` layers beyond its first; None: all."""
        of = self.reader.companion_of(chunk, ChunkKind.COLORS)
        assert of is not None
        with self._refusals.of(of):
            data = self.reader.read_chunk(of.number, None if layers is None else layers + 1)
            return decode_group_colors(data, canvas, before, after)

    @property
    def _most(self) -> int:
        """Bytes of states to keep: all tracks together keep no more than a single track would."""
        return MOST_KEPT // len(self.reader.tracks)

    def _read(self, chunk: Chunk) -> bytes:
        return self.reader.read_chunk(chunk.number, None if self.layers is None else self.layers + 1)


class Background:
    """The background of each frame. It has no layers: all of it is read, whatever the layers of the tracks."""

    def __init__(self, reader: ReelReader, colored: bool = True, decoders: Decoders | None = None) -> None:
        self.reader = reader
        self._colored = colored
        self._pictures = TrackPictures(reader, decoders or Decoders())
        self._place = placement(reader)
        # Number of a chunk, its mesh, the chain that led to it, and the shown mesh; replaced as one for other threads.
        self._last = (-1, Mesh.empty(), Chain(), Mesh.empty())
        self._refusals = Refusals()

    def of_frame(self, frame: int) -> Mesh | None:
        """Return the background of a frame in metres, None if the frame has none.

        Raises IndexError out of range and FormatError if the state, or one that it changes, is damaged.
        """
        chunk = self.reader.static_of_frame(frame)
        if chunk is None:
            return None
        try:
            return self._pictures.shown(chunk, self._state(chunk), frame)
        except FormatError as error:
            raise FormatError(f"the background of frame {frame}: {error}") from error

    def _state(self, chunk: Chunk) -> Mesh:
        """Decode a state, starting from the last decoded one if it is that state or changes it."""
        known, mesh, led, shown = self._last
        chain = [chunk]
        self._refusals.check(chunk)
        while chain[-1].number != known and chain[-1].depends_on:
            before = self.reader.chunks[chain[-1].depends_on[0]]
            self._refusals.check(before, chain)
            chain.append(before)
        if chain[-1].number == known:
            chain.pop()
        for link in reversed(chain):
            mesh, led = self._decode(link, mesh, led)
        if chain:
            shown = read_only(turned(mesh, self.reader))
            self._last = (chunk.number, mesh, led, shown)
        return shown

    def _decode(self, chunk: Chunk, before: Mesh, led: Chain) -> tuple[Mesh, Chain]:
        payload = self.reader.read_chunk(chunk.number)
        with self._refusals.of(chunk):
            if chunk.form == Form.PATCH:
                after = decode_change(payload, before, self._place)
                return self._painted(chunk, payload, after), led.then(before, after, len(payload))
            return self._painted(chunk, payload, decode_background(payload, self._place)), Chain(0, len(payload))

    def _painted(self, chunk: Chunk, payload: bytes, mesh: Mesh) -> Mesh:
        """Return a state with its colours, if any: those of added faces follow those of the remaining ones."""
        of = self.reader.companion_of(chunk, ChunkKind.COLORS) if self._colored else None
        if of is None:
            return mesh
        with self._refusals.of(of):
            mesh = paint_background(mesh, payload, self.reader.read_chunk(of.number))
        with self._refusals.of(chunk):
            return self._pictures.textured(chunk, [mesh], background_canvas(payload))[0]


def placement(reader: ReelReader) -> Placement:
    """Return the map from the normalised coordinates of a file to metres."""
    return Placement(reader.header.scale, reader.header.origin)


def turned(mesh: Mesh, reader: ReelReader) -> Mesh:
    """Return a mesh of a file, in metres, with the rotation of the file's edit."""
    if not reader.edit.rotation:
        return mesh
    turn, origin = np.array(reader.edit.rotation).reshape(3, 3), np.array(reader.header.origin)
    x, y, z = (mesh.vertices - origin).T
    return mesh.at(origin + np.stack([a * x + b * y + c * z for a, b, c in turn], axis=1))  # not BLAS, whose bits vary


def moving_of_frame(tracks: Sequence[Track], frame: int) -> list[Mesh]:
    """Return a frame of each track. Raises FormatError if their groups take more memory than their bytes may."""
    meshes: list[Mesh] = []
    taken = size = 0
    for track in tracks:
        mesh, nbytes = track.frame_and_memory(frame)
        taken += nbytes
        size += track.reader.chunk_of_frame(frame, track.number).size
        most = min(together(size), MOST_TOGETHER)
        if meshes and taken > most:
            raise FormatError(
                f"frame {frame}: its groups of tracks 0 to {track.number} take {taken} bytes, over {most}"
            )
        meshes.append(mesh)
    return meshes
