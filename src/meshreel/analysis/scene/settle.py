"""Find lasting changes of the room, as a chair that is carried away or put down (paper, section 3.2; decision 18).

In: the counts of what was observed at each place, and the moving places. Out: the frames from which on, or until which,
surface at a moving place belongs to the room.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int32, Int64
from scipy.spatial import cKDTree

from .cut import connected
from .places import Places, Stay

NEVER = np.iinfo(np.int32).max  # frame number that means "at no time"
_FEWEST = 3  # smallest number of inspected frames with surface in a time of rest: a guess
_ALIKE = 1  # largest difference, in inspected frames, between neighbours that change together: a guess


Holds = Callable[[Int64[np.ndarray, " C"], list[int]], bool]


@dataclass(frozen=True, slots=True)
class SettleOptions:
    """Conditions for a change of the room (decision 18)."""

    rest: float = 10.0  # s of uninterrupted rest before or after the change: people do not stand still for as long
    still: float = 0.8  # s of the same where surface does not move by more than noise, as a crate's (decision 28)
    share: float = 0.8  # smallest share of the inspected frames in that time that have surface at the place
    least: float = 0.15  # m^2, smallest area that changes together


@dataclass(frozen=True, slots=True)
class Rest:
    """Frames in which surface at each place belongs to the room: those before `until`, and those from `since` on."""

    until: Int32[np.ndarray, " P"]  # 0: no frame at the beginning
    since: Int32[np.ndarray, " P"]  # NEVER: no frame at the end

    @staticmethod
    def none(count: int) -> Rest:
        """Return the value for `count` places at which the room never changes."""
        return Rest(np.zeros(count, np.int32), np.full(count, NEVER, np.int32))

    @property
    def changes(self) -> list[int]:
        """Numbers of the first frames after each change of the room, ascending."""
        return sorted(set(self.until[self.until > 0].tolist()) | set(self.since[self.since < NEVER].tolist()))


def find_rest(
    places: Places,
    moving: Bool[np.ndarray, " P"],
    numbers: Sequence[int],
    frame_rate: float,
    options: SettleOptions = SettleOptions(),
    holds: Holds = lambda _places, _numbers: False,
) -> Rest:
    """Find when moving places rest; `numbers` are the numbers of the inspected frames.

    `holds` tells whether the surface at some places is where it was in all of some frames: nobody stands so still.
    """
    rest = Rest.none(len(places.keys))
    frames = np.asarray(numbers, np.int32)
    late = _settled(places.tally.after, frames, frame_rate, options)
    early = _settled(places.tally.before, -frames[::-1], frame_rate, options)
    least = round(options.least / places.lattice.size**2)
    for at, order, out, sign in ((late, frames, rest.since, 1), (early, frames[::-1], rest.until, -1)):
        for group in _together(places, moving & (at >= 0), at, least):
            # When the last of these places has come to rest; what slows down is in its last place before it stands.
            last = min(int(at[group].max()) + 1, len(order) - 1)
            if abs(int(order[-1] - order[last])) >= options.rest * frame_rate or holds(group, order[last:].tolist()):
                out[group] = order[last] if sign > 0 else order[last] + 1
    return _with_unknown(places, moving, rest)


def _with_unknown(places: Places, moving: Bool[np.ndarray, " P"], rest: Rest) -> Rest:
    """Give moving places that are never seen free, as under a chair's legs, the rest of the nearest one that is."""
    free = places.tally.free > 0
    known, unknown = np.flatnonzero(moving & free), np.flatnonzero(moving & ~free)
    if not rest.changes or not len(unknown):
        return rest
    nearest = known[cKDTree(places.middles[known]).query(places.middles[unknown])[1]]
    until, since = rest.until.copy(), rest.since.copy()
    until[unknown], since[unknown] = until[nearest], since[nearest]
    return Rest(until, since)


def _settled(
    stay: Stay, frames: Int32[np.ndarray, " T"], frame_rate: float, options: SettleOptions
) -> Int64[np.ndarray, " P"]:
    """Return the index of the first inspected frame of each place's rest; -1 if its stay is too short or too patchy."""
    share = stay.count / (len(frames) - stay.first)
    long = frames[-1] - frames[stay.first] >= min(options.rest, options.still) * frame_rate
    full = (share >= options.share) & (stay.count >= _FEWEST)
    return np.where((stay.first >= 0) & long & full, stay.first, -1).astype(np.int64)


def _together(
    places: Places, chosen: Bool[np.ndarray, " P"], at: Int64[np.ndarray, " P"], least: int
) -> list[Int64[np.ndarray, " C"]]:
    """Return the sets of at least `least` connected places that change at about the same time."""
    own = np.flatnonzero(chosen)
    label = connected(places, own, lambda a, b: np.abs(at[own[a]] - at[own[b]]) <= _ALIKE)
    size = np.bincount(label, minlength=1)
    return [own[label == number] for number in np.flatnonzero(size >= max(least, 1))]
