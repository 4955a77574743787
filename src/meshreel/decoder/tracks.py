"""Tracks of moving bodies and the background of a .reel file, decoded on access.

In: a reader. Out: read-only meshes in metres. A track decodes a group and the groups that it is predicted from; the
background is decoded once and kept until another state of it is shown.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .. import _core
from ..container.reader import Chunk, ReelReader
from ..errors import FormatError
from ..format.budget import Chain
from ..format.layout import ChunkKind, Form
from ..geometry.splats import Bound
from ..geometry.topology import part_of
from ..shapes import Float, Int32
from ..types import Frames, Mesh, Texture
from .cache import MOST_KEPT, CachedGroup, CachedStates, Refusals, most_together
from .pictures import Decoders, TrackPictures
from .topology import FramePart, Topology, positions, topologies

BACKGROUND = "background"  # its name among the parts of a frame
MOST_SPLATS = 4  # chunks of splats that all tracks keep (guess): each may take some 24 MB


class Track(Frames):
    """Moving body over the whole file: a mesh for each frame, empty in frames without the body."""

    def __init__(
        self, reader: ReelReader, number: int, decoders: Decoders, layers: int | None = None, colored: bool = True
    ) -> None:
        """Decode track `number` from at most `layers` layers of each group beyond its first; None: from all.

        The `decoders` of all tracks of a file are one, so that they share their memory limit.
        """
        self.reader = reader
        self._colored = colored and reader.is_colored
        self.number = number
        self.layers = layers
        self._place = placement(reader)
        self._groups = decoders.groups
        self._pictures = TrackPictures(reader, decoders)
        self._splats = TrackSplats(reader, decoders, layers)
        self._refusals = Refusals()  # of frames
        self._lost = Refusals()  # of states, which may be valid if frames of the same group are damaged

    @property
    def name(self) -> str:
        """The track's name among the parts of a frame, as in "track 0"."""
        return f"track {self.number}"

    def __repr__(self) -> str:
        groups = [group for group in self.reader.tracks[self.number] if group.form != Form.EMPTY and group.shown]
        count = sum(len(group.shown) for group in groups)
        span = f" ({groups[0].shown.start} to {groups[-1].shown[-1]})" if groups else ""
        size = sum(group.size for group in groups)
        return f"<meshreel.Track: {self.name}, shown in {count} of {len(self)} frames{span}, {size} bytes>"

    def __len__(self) -> int:
        return self.reader.frame_count

    def __getitem__(self, index: int) -> Mesh:
        """Return frame `index` in metres. Raises IndexError out of range and FormatError if its group is damaged."""
        chunk = self.reader.chunk_of_frame(index, self.number)
        return self._decoded(chunk).frames[index - chunk.first_frame]

    def vertices(
        self, first: int = 0, last: int | None = None, out: np.ndarray | None = None
    ) -> Float[np.ndarray, "T V 3"]:
        """Return the positions (m) of the body's vertices in frames `first` to `last` - 1, without patches.

        By default in all frames. `out`, errors and what is left out are as of `Video.vertices`.
        """
        last = len(self) if last is None else last
        return positions(lambda frame: [self.part(frame)], first, last, len(self), out)

    @cached_property
    def topology(self) -> tuple[Topology, ...]:
        """Runs of frames in which the body keeps its vertices and faces, as of `Video.topology`; some may lack it."""
        return topologies(lambda frame: [self.part(frame)], len(self))

    def part(self, index: int) -> FramePart:
        """Return frame `index` without patches, as `vertices` and `topology` compare it. Raises as indexing does."""
        chunk = self.reader.chunk_of_frame(index, self.number)
        group = self._decoded(chunk)
        mesh = group.frames[index - chunk.first_frame]
        whole = [chunk, self.reader.group_before(chunk)] if group.core.vertices else []  # else each frame has its mesh
        same = tuple(one.number for one in whole if one is not None)

        def faces() -> Int32[np.ndarray, "F 3"]:
            state = group.core.state
            if state is None or state.levels + 1 == len(chunk.layers):
                return mesh.faces
            return Track(self.reader, self.number, Decoders(), state.levels, colored=False)[index].faces  # hides none

        return FramePart(self.name, mesh.vertices[: group.core.vertices or None], chunk.number, same, faces)

    def memory(self, index: int) -> int:
        """Return the memory of all frames of the group of frame `index`, bytes; decoded once. Raises as indexing."""
        chunk = self.reader.chunk_of_frame(index, self.number)
        known = self._groups.memory.get(chunk.number)
        return self._decoded(chunk).nbytes if known is None else known

    @property
    def _group(self) -> CachedGroup | None:
        """The group decoded last, while all tracks keep it."""
        return self._groups.by_track.get(self.number)

    @property
    def _states(self) -> CachedStates:
        group = self._group
        return CachedStates({}) if group is None else group.states

    def splats(self, index: int) -> Bound | None:
        """Return the splats of frame `index` in metres; None if its groups have none. Raises as indexing does."""
        chunk = self.reader.chunk_of_frame(index, self.number)
        if (of := self._splats.of(chunk)) is None:
            return None
        return self._splats.bound(of, self._decoded(chunk).core, index - chunk.first_frame)

    def patches(self, index: int) -> Mesh:
        """Return the patches of frame `index`: faces that its template lacks, without splats. Raises as indexing."""
        chunk = self.reader.chunk_of_frame(index, self.number)
        group = self._decoded(chunk)
        mesh = group.frames[index - chunk.first_frame]
        return part_of(mesh, mesh.faces.min(axis=1) >= group.core.vertices)

    def _decoded(self, chunk: Chunk) -> CachedGroup:
        """Return a group, from the cache if it was the last one decoded."""
        group = self._group  # read once: another thread may replace it
        if group is not None and group.number == chunk.number:
            return group
        state, states = self._state_before(chunk)
        payload = self._read(chunk)
        with self._refusals.of(chunk):
            decoded = _core.Group(payload, chunk.frame_count, self.layers, state, self._place)
        self._paint(chunk, decoded, None if chunk.form != Form.LAYERS else self.layers)
        with self._refusals.of(chunk):
            is_colored = self._colored and self.reader.companion_of(chunk, ChunkKind.COLORS) is not None
            texture = self._pictures.place(chunk, decoded) if is_colored else None
        if self.reader.edit.rotation:
            decoded.turn(self.reader.edit.rotation, self.reader.header.origin)
        meshes = _meshes(decoded.frames(), texture)
        states = states.add(chunk.number, decoded.state, state, self._most)
        group = CachedGroup(chunk.number, meshes, decoded.nbytes, chunk.size, decoded, states)
        self._groups.keep(self.number, group)
        return group

    def _state_before(self, chunk: Chunk) -> tuple[_core.GroupState | None, CachedStates]:
        """Return the state that a group is predicted from, and a cache with it; earlier frames are not decoded."""
        chain = [chunk]
        states = self._states
        self._refusals.check(chunk)
        while (before := self.reader.group_before(chain[-1])) is not None and before.number not in states.known:
            self._lost.check(before, chain)
            chain.append(before)
        state = None if before is None else states.known[before.number]
        # A cache that can grow while other threads read this one.
        states = CachedStates({}) if before is None else CachedStates(dict(states.known), states.nbytes)
        for link in reversed(chain[1:]):
            payload = self._read(link)
            after = None
            if link.form == Form.LAYERS:
                with self._lost.of(link):
                    skipped = _core.Group(payload, link.frame_count, self.layers, state, self._place, shown=False)
                if (after := skipped.state) is not None:
                    self._paint(link, skipped, after.levels)  # the levels that the next colours are predicted from
            states = states.add(link.number, after, state, self._most)
            state = after
        return state, states

    def _paint(self, chunk: Chunk, group: _core.Group, layers: int | None) -> None:
        """Decode the colours of a group, if it has some, from at most `layers` layers beyond its first; None: all."""
        of = self.reader.companion_of(chunk, ChunkKind.COLORS) if self._colored else None
        if of is None:
            return
        with self._refusals.of(of):
            group.paint(self.reader.read_chunk(of.number, None if layers is None else layers + 1))

    @property
    def _most(self) -> int:
        """Bytes of states to keep: all tracks together keep no more than a single track would."""
        return MOST_KEPT // len(self.reader.tracks)

    def _read(self, chunk: Chunk) -> bytes:
        return self.reader.read_chunk(chunk.number, None if self.layers is None else self.layers + 1)


@dataclass(frozen=True, slots=True)
class _State:
    """State of the background, from which the next may be changed."""

    core: _core.Background
    mesh: Mesh  # as it is before the file's edit turns it
    led: Chain


class Background:
    """The background of each frame. It has no layers: all of it is read, whatever the layers of the tracks."""

    def __init__(self, reader: ReelReader, decoders: Decoders, colored: bool = True) -> None:
        self.reader = reader
        self._colored = colored
        self._pictures = TrackPictures(reader, decoders)
        self._place = placement(reader)
        # Number of a chunk, its state, and the shown mesh; replaced as one for other threads.
        self._last: tuple[int, _State | None, Mesh] = (-1, None, Mesh.empty())
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

    def part(self, frame: int) -> FramePart:
        """Return the background of a frame, as `Video.vertices` compares it. Raises as `of_frame` does."""
        mesh, chunk = self.of_frame(frame) or Mesh.empty(), self.reader.static_of_frame(frame)
        number = -1 if chunk is None else chunk.number
        return FramePart(BACKGROUND, mesh.vertices, number, (number,), lambda: mesh.faces)

    def _state(self, chunk: Chunk) -> Mesh:
        """Decode a state, starting from the last decoded one if it is that state or changes it."""
        last, state, shown = self._last
        chain = [chunk]
        self._refusals.check(chunk)
        while chain[-1].number != last and chain[-1].depends_on:
            before = self.reader.chunks[chain[-1].depends_on[0]]
            self._refusals.check(before, chain)
            chain.append(before)
        if chain[-1].number == last:
            chain.pop()
        for link in reversed(chain):
            state = self._decode(link, state)
        if chain:
            assert state is not None
            shown = turned(state.mesh, self.reader)
            shown.vertices.flags.writeable = False
            self._last = (chunk.number, state, shown)
        return shown

    def _decode(self, chunk: Chunk, before: _State | None) -> _State:
        payload = self.reader.read_chunk(chunk.number)
        before = before if chunk.form == Form.PATCH else None
        with self._refusals.of(chunk):
            core = _core.Background(payload, None if before is None else before.core, self._place)
        texture = None if before is None else before.mesh.texture
        of = self.reader.companion_of(chunk, ChunkKind.COLORS) if self._colored else None
        if of is not None:  # colours of added faces follow those of the remaining ones
            with self._refusals.of(of):
                core.paint(self.reader.read_chunk(of.number))
            with self._refusals.of(chunk):
                placed = self._pictures.place(chunk, core)
            texture = texture if placed is None else placed(0)
        mesh = Mesh(*core.arrays(), texture)
        with self._refusals.of(chunk):
            led = Chain(0, len(payload)) if before is None else before.led.then(before.mesh, mesh, len(payload))
        return _State(core, mesh, led)


def placement(reader: ReelReader) -> tuple[float, tuple[float, float, float]]:
    """Return the map from the normalised coordinates of a file to metres: their scale and origin."""
    x, y, z = reader.header.origin
    return reader.header.scale, (x, y, z)


def _meshes(frames: Sequence[_core.Arrays], texture: Callable[[int], Texture] | None) -> list[Mesh]:
    """Return the decoded arrays of frames as meshes; frames that share all arrays are one mesh."""
    if texture is not None:
        return [Mesh(*arrays, texture(frame)) for frame, arrays in enumerate(frames)]
    made: dict[int, Mesh] = {}
    return [made.setdefault(id(arrays), Mesh(*arrays)) for arrays in frames]


def turned(mesh: Mesh, reader: ReelReader) -> Mesh:
    """Return a mesh of a file, in metres, with the rotation of the file's edit."""
    if not reader.edit.rotation:
        return mesh
    turn, origin = np.array(reader.edit.rotation).reshape(3, 3), np.array(reader.header.origin)
    x, y, z = (mesh.vertices - origin).T
    return mesh.at(origin + np.stack([a * x + b * y + c * z for a, b, c in turn], axis=1))  # not BLAS, whose bits vary


def moving_of_frame(tracks: Sequence[Track], frame: int) -> list[Mesh]:
    """Return a frame of each track. Raises FormatError if their groups take more memory than their bytes may."""
    taken = size = 0
    for number, track in enumerate(tracks):
        taken, size = taken + track.memory(frame), size + track.reader.chunk_of_frame(frame, track.number).size
        if number and taken > (most := most_together(size)):
            text = f"its groups of tracks 0 to {track.number} take {taken} bytes, over {most}"
            raise FormatError(f"frame {frame}: {text}")
    return [track[frame] for track in tracks]


class TrackSplats:
    """Splats of one track, from at most `layers` layers beyond the first; None: from all."""

    def __init__(self, reader: ReelReader, decoders: Decoders, layers: int | None) -> None:
        self._reader, self._decoders, self._layers = reader, decoders, layers
        self._refusals = Refusals()

    def of(self, chunk: Chunk) -> Chunk | None:
        """Return the chunk of a group's splats: its own, or that of the group before it, and so on; None: no splats."""
        group: Chunk | None = chunk if chunk.form in (Form.LAYERS, Form.LAPLACIAN) else None
        while group is not None:
            if (companion := self._reader.companion_of(group, ChunkKind.SPLATS)) is not None:
                return companion
            group = self._reader.group_before(group)
        return None

    def bound(self, of: Chunk, group: _core.Group, index: int) -> Bound | None:
        """Return the splats of a frame of a group in metres; None if they are on another mesh.

        Raises FormatError on damaged bytes.
        """
        kept = self._decoders.splats  # read once: another thread may replace it
        if (splats := kept.get(of.number)) is None:
            whole = None if self._layers is None else self._layers + 1
            owner = self._reader.read_chunk(of.depends_on[0], 1)
            data = self._reader.read_chunk(of.number, whole)
            self._refusals.check(of)
            with self._refusals.of(of):
                splats = _core.read_splats(data, owner)
            self._decoders.splats = dict([*kept.items(), (of.number, splats)][-MOST_SPLATS:])
        bound = splats.bind(group, index, self._reader.header.scale)
        return None if bound is None else Bound(*bound)
