"""Decoder of TVMC* streams. In: bytes. Out: frames, decoded on access."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator

from meshreel.coding.background import decode_background, decode_change
from meshreel.coding.intra import decode_intra
from meshreel.encoder.group.interval import MOST_FRAMES
from meshreel.format.layout import Form
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh, Placement

from ..base import DecodedFrames
from .layout import Kind, is_bare, unpack_stream
from .tracked import decode_tracked


class TvmcVideo(DecodedFrames):
    """Frames of a stream; the groups and the background of the last one are kept."""

    def __init__(self, data: bytes) -> None:
        """Read all but the payloads. Raises FormatError where the stream is damaged."""
        self.stream = unpack_stream(data)
        self._place = Placement(self.stream.scale, self.stream.origin)
        self._firsts = [group.first_frame for group in self.stream.groups]
        self._decoded: dict[int, list[Mesh]] = {}  # of the groups of the last frame, by number
        self._background: tuple[int, Mesh] = (-1, Mesh.empty())  # the last state after its number

    def __len__(self) -> int:
        return self.stream.frame_count

    def frame(self, number: int) -> Mesh:
        """Return a frame in metres: the background, then the bodies."""
        return self._place.of(concatenate([*self._still(number), *self._moving(number)]))

    def _moving(self, frame: int) -> Iterator[Mesh]:
        """Return the bodies of a frame, normalised."""
        near = range(bisect_left(self._firsts, frame - MOST_FRAMES + 1), bisect_right(self._firsts, frame))
        groups = [number for number in near if frame < self._end(number)]
        self._decoded = {number: self._decoded.get(number) or self._decode(number) for number in groups}
        return (meshes[frame - self._firsts[number]] for number, meshes in self._decoded.items())

    def _end(self, number: int) -> int:
        return self._firsts[number] + self.stream.groups[number].frame_count

    def _decode(self, number: int) -> list[Mesh]:
        group = self.stream.groups[number]
        if group.kind == Kind.TRACKED:
            return decode_tracked(group.payload, self.stream.step)
        return decode_intra(group.payload)

    def _still(self, frame: int) -> Iterator[Mesh]:
        """Yield the background of a frame, normalised, if it has one."""
        states = self.stream.states
        number = bisect_right([state.first_frame for state in states], frame) - 1
        if number < 0 or is_bare(self.stream, frame):
            return
        if number != self._background[0]:
            first = number
            while states[first].payload[:1] == bytes([Form.PATCH]):
                first -= 1
            mesh = decode_background(states[first].payload)
            for state in states[first + 1 : number + 1]:
                mesh = decode_change(state.payload, mesh)
            self._background = (number, mesh)
        yield self._background[1]
