"""Moving places, by a minimum cut, and lasting changes of the room (paper, section 3.2; docs/decisions/0018-places.md).

In: the counts of observations at each place. Out: the moving places, and the frames from which, or until which, surface
at one belongs to the room, as a chair put down. A place that is sometimes seen free is left or entered by something
that moves. A place that is never seen free may be part of it, too (the trunk of a standing person), so the border runs
where it is short and where surfaces meet at a concave edge: under a foot, not through a leg. A body that leaves all its
places has no part that never moves, so growth from such places is expensive.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow
from scipy.spatial import cKDTree

from ...geometry.strict import exp
from ...geometry.topology import linked
from .places import Mask, Places

Ends = Int64[np.ndarray, " L"]  # of links, as indices into the chosen places
Costs = Float64[np.ndarray, " C"]  # of the chosen places
Weights = Float64[np.ndarray, " L"]  # of links
_UNIT = 20  # integer capacity of a link of weight 1: a guess
_EDGE = 5  # cells by which the cut may miss an edge: a guess
_MOSTLY = 0.5  # share of the frames in which a place that continues a plane must have surface: a guess
_OFF = 0.5  # cells, largest distance of a place from the plane that it belongs to: a guess
_FULL = 0.8  # share of the frames until it vanished in which a place had surface: a guess
_ALIKE = 0.95  # least cosine between the normals of places of a plane: a guess
_FLAT = 0.99  # the same where a plane is continued: neighbours on a ball at rest have .97
_AROUND = 64  # nearest places seen free whose mean share describes a neighbourhood: a guess
_SHARE = 0.03  # smallest share of frames in which a place must be seen free to be evidence of motion (decision 18)
_EVIDENCE = 30.0  # links: cost of calling a place still that is always seen free (decision 18)
_STILL = (0.2, 0.3)  # cost of calling a place moving: constant, and times the shares around it (decision 18)
_HOLLOW = 6.0  # rate at which a link weakens as the normals at its ends turn towards each other (decision 18)
_REACH = 0.8  # m: moving places lie no farther than this from places that are seen free (decision 18)
_FEWEST = 60  # smaller connected sets of places that are seen free are noise (decision 18)
_LEAST = 0.32  # m^2: connected moving places that cover less area over time are flicker (decision 18)
NEVER = np.iinfo(np.int32).max  # frame number that means "at no time"
_FEWEST_FRAMES = 3  # smallest number of inspected frames with surface in a time of rest: a guess
NEAR_CHANGE = 0.1  # m, largest step from a change to a place that may be part of it: a guess
_SMALLEST = 10  # places: smaller sets stay as they are, for speed: a guess
_STANDS = 1.5  # times the noise: surface that is farther off from one frame to another has moved (decision 28)
_PART = 0.25  # m, of the parts of a thing of which each stands: noise evens out over them (decision 28)
_STILL_BESIDE = 2.0  # the same beside a change, where cameras often see at grazing angles: a guess
_SAME_TIME = 1  # largest difference, in inspected frames, between neighbours that change together: a guess
FrameNumbers = Int32[np.ndarray, " P"]  # frame numbers
Holds = Callable[[Sequence[Int64[np.ndarray, " C"]], list[int], float, float], Sequence[bool]]
_REST = 10.0  # s of uninterrupted rest before or after the change: people do not stand still for as long (decision 18)
_SHORT_REST = 0.8  # s of rest that suffice for surface that moves no more than noise, as a crate's (decision 28)
_MOSTLY_THERE = 0.8  # smallest share of the inspected frames in that time that have surface at the place (decision 18)
_LEAST_CHANGE = 0.15  # m^2, smallest area that changes together (decision 18)


def moving_places(places: Places) -> Mask:
    """Return True for each place whose surface belongs to something that moves."""
    share = places.free_share
    seeds = _large(places, share >= _SHARE, _FEWEST)
    moving = np.zeros(len(places.keys), bool)
    if not seeds.any():
        return moving
    middles = places.middles
    bound = np.nextafter(_REACH, np.inf)  # makes the search ten times as fast
    gaps = cKDTree(middles[seeds]).query(middles, distance_upper_bound=bound)[0]
    near = np.flatnonzero(gaps <= _REACH)
    moves = np.where(share >= _SHARE / 2, _EVIDENCE * share, 0.0)[near]
    thin = max(1, np.count_nonzero(seeds) // 20_000)
    seen_free, shares = middles[seeds][::thin], share[seeds][::thin]
    nearest = cKDTree(seen_free).query(middles[near], k=np.arange(1, min(_AROUND, len(seen_free)) + 1))[1]
    always, around = _STILL
    rests = always + around * shares[nearest].mean(axis=1)
    first, second = _links(places, near)
    turn = _hollow(middles[near], places.normals[near], first, second)
    links = exp(-_HOLLOW * turn)
    moving[near] = _cut(moves, rests, np.stack([first, second]), links)
    moving &= ~_continued(places, moving)
    moving |= _left_together(places, moving)
    return _large(places, moving, round(_LEAST / places.lattice.size**2))


def _continued(places: Places, moving: Mask) -> Mask:
    """Return the moving places that continue a still plane, such as a wall beside a hinge.

    They are mostly occupied and never seen free. The normal of a place is the mean of all surface there, so the cut may
    miss an edge by a few cells.
    """
    tally, continued = places.tally, np.zeros(len(moving), bool)
    never = moving & (tally.free == 0) & (tally.occupied >= _MOSTLY * tally.frames)
    for _ in range(_EDGE):
        own = np.flatnonzero(never & ~continued)
        beside = places.beside[own]
        continued[own] = (_level(places, own[:, None], beside, _FLAT) & (~moving | continued)[beside]).any(axis=1)
    return continued


def _left_together(places: Places, moving: Mask) -> Mask:
    """Return places never seen free whose surface vanished with moving surface in one plane, as behind an open door."""
    tally = places.tally
    last, count = tally.early.first, tally.early.count
    gone = (last >= 0) & (last < tally.frames - 1) & (count >= _FULL * (last + 1))
    left, hidden = gone & moving & (tally.free > 0), gone & ~moving & (tally.free == 0)
    both = np.flatnonzero(left | hidden)

    def alike(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (last[both[a]] == last[both[b]]) & _level(places, both[a], both[b])

    label = connected(places, both, alike)
    together = np.zeros(len(moving), bool)
    together[both] = hidden[both] & (np.bincount(label, left[both], len(both)) > 0)[label]
    return together


def _level(places: Places, first: np.ndarray, second: np.ndarray, cosine: float = _ALIKE) -> np.ndarray:
    """Return a mask of the pairs of places that lie in one plane."""
    offsets = (places.middles[second] - places.middles[first]) * places.normals[second]
    parallel = (places.normals[second] * places.normals[first]).sum(axis=-1) >= cosine
    return parallel & (np.abs(offsets.sum(axis=-1)) <= _OFF * places.lattice.size)


def connected(
    places: Places, chosen: Int64[np.ndarray, " C"], alike: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None
) -> Int64[np.ndarray, " C"]:
    """Label the connected components among the chosen places; C labels from 0 on.

    `alike` receives the ends of all links, as indices into `chosen`, and returns which links connect; all by default.
    """
    first, second = _links(places, chosen)
    if alike is not None:
        joined = alike(first, second)
        first, second = first[joined], second[joined]
    return linked(np.stack([first, second], axis=1), len(chosen))


def _large(places: Places, chosen: Mask, fewest: int) -> Mask:
    """Return the chosen places whose connected component has at least `fewest` places."""
    numbers = np.flatnonzero(chosen)
    label = connected(places, numbers)
    large = np.zeros(len(chosen), bool)
    large[numbers] = np.bincount(label)[label] >= fewest if len(numbers) else False
    return large


def _links(places: Places, chosen: Int64[np.ndarray, " C"]) -> tuple[Ends, Ends]:
    """Return the pairs of neighbours among the chosen places, each once, as indices into `chosen`."""
    number = np.full(len(places.keys), -1)
    number[chosen] = np.arange(len(chosen))
    first = np.repeat(np.arange(len(chosen)), places.beside.shape[1])
    second = number[places.beside[chosen]].reshape(-1)
    once = second > first
    return first[once], second[once]


def _hollow(
    middles: Float64[np.ndarray, "C 3"], normals: Float64[np.ndarray, "C 3"], first: Ends, second: Ends
) -> Weights:
    """Return the turn of two neighbours' normals towards each other, 0 to 2; 0 where the surface is convex."""
    directions = middles[second] - middles[first]
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return np.maximum(((normals[first] - normals[second]) * directions).sum(axis=1), 0.0)


def _cut(moves: Costs, rests: Costs, links: Int64[np.ndarray, "2 L"], weights: Weights) -> Bool[np.ndarray, " C"]:
    """Return the source's side of a minimum cut; `moves` and `rests` are capacities to the source and to the sink."""
    count = len(moves)
    source, sink, nodes = count, count + 1, np.arange(count)
    common = np.minimum(moves, rests)  # this flow passes in any case, so it is left out
    to, back = (_whole(side - common) for side in (moves, rests))
    link = np.maximum(_whole(weights), 1)
    rows = np.concatenate([links[0], links[1], np.full(count, source), nodes])
    columns = np.concatenate([links[1], links[0], nodes, np.full(count, sink)])
    capacity = np.concatenate([link, link, to, back])
    used = capacity > 0
    graph = csr_array((capacity[used], (rows[used], columns[used])), shape=(count + 2, count + 2))
    residual = graph - maximum_flow(graph, source, sink).flow
    residual.data = np.maximum(residual.data, 0)
    residual.eliminate_zeros()
    reached = np.zeros(count + 2, bool)
    reached[breadth_first_order(residual, source, return_predecessors=False)] = True
    return reached[:count]


def _whole(values: Float64[np.ndarray, " N"]) -> Int32[np.ndarray, " N"]:
    return np.rint(_UNIT * values).astype(np.int32)


@dataclass(frozen=True, slots=True)
class Rest:
    """Frames in which surface at each place belongs to the room: those before `until`, and those from `since` on."""

    until: FrameNumbers  # 0: no frame at the beginning
    since: FrameNumbers  # NEVER: no frame at the end

    @staticmethod
    def none(count: int) -> Rest:
        """Return the value for `count` places at which the room never changes."""
        return Rest(np.zeros(count, np.int32), np.full(count, NEVER, np.int32))

    @property
    def changes(self) -> list[int]:
        """Numbers of the first frames after each change of the room, ascending."""
        return sorted(set(self.until[self.until > 0].tolist()) | set(self.since[self.since < NEVER].tolist()))


def find_rest(places: Places, moving: Mask, numbers: Sequence[int], frame_rate: float, holds: Holds) -> Rest:
    """Find the frames in which moving places rest; `numbers` are those of the inspected frames.

    `holds(sets of places, frame numbers, factor, part)` returns for each set whether surface there stays in place in
    these frames, up to `factor` times the noise, in each part of size `part` (m): nobody stands so still.
    """
    rest = Rest.none(len(places.keys))
    frames, tally = np.asarray(numbers, np.int32), places.tally
    least = round(_LEAST_CHANGE / places.lattice.size**2)
    for stay, order, out, never in (
        (tally.after, frames, rest.since, NEVER),
        (tally.before, frames[::-1], rest.until, 0),
    ):
        full = (stay.count >= _MOSTLY_THERE * (len(order) - stay.first)) & (stay.count >= _FEWEST_FRAMES)
        at = np.where((stay.first >= 0) & full, stay.first, -1).astype(np.int64)  # first frame of each place's rest
        lasts = abs(order[-1] - order[at]) >= min(_REST, _SHORT_REST) * frame_rate
        for group in _together(places, moving & (at >= 0) & lasts, at, least):
            # Rest begins with the last place to come to rest: a slowing object reaches its last place before it stands.
            last = min(int(at[group].max()) + 1, len(order) - 1)
            long = abs(int(order[-1] - order[last])) >= _REST * frame_rate
            if long or holds([group], order[last:].tolist(), _STANDS, _PART)[0]:
                out[group] = order[last] if never else order[last] + 1
        _join(places, moving & (stay.first >= 0) & (stay.count >= _FEWEST_FRAMES), order, out, never, holds)
    free = places.tally.free > 0
    seen_free, never_free = np.flatnonzero(moving & free), np.flatnonzero(moving & ~free)
    if rest.changes and len(never_free):  # as under a chair's legs
        nearest = seen_free[cKDTree(places.middles[seen_free]).query(places.middles[never_free])[1]]
        rest.until[never_free], rest.since[never_free] = rest.until[nearest], rest.since[nearest]
    return rest


def _join(
    places: Places, resting: Mask, order: Int32[np.ndarray, " T"], out: FrameNumbers, never: int, holds: Holds
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
            for group, stands in zip(groups, holds(groups, after.tolist(), _STILL_BESIDE, math.inf), strict=True):
                out[group] = time if stands else never


def _together(places: Places, chosen: Mask, at: Int64[np.ndarray, " P"], least: int) -> list[Int64[np.ndarray, " C"]]:
    """Return the sets of at least `least` connected places that change at about the same time, inspected frame `at`."""
    numbers = np.flatnonzero(chosen)
    label = connected(places, numbers, lambda a, b: np.abs(at[numbers[a]] - at[numbers[b]]) <= _SAME_TIME)
    size = np.bincount(label, minlength=1)
    return [numbers[label == number] for number in np.flatnonzero(size >= max(least, 1))]
