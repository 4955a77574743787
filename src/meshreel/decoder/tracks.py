"""Tracks of moving bodies and the background of a .reel file, decoded on access.

In: a reader. Out: read-only meshes in metres. A track decodes a group and the groups that it is predicted from; the
background is decoded once and kept until another state of it is shown.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..coding.background import decode_background, decode_change
from ..coding.group import continue_group
from ..coding.layers.coder import MOST_NUMBERS, LayersState
from ..container.reader import Chunk, ReelReader
from ..errors import FormatError
from ..format.budget import Chain, together
from ..format.layout import Form
from ..types import Frames, Mesh, Placement
from .cache import MOST_KEPT, NO_GROUP, CachedGroup, CachedStates, Refusals, memory_of, read_only

MOST_TOGETHER = 8 * MOST_NUMBERS  # bytes: the groups of one frame take no more memory than the largest legal group


class Track(Frames):
    """One moving body over the whole file: a mesh for each frame, empty in frames without the body."""

    def __init__(self, reader: ReelReader, number: int, layers: int | None = None) -> None:
        """Decode track `number` from at most `layers` layers of each group beyond its first; None: from all."""
        self.reader = reader
        self.number = number
        self.layers = layers
        self._place = placement(reader)
        self._group = NO_GROUP
        self._states = CachedStates({})
        self._refusals = Refusals()

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

    def _decoded(self, chunk: Chunk) -> CachedGroup:
        """Return a group, from the cache if it was the last one decoded."""
        group = self._group  # read once: another thread may replace it
        if group.number == chunk.number:
            return group
        chain = [chunk]
        states = self._states
        self._refusals.check(chunk)
        while (before := self.reader.group_before(chain[-1])) is not None and before.number not in states.known:
            self._refusals.check(before, chain)
            chain.append(before)
        state = None if before is None else states.known[before.number]
        states = CachedStates({}) if before is None else states.copy()
        most = MOST_KEPT // len(self.reader.tracks)  # all tracks together keep no more than a single one would
        for link in reversed(chain):
            meshes, after = self._decode(link, state)
            states = states.add(link.number, after, state, most)
            state = after
        self._states = states
        self._group = group = CachedGroup(chunk.number, meshes, memory_of(meshes))
        return group

    def _decode(self, chunk: Chunk, before: LayersState | None) -> tuple[list[Mesh], LayersState | None]:
        payload = self.reader.read_chunk(chunk.number, None if self.layers is None else self.layers + 1)
        with self._refusals.of(chunk):
            meshes, state = continue_group(payload, chunk.frame_count, self.layers, before, self._place)
        shown = {id(mesh): read_only(mesh) for mesh in meshes}  # the frames of an empty group are one mesh
        return [shown[id(mesh)] for mesh in meshes], state


class Background:
    """The background of each frame. It has no layers: all of it is read, whatever the layers of the tracks."""

    def __init__(self, reader: ReelReader) -> None:
        self.reader = reader
        self._place = placement(reader)
        # Number of a chunk, its mesh, and what led to it; replaced as a whole, as other threads do.
        self._last = (-1, Mesh.empty(), Chain())
        self._refusals = Refusals()

    def of_frame(self, frame: int) -> Mesh | None:
        """Return the background of a frame in metres, None if the frame has none.

        Raises IndexError out of range and FormatError if it, or a state that it was changed from, is damaged.
        """
        chunk = self.reader.static_of_frame(frame)
        if chunk is None:
            return None
        try:
            return self._state(chunk)
        except FormatError as error:
            raise FormatError(f"the background of frame {frame}: {error}") from error

    def _state(self, chunk: Chunk) -> Mesh:
        """Decode a state, starting from the last one decoded if the state is that one or was changed from it."""
        known, mesh, led = self._last
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
            mesh = read_only(mesh)
            self._last = (chunk.number, mesh, led)
        return mesh

    def _decode(self, chunk: Chunk, before: Mesh, led: Chain) -> tuple[Mesh, Chain]:
        payload = self.reader.read_chunk(chunk.number)
        with self._refusals.of(chunk):
            if chunk.form == Form.PATCH:
                after = decode_change(payload, before, self._place)
                return after, led.then(before, after, len(payload))
            return decode_background(payload, self._place), Chain(0, len(payload))


def placement(reader: ReelReader) -> Placement:
    """Return the map from the normalised coordinates of a file to metres."""
    return Placement(reader.header.scale, reader.header.origin)


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
