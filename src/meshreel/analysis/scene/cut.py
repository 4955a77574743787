"""Separate moving places from resting ones by a minimum cut (docs/decisions/0018-places.md).

In: the counts of observations at each place. Out: the moving places. A place that is sometimes seen free is left or
entered by something that moves. A place that is never seen free may be part of it, too (the trunk of a standing
person), so the border runs where it is short and where surfaces meet at a concave edge: under a foot, not through a
leg. A body that leaves all its places has no part that never moves, so growth from such places is expensive.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow
from scipy.spatial import cKDTree

from ...geometry.strict import exp
from ...geometry.topology import linked
from .places import Places

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


def moving_places(places: Places) -> Bool[np.ndarray, " P"]:
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
    always, around = _STILL
    rests = always + around * _around(middles[near], middles[seeds], share[seeds])
    first, second = _links(places, near)
    turn = _hollow(middles[near], places.normals[near], first, second)
    links = exp(-_HOLLOW * turn)
    moving[near] = _cut(moves, rests, np.stack([first, second]), links)
    moving &= ~_continued(places, moving)
    moving |= _left_together(places, moving)
    return _large(places, moving, round(_LEAST / places.lattice.size**2))


def _continued(places: Places, moving: Bool[np.ndarray, " P"]) -> Bool[np.ndarray, " P"]:
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


def _left_together(places: Places, moving: Bool[np.ndarray, " P"]) -> Bool[np.ndarray, " P"]:
    """Return the places never seen free whose surface vanished together with moving surface in one plane.

    An open door may hide places where a part of it was.
    """
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


def _large(places: Places, chosen: Bool[np.ndarray, " P"], fewest: int) -> Bool[np.ndarray, " P"]:
    """Return the chosen places whose connected component has at least `fewest` places."""
    numbers = np.flatnonzero(chosen)
    label = connected(places, numbers)
    large = np.zeros(len(chosen), bool)
    large[numbers] = np.bincount(label)[label] >= fewest if len(numbers) else False
    return large


def _links(places: Places, chosen: Int64[np.ndarray, " C"]) -> tuple[Int64[np.ndarray, " L"], Int64[np.ndarray, " L"]]:
    """Return the pairs of neighbours among the chosen places, each once, as indices into `chosen`."""
    number = np.full(len(places.keys), -1)
    number[chosen] = np.arange(len(chosen))
    first = np.repeat(np.arange(len(chosen)), places.beside.shape[1])
    second = number[places.beside[chosen]].reshape(-1)
    once = second > first
    return first[once], second[once]


def _around(
    points: Float64[np.ndarray, "N 3"], seeds: Float64[np.ndarray, "M 3"], share: Float64[np.ndarray, " M"]
) -> Float64[np.ndarray, " N"]:
    """Return the mean share of the seeds nearest to each point."""
    thin = slice(None, None, max(1, len(seeds) // 20_000))
    count = min(_AROUND, len(seeds[thin]))
    nearest = cKDTree(seeds[thin]).query(points, k=np.arange(1, count + 1))[1]
    return share[thin][nearest].mean(axis=1)


def _hollow(
    middles: Float64[np.ndarray, "C 3"],
    normals: Float64[np.ndarray, "C 3"],
    first: Int64[np.ndarray, " L"],
    second: Int64[np.ndarray, " L"],
) -> Float64[np.ndarray, " L"]:
    """Return the turn of two neighbours' normals towards each other, 0 to 2; 0 where the surface is convex."""
    directions = middles[second] - middles[first]
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return np.maximum(((normals[first] - normals[second]) * directions).sum(axis=1), 0.0)


def _cut(
    moves: Float64[np.ndarray, " C"],
    rests: Float64[np.ndarray, " C"],
    links: Int64[np.ndarray, "2 L"],
    weights: Float64[np.ndarray, " L"],
) -> Bool[np.ndarray, " C"]:
    """Return the source's side of a minimum cut.

    `moves` and `rests` are the capacities between each place and the source or the sink; `weights` those of links.
    """
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
