"""Cache of one track: the last group decoded, and the states from which the next groups of its chain continue.

In: decoded meshes and states, and refused chunks. Out: the same, within a bound on memory. Values are replaced and
never changed, except for the refusals, which only grow; so threads can share a track without a lock.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from .. import _core
from ..container.reader import Chunk
from ..errors import FormatError
from ..types import Mesh

# Bytes of states that all tracks of a video keep (guess): a few bytes of a file can describe groups that each take as
# much memory as a group may.
MOST_KEPT = 1 << 25


@dataclass(frozen=True, slots=True)
class CachedGroup:
    """Last group that a track decoded."""

    number: int  # of its chunk
    frames: list[Mesh]
    nbytes: int  # memory of all frames
    core: _core.Group


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
