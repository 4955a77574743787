"""Which places belong to what moves: a minimum cut between what is seen free and what never is.

In: what happens at each place over time. Out: the places that are not the room's. A place that is seen free now and
then is left or entered by something that moves; one that never is may still be part of it (the trunk of somebody who
stands), so the border between both runs where it is short and where surfaces meet at a hollow edge: under a foot, not
through a leg. What leaves its places for long has no part that never moves, so growth ends there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from ...errors import InputError
from .places import Places

_UNIT = 20  # integer capacity of a link of weight 1
_AROUND = 64  # places seen free whose share is taken for that of their neighbourhood


@dataclass(frozen=True, slots=True)
class CutOptions:
    """What a place costs on either side of the cut, in links between neighbours."""

    share: float = 0.03  # of the frames that know a place: seen free in more, it is evidence
    evidence: float = 30.0  # of a place that is always seen free
    still: tuple[float, float] = (0.2, 0.3)  # of a place that moves: always, and where the places around are all free
    hollow: float = 6.0  # how fast a link weakens with the turn of the normals towards each other
    reach: float = 0.8  # m, that what moves may go beyond what is seen free
    fewest: int = 60  # connected places seen free, or they are noise
    least: float = 0.32  # m^2 that connected moving places cover over time, or they are flicker

    def __post_init__(self) -> None:
        if not 0 < self.share < 1 or min(self.evidence, *self.still, self.hollow, self.fewest) < 0:
            raise InputError(
                f"share {self.share:g}, evidence {self.evidence:g}, still {self.still}, hollow {self.hollow:g}, "
                f"fewest {self.fewest}: give a share in (0, 1), the others from 0 on"
            )
        if not (self.reach > 0 and self.least >= 0):
            raise InputError(f"reach {self.reach:g} m, least {self.least:g} m^2: give above 0, and from 0 on")


def moving_places(places: Places, options: CutOptions = CutOptions()) -> Bool[np.ndarray, " P"]:
    """The places where what is there, whenever something is, moves."""
    share = places.free_share
    seeds = _large(places, share >= options.share, options.fewest)
    moving = np.zeros(len(places.keys), bool)
    if not seeds.any():
        return moving
    middles = places.middles
    near = np.flatnonzero(_within(middles, middles[seeds], options.reach))
    moves = np.where(share >= options.share / 2, options.evidence * share, 0.0)[near]
    always, around = options.still
    rests = always + around * _around(middles[near], middles[seeds], share[seeds])
    first, second = _links(places, near)
    turn = _hollow(middles[near], places.normals[near], first, second)
    links = np.exp(-options.hollow * turn)
    moving[near] = _cut(moves, rests, np.stack([first, second]), links)
    return _large(places, moving, round(options.least / places.lattice.size**2))


def connected(
    places: Places, chosen: Int64[np.ndarray, " C"], alike: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None
) -> Int64[np.ndarray, " C"]:
    """A number for each of some places: the same for those connected by neighbours that are alike, if that is asked."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    first, second = _links(places, chosen)
    if alike is not None:
        kept = alike(first, second)
        first, second = first[kept], second[kept]
    graph = coo_array((np.ones(len(first), bool), (first, second)), shape=(len(chosen), len(chosen)))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _large(places: Places, chosen: Bool[np.ndarray, " P"], fewest: int) -> Bool[np.ndarray, " P"]:
    """The chosen places that are connected to so many others."""
    own = np.flatnonzero(chosen)
    label = connected(places, own)
    kept = np.zeros(len(chosen), bool)
    kept[own] = np.bincount(label)[label] >= fewest if len(own) else False
    return kept


def _links(places: Places, chosen: Int64[np.ndarray, " C"]) -> tuple[Int64[np.ndarray, " L"], Int64[np.ndarray, " L"]]:
    """Neighbours among the chosen places, each pair once, by their numbers among the chosen."""
    number = np.full(len(places.keys), -1)
    number[chosen] = np.arange(len(chosen))
    first = np.repeat(np.arange(len(chosen)), places.beside.shape[1])
    second = number[places.beside[chosen]].reshape(-1)
    once = second > first
    return first[once], second[once]


def _within(
    points: Float64[np.ndarray, "N 3"], others: Float64[np.ndarray, "M 3"], reach: float
) -> Bool[np.ndarray, " N"]:
    """Which points have one of the others within reach; not looking beyond is ten times as fast."""
    from scipy.spatial import cKDTree

    return cKDTree(others).query(points, distance_upper_bound=np.nextafter(reach, np.inf))[0] <= reach


def _around(
    points: Float64[np.ndarray, "N 3"], seeds: Float64[np.ndarray, "M 3"], share: Float64[np.ndarray, " M"]
) -> Float64[np.ndarray, " N"]:
    """The mean share of the seeds nearest to each point."""
    from scipy.spatial import cKDTree

    thin = slice(None, None, max(1, len(seeds) // 20_000))
    count = min(_AROUND, len(seeds[thin]))
    found = cKDTree(seeds[thin]).query(points, k=np.arange(1, count + 1))[1]
    return share[thin][found].mean(axis=1)


def _hollow(
    middles: Float64[np.ndarray, "C 3"],
    normals: Float64[np.ndarray, "C 3"],
    first: Int64[np.ndarray, " L"],
    second: Int64[np.ndarray, " L"],
) -> Float64[np.ndarray, " L"]:
    """How much the normals of two neighbours turn towards each other, 0 to 2; 0 where the surface bulges."""
    apart = middles[second] - middles[first]
    apart /= np.linalg.norm(apart, axis=1)[:, None]
    return np.maximum(((normals[first] - normals[second]) * apart).sum(axis=1), 0.0)


def _cut(
    moves: Float64[np.ndarray, " C"],
    rests: Float64[np.ndarray, " C"],
    links: Int64[np.ndarray, "2 L"],
    weights: Float64[np.ndarray, " L"],
) -> Bool[np.ndarray, " C"]:
    """The side of the source: places are bound to it by `moves`, to the sink by `rests`, to each other by links."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import breadth_first_order, maximum_flow

    count = len(moves)
    source, sink, own = count, count + 1, np.arange(count)
    common = np.minimum(moves, rests)  # flows through anyway
    to, back = (_whole(side - common) for side in (moves, rests))
    link = np.maximum(_whole(weights), 1)
    rows = np.concatenate([links[0], links[1], np.full(count, source), own])
    columns = np.concatenate([links[1], links[0], own, np.full(count, sink)])
    capacity = np.concatenate([link, link, to, back])
    used = capacity > 0
    graph = csr_array((capacity[used], (rows[used], columns[used])), shape=(count + 2, count + 2))
    left = graph - maximum_flow(graph, source, sink).flow
    left.data = np.maximum(left.data, 0)
    left.eliminate_zeros()
    reached = np.zeros(count + 2, bool)
    reached[breadth_first_order(left, source, return_predecessors=False)] = True
    return reached[:count]


def _whole(values: Float64[np.ndarray, " N"]) -> Int32[np.ndarray, " N"]:
    return np.rint(_UNIT * values).astype(np.int32)
