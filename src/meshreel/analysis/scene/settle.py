"""Find lasting changes of the room, such as a chair carried away or put down (paper, section 3.2; decision 18).

In: the counts of observations at each place, and the moving places. Out: the frames from which, or until which, surface
at a moving place belongs to the room.
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
NEAR_CHANGE = 0.1  # m, largest step from a change to a place that may be part of it: a guess
_SMALLEST = 10  # places: smaller sets stay as they are, for speed: a guess
_STILL = 1.5  # times the noise: surface that is farther off from one frame to another has moved (decision 28)
_STILL_BESIDE = 2.0  # the same beside a change, where cameras often see at grazing angles: a guess
_ALIKE = 1  # largest difference, in inspected frames, between neighbours that change together: a guess


Holds = Callable[[Sequence[Int64[np.ndarray, " C"]], list[int], float], Sequence[bool]]
_REST = 10.0  # s of uninterrupted rest before or after the change: people do not stand still for as long (decision 18)
_SHORT_REST = 0.8  # s of rest that suffice for surface that moves no more than noise, as a crate's (decision 28)
_SHARE = 0.8  # smallest share of the inspected frames in that time that have surface at the place (decision 18)
_LEAST = 0.15  # m^2, smallest area that changes together (decision 18)


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
    holds: Holds = lambda groups, _numbers, _times: [False] * len(groups),
) -> Rest:
    """Find the frames in which moving places rest; `numbers` are those of the inspected frames.

    `holds(sets of places, frame numbers, factor)` returns for each set whether surface there stays in place in these
    frames, up to `factor` times the noise: nobody stands so still.
    """
    rest = Rest.none(len(places.keys))
    frames, tally = np.asarray(numbers, np.int32), places.tally
    least = round(_LEAST / places.lattice.size**2)
    for stay, order, out, never in (
        (tally.after, frames, rest.since, NEVER),
        (tally.before, frames[::-1], rest.until, 0),
    ):
        at = _settled(stay, len(order), _SHARE)
        lasts = abs(order[-1] - order[at]) >= min(_REST, _SHORT_REST) * frame_rate
        for group in _together(places, moving & (at >= 0) & lasts, at, least):
            # Rest begins with the last place to come to rest: a slowing object reaches its last place before it stands.
            last = min(int(at[group].max()) + 1, len(order) - 1)
            long = abs(int(order[-1] - order[last])) >= _REST * frame_rate
            if long or holds([group], order[last:].tolist(), _STILL)[0]:
                out[group] = order[last] if never else order[last] + 1
        _join(places, moving & (stay.first >= 0) & (stay.count >= _FEWEST), order, out, never, holds)
    return _with_unknown(places, moving, rest)


def _join(
    places: Places,
    resting: Bool[np.ndarray, " P"],
    order: Int32[np.ndarray, " T"],
    out: Int32[np.ndarray, " P"],
    never: int,
    holds: Holds,
) -> None:
    """Let places that rest beside a changed part of the room change with it, however few and seldom seen.

    A person who pushes a crate hides a side of it; a single camera sees the edge of an open door at times.
    """
    waiting = resting & (out == never)
    while (out != never).any():
        changed, beside = np.flatnonzero(out != never), np.flatnonzero(waiting)
        gaps, nearest = cKDTree(places.middles[changed]).query(places.middles[beside], distance_upper_bound=NEAR_CHANGE)
        beside, times = beside[gaps < np.inf], out[changed[nearest[gaps < np.inf]]]
        if not len(beside):
            return
        waiting[beside] = False
        for time in np.unique(times):
            reached = np.zeros_like(waiting)
            reached[beside[times == time]] = True
            groups = _together(places, reached, np.zeros(len(reached), np.int64), _SMALLEST)
            after = order[order >= time] if never else order[order < time]
            for group, stands in zip(groups, holds(groups, after.tolist(), _STILL_BESIDE), strict=True):
                out[group] = time if stands else never


def _with_unknown(places: Places, moving: Bool[np.ndarray, " P"], rest: Rest) -> Rest:
    """Give moving places never seen free, as under a chair's legs, the rest of the nearest place that is seen free."""
    free = places.tally.free > 0
    seen_free, never_free = np.flatnonzero(moving & free), np.flatnonzero(moving & ~free)
    if not rest.changes or not len(never_free):
        return rest
    nearest = seen_free[cKDTree(places.middles[seen_free]).query(places.middles[never_free])[1]]
    until, since = rest.until.copy(), rest.since.copy()
    until[never_free], since[never_free] = until[nearest], since[nearest]
    return Rest(until, since)


def _settled(stay: Stay, frames: int, least: float) -> Int64[np.ndarray, " P"]:
    """Return the index of the first inspected frame of each place's rest; -1 if too few have surface there."""
    full = (stay.count >= least * (frames - stay.first)) & (stay.count >= _FEWEST)
    return np.where((stay.first >= 0) & full, stay.first, -1).astype(np.int64)


def _together(
    places: Places, chosen: Bool[np.ndarray, " P"], at: Int64[np.ndarray, " P"], least: int
) -> list[Int64[np.ndarray, " C"]]:
    """Return the sets of at least `least` connected places that change at about the same time."""
    numbers = np.flatnonzero(chosen)
    label = connected(places, numbers, lambda a, b: np.abs(at[numbers[a]] - at[numbers[b]]) <= _ALIKE)
    size = np.bincount(label, minlength=1)
    return [numbers[label == number] for number in np.flatnonzero(size >= max(least, 1))]
