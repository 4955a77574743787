"""Places where the room itself changes for good: a chair that was carried away, or has come to stand (section 3.2).

In: what happens at each place over time, and which places move. Out: from which frame on, or until which frame, what
is at a moving place belongs to the room after all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int32, Int64

from ...errors import InputError
from .cut import connected
from .places import Places, Stay

NEVER = np.iinfo(np.int32).max
_FEWEST = 3  # frames looked at that know a place in its time of rest
_ALIKE = 1  # frames looked at between the changes of neighbours that change together


@dataclass(frozen=True, slots=True)
class SettleOptions:
    """What counts as a change of the room."""

    rest: float = 10.0  # s that it is as it is before, or after, without a break: people do not stand so still
    share: float = 0.8  # of the frames that know a place in that time which have surface in it
    least: float = 0.15  # m^2 that change together

    def __post_init__(self) -> None:
        if not self.rest > 0 or not 0 < self.share <= 1 or not self.least >= 0:
            raise InputError(
                f"a change of the room: rest {self.rest:g} s, share {self.share:g}, least {self.least:g} m^2: "
                "give > 0, (0, 1], >= 0"
            )


@dataclass(frozen=True, slots=True)
class Rest:
    """When what is at each place belongs to the room: before the frame `until`, and from the frame `since` on."""

    until: Int32[np.ndarray, " P"]  # 0: never before
    since: Int32[np.ndarray, " P"]  # NEVER: not later either

    @staticmethod
    def none(count: int) -> Rest:
        """Of so many places whose state never changes."""
        return Rest(np.zeros(count, np.int32), np.full(count, NEVER, np.int32))

    @property
    def changes(self) -> list[int]:
        """The frames with which the room is another, rising."""
        return sorted(set(self.until[self.until > 0].tolist()) | set(self.since[self.since < NEVER].tolist()))


def find_rest(
    places: Places,
    moving: Bool[np.ndarray, " P"],
    numbers: Sequence[int],
    frame_rate: float,
    options: SettleOptions = SettleOptions(),
) -> Rest:
    """The rest of moving places; `numbers` are the frames that were looked at."""
    rest = Rest.none(len(places.keys))
    frames = np.asarray(numbers, np.int32)
    late = _settled(places.tally.after, frames, frame_rate, options)
    early = _settled(places.tally.before, -frames[::-1], frame_rate, options)
    least = round(options.least / places.lattice.size**2)
    for at, order, out, sign in ((late, frames, rest.since, 1), (early, frames[::-1], rest.until, -1)):
        for group in _together(places, moving & (at >= 0), at, least):
            last = int(at[group].max())  # of these places to come to rest
            out[group] = order[last] if sign > 0 else order[last] + 1
    return _with_unknown(places, moving, rest)


def _with_unknown(places: Places, moving: Bool[np.ndarray, " P"], rest: Rest) -> Rest:
    """Moving places that are never seen free, as where a chair meets the floor, rest as the nearest that are."""
    from scipy.spatial import cKDTree

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
    """The first of the frames looked at from which each place has surface to the end; -1 where it has not.

    Only places that are seen free before.
    """
    share = stay.count / (len(frames) - stay.first)
    long = frames[-1] - frames[stay.first] >= options.rest * frame_rate
    full = (share >= options.share) & (stay.count >= _FEWEST)
    return np.where((stay.first >= 0) & long & full, stay.first, -1).astype(np.int64)


def _together(
    places: Places, chosen: Bool[np.ndarray, " P"], at: Int64[np.ndarray, " P"], least: int
) -> list[Int64[np.ndarray, " C"]]:
    """Connected places that change at about one time, and are enough."""
    own = np.flatnonzero(chosen)
    label = connected(places, own, lambda a, b: np.abs(at[own[a]] - at[own[b]]) <= _ALIKE)
    size = np.bincount(label, minlength=1)
    return [own[label == number] for number in np.flatnonzero(size >= max(least, 1))]
