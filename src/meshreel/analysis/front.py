"""Direction that people face, by their surface: toes are ahead of ankles, faces ahead of necks, and walks lead ahead.

In: the bodies of some frames. Out: their boxes, upright (y up), and the direction from which most are seen from in
front. Votes are shares of a body's own height, so that neither units nor sensors matter.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from ..geometry.topology import components, face_means, face_normals
from ..types import UPRIGHT, Mesh, Up, evenly

Plane = Float64[np.ndarray, "2"]  # x and z
Votes = Float64[np.ndarray, "N 2"]

LOOKED_AT = 12  # frames of the whole sequence, and of its beginning (guess)
FIRST = 2.0  # s of the beginning, in which people face the place to look from (guess)
TRIMMED = 0.005  # share of the vertices beyond each side of a body's box: loose bits and noise (guess)
# Heights of parts of a standing person, as shares of the whole: drawing canons have the ankle at .05, the chin at .87.
SOLE, ANKLE, NECK, FACE = (0.0, 0.035), (0.05, 0.1), (0.82, 0.87), (0.89, 0.96)
CROWN = 0.89
ROUND_HEAD, ROUND_NECK = 0.1, 0.06  # of the height: what lies so far from a head's middle is hands or shoulders (guess)
LEAST_FOOT = 0.003  # share of the area that a sole, and an ankle, have at least (guess)
HEAD = 0.5  # weight of a head, which turns and has hair, beside a foot (guess)
WALK = 0.08  # s: a walk of .75 heights a second counts as much as two feet, which are .03 heights ahead (guess)
FASTEST = 4.0  # heights a second: a runner (guess)
LEAST = 0.015  # of the height: a shorter mean vote is no front; those of people are some .03 (guess)
AGREED = 0.3  # share of the votes' lengths that is left in their sum where people face one way (guess)
FACING = 0.8  # share of the votes along one line where people face each other (guess)


@dataclass(frozen=True, slots=True)
class Body:
    """Box of a body in a frame, upright, and its votes on where its front is."""

    low: Float64[np.ndarray, "3"]  # corner of its box, without bits
    high: Float64[np.ndarray, "3"]
    middle: Plane  # of its surface, seen from above
    votes: Votes  # ahead of each foot and of the head, in heights

    @property
    def height(self) -> float:
        return float(self.high[1] - self.low[1])


def frames_looked_at(count: int, frame_rate: float) -> list[int]:
    """Return the numbers of the frames whose bodies tell the front: some of all, and some of the beginning."""
    return sorted({*evenly(count, LOOKED_AT), *evenly(min(count, _beginning(frame_rate)), LOOKED_AT)})


def bodies_of(meshes: Iterable[Mesh], up: Up) -> list[Body]:
    """Return boxes and votes of the bodies of a frame, stood up; those without area are left out."""
    turn = np.array(UPRIGHT[up], np.float64)
    stood = (mesh.at(mesh.vertices @ turn.T) for mesh in meshes if not mesh.is_empty)
    return [_body(mesh) for mesh in stood if float(face_normals(mesh)[1].sum()) > 0]


def front_of(frames: Mapping[int, Sequence[Body]], frame_rate: float, usual: Plane) -> Plane | None:
    """Return the direction, of length 1, from the bodies to who sees them from in front; None if they do not tell it.

    The first seconds count, or all frames where these have none. Of bodies that face each other it is the side nearer
    to the `usual` direction.
    """
    shown = [number for number in sorted(frames) if frames[number]]
    early = [number for number in shown if number < _beginning(frame_rate)] or shown
    if not early:
        return None
    votes = [body.votes for number in early for body in frames[number]]
    if early[-1] > early[0]:
        way = _walked(frames[early[0]], frames[early[-1]], (early[-1] - early[0]) / frame_rate)
        votes.append(len(early) * way)
    return _elected(np.concatenate(votes), usual)


def _beginning(frame_rate: float) -> int:
    """Return the number of frames of the beginning."""
    return math.ceil(FIRST * frame_rate)


def _body(mesh: Mesh) -> Body:
    low, high = np.quantile(mesh.vertices, (TRIMMED, 1 - TRIMMED), axis=0)
    height = float(high[1] - low[1]) or 1.0
    middles, areas = face_means(mesh.vertices, mesh.faces), face_normals(mesh)[1]
    surface = _Surface((middles[:, 1] - low[1]) / height, middles[:, [0, 2]] / height, areas)
    middle = height * (surface.places * areas[:, None]).sum(axis=0) / areas.sum()
    return Body(low, high, middle, np.array([*_feet(mesh, surface), *_head(surface)]).reshape(-1, 2))


def _walked(before: Sequence[Body], after: Sequence[Body], seconds: float) -> Votes:
    """Return the votes of the ways that bodies went in so many seconds, each to the nearest body then."""
    votes = list[Plane]()
    for body in before:
        ways = [(other.middle - body.middle) / (body.height or 1.0) for other in after]
        way = min(ways, key=lambda way: float((way**2).sum()), default=np.zeros(2))
        if math.hypot(*way) < FASTEST * seconds:  # otherwise it is another body
            votes.append(WALK * way / seconds)
    return np.array(votes).reshape(-1, 2)


def _elected(votes: Votes, usual: Plane) -> Plane | None:
    """Return the direction that votes agree on, or the side of two that are opposed; None if weak or at odds."""
    lengths = np.sqrt((votes**2).sum(axis=1))
    total, summed = float(lengths.sum()), votes.sum(axis=0)
    if total < LEAST * max(len(votes), 1):
        return None
    if math.hypot(*summed) >= AGREED * total:
        return summed / math.hypot(*summed)
    (xx, xz), (_, zz) = (votes[:, :, None] * votes[:, None] / np.maximum(lengths, 1e-12)[:, None, None]).sum(axis=0)
    half, apart = (xx - zz) / 2, math.hypot((xx - zz) / 2, xz)
    if apart < (FACING - 0.5) * total:
        return None
    along = np.array([apart + half, xz]) if half >= 0 else np.array([xz, apart - half])
    side = np.array([along[1], -along[0]]) / math.hypot(*along)
    return side if float((side * usual).sum()) >= 0 else -side


@dataclass(frozen=True, slots=True)
class _Surface:
    """Faces of a body, by the height of their middles; lengths in heights."""

    heights: Float64[np.ndarray, " F"]
    places: Float64[np.ndarray, "F 2"]
    areas: Float64[np.ndarray, " F"]

    def within(self, ends: tuple[float, float]) -> Bool[np.ndarray, " F"]:
        return (self.heights >= ends[0]) & (self.heights < ends[1])

    def mean(self, chosen: Bool[np.ndarray, " F"]) -> Plane | None:
        """Return the mean place of faces, None where they have no area that counts."""
        area = float(self.areas[chosen].sum())
        if area < LEAST_FOOT * float(self.areas.sum()) or area == 0:
            return None
        return (self.places[chosen] * self.areas[chosen, None]).sum(axis=0) / area

    def ahead(self, front: Bool[np.ndarray, " F"], back: Bool[np.ndarray, " F"]) -> list[Plane]:
        """Return how far some faces are ahead of others; nothing where either are missing."""
        one, other = self.mean(front), self.mean(back)
        return [] if one is None or other is None else [one - other]


def _feet(mesh: Mesh, surface: _Surface) -> list[Plane]:
    """Return how far the sole of each foot is ahead of its ankle; of feet in pieces, of all together."""
    low = surface.heights < ANKLE[1]
    sole, ankle = (surface.within((-1.0, SOLE[1])), surface.within(ANKLE))
    labels = components(mesh.faces[low], len(mesh.vertices))[mesh.faces[:, 0]]
    found = list[Plane]()
    for label in np.unique(labels[sole]):
        found += surface.ahead(sole & (labels == label), ankle & low & (labels == label))
    return found or surface.ahead(sole, ankle)


def _head(surface: _Surface) -> list[Plane]:
    """Return how far the face is ahead of the neck, as far as a head counts."""
    top = surface.mean(surface.heights >= CROWN)
    if top is None:
        return []
    away = np.sqrt(((surface.places - top) ** 2).sum(axis=1))
    face, neck = surface.within(FACE) & (away < ROUND_HEAD), surface.within(NECK) & (away < ROUND_NECK)
    return [HEAD * way for way in surface.ahead(face, neck)]
