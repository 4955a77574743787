"""The parts of a .reel file, decoded as they are asked for: tracks of moving bodies, and the background.

In: a reader. Out: read-only meshes in metres. A track decodes a group and those that it is predicted from, and keeps
the last one and what the groups of its chain left; the background is decoded once and kept while frames show it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..coding.background import decode_background, decode_change
from ..coding.group import continue_group
from ..coding.layers.coder import MOST_NUMBERS, LayersState
from ..container.reader import Chunk, ReelReader
from ..errors import FormatError
from ..format.layout import Form
from ..types import Frames, Mesh, Placement

MOST_KEPT = 1 << 29  # bytes of states: a few bytes may say groups that take as much as a file may claim, each
MOST_TOGETHER = 8 * MOST_NUMBERS  # bytes of the groups of a frame, where it has several: as much as one may have


@dataclass(frozen=True, slots=True)
class _Decoded:
    """The last group decoded: its chunk, its frames, and what a group that is predicted from it needs."""

    number: int
    frames: list[Mesh]
    state: LayersState | None
    nbytes: int = 0  # of all frames


@dataclass(frozen=True, slots=True)
class _States:
    """Of the groups of one chain: playing backwards asks for each."""

    known: dict[int, LayersState | None]
    size: int = 0  # bytes

    def of(self, number: int | None) -> LayersState | None:
        """That of a group, None where there is none."""
        return None if number is None else self.known.get(number)

    def add(self, number: int, state: LayersState | None, before: LayersState | None, most: int) -> _States:
        """With that of a group in `known`; without those of other groups where all were over `most` bytes."""
        if number in self.known:
            return self
        size = 0 if state is None else state.nbytes_beyond(before)
        if self.size + size > most:
            return _States({number: state}, 0 if state is None else state.nbytes_beyond(None))
        self.known[number] = state
        return _States(self.known, self.size + size)


class Track(Frames):
    """One moving body over the whole file: a mesh a frame, empty where it is not there."""

    def __init__(self, reader: ReelReader, number: int, quality: int | None = None) -> None:
        self.reader = reader
        self.number = number
        self.quality = quality
        self._place = placement(reader)
        self._group = _Decoded(-1, [], None)
        self._states = _States({})

    def __len__(self) -> int:
        return self.reader.frame_count

    def __getitem__(self, index: int) -> Mesh:
        """Frame `index` in metres. Raises IndexError out of range and FormatError where its group is damaged."""
        return self.look(index)[0]

    def look(self, index: int) -> tuple[Mesh, int]:
        """Frame `index`, and how many bytes the frames of its group take, which it is one of."""
        chunk = self.reader.chunk_of_frame(index, self.number)
        group = self._decoded(chunk)
        return group.frames[index - chunk.first_frame], group.nbytes

    def _decoded(self, chunk: Chunk) -> _Decoded:
        """A group, from the last call where it is the same."""
        known = self._group  # one value: another thread may put its own group there
        if known.number == chunk.number:
            return known
        chain = [chunk]
        states = self._states
        while (before := self.reader.group_before(chain[-1])) is not None and before.number not in states.known:
            chain.append(before)
        state = None if before is None else states.of(before.number)
        states = _States({}) if before is None else _States(dict(states.known), states.size)
        most = MOST_KEPT // len(self.reader.tracks)  # all tracks together keep no more than one alone would
        for link in reversed(chain):
            meshes, after = self._decode(link, state)
            states = states.add(link.number, after, state, most)
            state = after
        self._states = states  # replaced, not changed: other threads may read it
        known = _Decoded(chunk.number, meshes, state, _nbytes(meshes))
        self._group = known
        return known

    def _decode(self, chunk: Chunk, before: LayersState | None) -> tuple[list[Mesh], LayersState | None]:
        payload = self.reader.read_chunk(chunk.number, None if self.quality is None else self.quality + 1)
        try:
            meshes, state = continue_group(payload, chunk.frame_count, self.quality, before, self._place)
        except FormatError as error:
            raise FormatError(f"{chunk}: {error}") from error
        return [_read_only(mesh) for mesh in meshes], state


class Background:
    """The states of what does not move; always whole, whatever quality is asked for."""

    def __init__(self, reader: ReelReader) -> None:
        self.reader = reader
        self._place = placement(reader)
        self._last: tuple[int, Mesh] = (-1, Mesh.empty())  # one value: another thread may put its own there

    def of_frame(self, frame: int) -> Mesh | None:
        """What a frame is shown with, in metres; None where it has none.

        Raises IndexError out of range and FormatError where that, or a state that it was changed from, is damaged.
        """
        chunk = self.reader.static_of_frame(frame)
        if chunk is None:
            return None
        try:
            return self._state(chunk)
        except FormatError as error:
            raise FormatError(f"the background of frame {frame}: {error}") from error

    def _state(self, chunk: Chunk) -> Mesh:
        """A state, from the last one where that is the same or one that it was changed from."""
        known, mesh = self._last
        chain = [chunk]
        while chain[-1].number != known and chain[-1].depends_on:
            chain.append(self.reader.chunks[chain[-1].depends_on[0]])
        if chain[-1].number == known:
            chain.pop()
        for link in reversed(chain):
            mesh = self._decode(link, mesh)
        if chain:
            mesh = _read_only(mesh)
            self._last = (chunk.number, mesh)
        return mesh

    def _decode(self, chunk: Chunk, before: Mesh) -> Mesh:
        payload = self.reader.read_chunk(chunk.number)
        try:
            if chunk.form == Form.PATCH:
                return decode_change(payload, before, self._place)
            return decode_background(payload, self._place)
        except FormatError as error:
            raise FormatError(f"{chunk}: {error}") from error


def placement(reader: ReelReader) -> Placement:
    """What undoes the encoder's normalisation."""
    return Placement(reader.header.scale, reader.header.origin)


def moving_of_frame(tracks: Sequence[Track], frame: int) -> list[Mesh]:
    """A frame of each track. FormatError where their groups take more memory than one group may."""
    meshes: list[Mesh] = []
    together = 0
    for track in tracks:
        mesh, nbytes = track.look(frame)
        together += nbytes
        if meshes and together > MOST_TOGETHER:
            raise FormatError(
                f"frame {frame}: its groups of tracks 0 to {track.number} take {together} bytes, over {MOST_TOGETHER}"
            )
        meshes.append(mesh)
    return meshes


def _nbytes(meshes: Sequence[Mesh]) -> int:
    """Memory of meshes that may be parts of the same arrays, bytes."""
    arrays = [array for mesh in meshes for array in (mesh.vertices, mesh.faces)]
    owners = [array.base if isinstance(array.base, np.ndarray) else array for array in arrays]
    return sum({id(owner): owner.nbytes for owner in owners}.values())


def _read_only(mesh: Mesh) -> Mesh:
    """The mesh, not to be written to: it is kept and given again, and shares its faces with other frames and groups."""
    vertices, faces = mesh.vertices.view(), mesh.faces.view()
    vertices.flags.writeable = faces.flags.writeable = False
    return Mesh(vertices, faces)
