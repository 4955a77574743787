"""Procedural colours, sRGB in 0 to 255, that stay with the material of a person's parts and of a room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from .figure import Pose, figure, turn_about_y
from .implicit import Body, Chain

Points = Float64[np.ndarray, "N 3"]
Colors = Float64[np.ndarray, "N 3"]

# The chains of `figure.figure`: torso, head, and for each side a leg and an arm.
TORSO, HEAD, LEGS, ARMS = 0, 1, (2, 4), (3, 5)
SKULL, THIGH_AND_SHIN, UPPER_ARM = 1, 3, 1  # rows of a chain: the skull; those before the foot; those before the elbow
GRAIN = 0.003  # m, of cloth and skin (guess)
FAR = 0.1  # m: no place on a person is farther from its nearest part (guess)


@dataclass(frozen=True, slots=True)
class Outfit:
    """Colours of a person, sRGB."""

    shirt: tuple[int, int, int]
    stripe: tuple[int, int, int]
    trousers: tuple[int, int, int]
    skin: tuple[int, int, int] = (205, 160, 130)
    hair: tuple[int, int, int] = (60, 42, 30)
    shoes: tuple[int, int, int] = (90, 25, 30)
    width: float = 0.032  # m, of a stripe


WALKER = Outfit((212, 208, 190), (40, 70, 120), (48, 52, 66))
CHILD = Outfit((190, 60, 50), (235, 200, 90), (60, 90, 60), hair=(120, 80, 40), width=0.02)


def person_colors(pose: Pose, thinnest: float, outfit: Outfit, points: Points) -> Colors:
    """Return the colours of places on a person in a pose, whose parts are those of `figure`."""
    own = (points - pose.place) @ turn_about_y(pose.heading) / pose.size
    chain, row, local = _local(figure(pose, thinnest), pose, own)
    trunk = (chain == TORSO) | (chain == HEAD)
    local[trunk] = own[trunk][:, [1, 0, 2]]  # these do not bend: their height is along them
    colors = np.empty((len(points), 3))
    colors[:] = outfit.skin
    in_stripe = np.floor(local[:, 0] / outfit.width) % 2 == 0
    shirt = (chain == TORSO) | (np.isin(chain, ARMS) & (row < UPPER_ARM))
    colors[shirt] = np.where(in_stripe[shirt, None], outfit.stripe, outfit.shirt)
    legs = np.isin(chain, LEGS)
    colors[legs] = np.where((row < THIGH_AND_SHIN)[legs, None], outfit.trousers, outfit.shoes)
    hair = (chain == HEAD) & (row == SKULL) & ((own[:, 1] > 1.7) | ((own[:, 2] < 0.0) & (own[:, 1] > 1.58)))
    colors[hair] = outfit.hair
    return np.clip(colors * (1 + 0.12 * noise(local, GRAIN)[:, None]), 0, 255)


def room_colors(points: Points) -> Colors:
    """Return the colours of places in a room: planks on the floor, paper on the walls, wood above the floor."""
    colors = np.empty((len(points), 3))
    x, y, z = points.T
    colors[:] = (150, 110, 75)
    floor = y < 0.01
    shade = 1 + 0.12 * np.sin(12.9898 * np.floor(x / 0.12))  # of planks
    colors[floor] = np.array([172, 136, 96]) * shade[floor, None]
    wall = (z <= points[:, 2].min(initial=0.0) + 0.01) | (x <= points[:, 0].min(initial=0.0) + 0.01)
    wall &= ~floor
    stripes = np.where(np.floor((x + z) / 0.08) % 2 == 0, 222.0, 205.0)
    colors[wall] = np.stack([stripes, stripes - 6, stripes - 22], axis=1)[wall]
    return np.clip(colors * (1 + 0.06 * noise(points, 0.02)[:, None]), 0, 255)


def _local(body: Body, pose: Pose, points: Points) -> tuple[Int64[np.ndarray, " N"], Int64[np.ndarray, " N"], Points]:
    """Return chain and row of each place's part, and the place along and across its axis, m, in the person's frame."""
    turn = turn_about_y(pose.heading)
    order, nearest = np.argsort(points[:, 1], kind="stable"), np.full(len(points), np.inf)
    heights = points[order, 1]
    chains, rows = np.zeros(len(points), np.int64), np.zeros(len(points), np.int64)
    local = np.zeros((len(points), 3))
    for number, there in enumerate(body):
        starts, ends = ((places - pose.place) @ turn / pose.size for places in (there.starts, there.ends))
        chain = Chain(starts, ends, there.radii / pose.size, there.blend, there.join)
        for row in range(len(chain.starts)):
            height, reach = (chain.starts[row, 1], chain.ends[row, 1]), chain.radii[row].max() + FAR
            some = order[slice(*np.searchsorted(heights, (min(height) - reach, max(height) + reach)))]
            along, gap, place = _on(chain, row, points[some])
            better = gap < nearest[some]
            some = some[better]
            nearest[some], chains[some], rows[some] = gap[better], number, row
            local[some] = np.column_stack([along, place])[better]
    return chains, rows, local


def _on(
    chain: Chain, row: int, points: Points
) -> tuple[Float64[np.ndarray, " N"], Float64[np.ndarray, " N"], Float64[np.ndarray, "N 2"]]:
    """Return places along the axis of a part, distances from its surface, and places across its axis, all m."""
    start, end, (first, last) = chain.starts[row], chain.ends[row], chain.radii[row]
    axis = end - start
    length = float(np.linalg.norm(axis))
    way = axis / length if length > 1e-9 else np.array([0.0, 1.0, 0.0])
    side = np.cross(way, [0.0, 0.0, 1.0] if abs(way[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    apart = points - start
    along = apart @ way
    share = np.clip(along / length, 0, 1) if length > 1e-9 else np.zeros(len(points))
    gap = np.linalg.norm(apart - share[:, None] * axis, axis=1) - (first + share * (last - first))
    return along, gap, np.column_stack([apart @ side, apart @ np.cross(way, side)])


def noise(places: Points, size: float) -> Float64[np.ndarray, " N"]:
    """Return noise in -1 to 1 that changes every `size` and, half as strong, every third of it (m)."""
    return (_cells(places, size) + 0.5 * _cells(places, size / 3)) / 1.5


def _cells(places: Points, size: float) -> Float64[np.ndarray, " N"]:
    """Return a number in -1 to 1 for the cell of each place in a lattice: hashed by the primes of Teschner (2003)."""
    x, y, z = np.floor(places / size).astype(np.int64).astype(np.uint64).T
    mixed = (x * np.uint64(73856093)) ^ (y * np.uint64(19349663)) ^ (z * np.uint64(83492791))
    mixed ^= mixed >> np.uint64(13)
    return (mixed * np.uint64(0x9E3779B97F4A7C15) >> np.uint64(40)).astype(np.float64) / 2**23 - 1
