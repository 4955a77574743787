"""Caches of tracks: the last group that each decoded, and the states from which the next groups of its chain continue.

In: decoded meshes and states, and refused chunks. Out: the same, within a bound on memory. Values are replaced and
never changed, except for the refusals, which only grow; so threads can share a track without a lock.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from .. import _core
from ..container.reader import Chunk
from ..errors import FormatError
from ..format.budget import LIMITS, together
from ..types import Mesh

# Bytes of states that all tracks of a video keep (guess): a few bytes of a file can describe groups that each take as
# much memory as a group may.
MOST_KEPT = 1 << 25
MOST_TOGETHER = 8 * LIMITS.numbers  # bytes: the groups of one frame take no more memory than the largest legal group


@dataclass(frozen=True, slots=True)
class CachedGroup:
    """Last group that a track decoded."""

    number: int  # of its chunk
    frames: list[Mesh]
    nbytes: int  # memory of all frames
    size: int  # bytes of its chunk
    core: _core.Group
    states: CachedStates  # of its chain


class CachedGroups:
    """The groups and states that all tracks of a file keep: no more memory than the groups of one frame may take.

    A file of some kilobytes may have a hundred tracks, each with a group or a state of tens of megabytes.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.by_track = dict[int, CachedGroup]()  # the newest last; replaced as a whole
        self.memory = dict[int, int]()  # of all groups that were decoded, bytes, by the number of their chunk

    def keep(self, track: int, group: CachedGroup) -> None:
        """Keep a group in place of the track's last one, and drop the oldest ones that are then too much."""
        with self._lock:
            self.memory[group.number] = group.nbytes
            kept = {number: known for number, known in self.by_track.items() if number != track} | {track: group}
            while len(kept) > 1:
                taken = sum(one.nbytes + one.states.nbytes for one in kept.values())
                if taken <= most_together(sum(one.size for one in kept.values())):
                    break
                del kept[next(iter(kept))]
            self.by_track = kept


def most_together(size: int) -> int:
    """Return the memory that groups may take together whose chunks have `size` bytes."""
    return min(together(size), MOST_TOGETHER)


@dataclass(frozen=True, slots=True)
class CachedStates:
    """States of the groups of one chain, by chunk number; all are kept while they fit, for playing backwards."""

    known: dict[int, _core.GroupState | None]
    nbytes: int = 0

    def add(
        self, number: int, state: _core.GroupState | None, before: _core.GroupState | None, most: int
    ) -> CachedStates:
        """Return the cache with the state of a group, which was decoded from the state `before`.

        If all states would take more than `most` bytes, only the new one is kept.
        """
        if number in self.known:
            return self
        size = 0 if state is None else state.nbytes_beyond(before)
        if self.nbytes + size > most:
            return CachedStates({number: state}, 0 if state is None else state.nbytes_beyond(None))
        self.known[number] = state
        return CachedStates(self.known, self.nbytes + size)


class Refusals:
    """Chunks that are damaged although their checksums match, remembered so that they are decoded only once.

    Chunks that could not be read are not remembered: a file may grow, and a network may come back. A refusal takes some
    hundred bytes, and each chunk has at least 14 bytes of its file.
    """

    def __init__(self) -> None:
        self._messages: dict[int, str] = {}  # by chunk; chunks that need a refused chunk have its message

    @contextmanager
    def of(self, chunk: Chunk) -> Iterator[None]:
        """Remember a FormatError of decoding a chunk, and raise it with the name of the chunk."""
        try:
            yield
        except FormatError as error:
            message = self._messages[chunk.number] = f"{chunk}: {error}"
            raise FormatError(message) from error

    def check(self, chunk: Chunk, dependents: Sequence[Chunk] = ()) -> None:
        """Raise the FormatError of a refused chunk again, and remember it for the `dependents` of this chunk."""
        message = self._messages.get(chunk.number)
        if message is None:
            return
        for dependent in dependents:
            self._messages[dependent.number] = message
        raise FormatError(message)
