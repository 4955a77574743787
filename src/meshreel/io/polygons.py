"""Polygons of a mesh file, their triangulation in the order of the file, and lines of numbers in text files."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64, UInt8

from .. import _core
from ..types import Texture

Points = Float64[np.ndarray, "V 3"]
Corners = Int64[np.ndarray, "P N"]
Dropped = frozenset[str]  # names of data in a file other than geometry

CLOUD = 4  # vertices without a face that are data, not the mark of an empty frame: fewer make no surface
_MOST_CORNERS = 4096  # of a concave polygon, whose cutting takes quadratic time: seconds for so many (guess)
_SEARCHES = 64  # of all corners of a polygon for an ear, in which few are found (guess)


class Unreadable(ValueError):
    """The content of a file breaks the rules of its format; the caller adds file, frame and remedy to the message."""


class Surfaceless(Unreadable):
    """A file that has so many vertices and no faces; the message has a remedy."""

    def __init__(self, vertices: int) -> None:
        remedy = "`meshreel capture POINTS -o MESHES` makes one of points"
        super().__init__(f"{vertices} vertices and no faces: only surface is coded; {remedy}")


@dataclass(frozen=True, slots=True)
class Polygons:
    """Surface of a file before any check."""

    vertices: Float64[np.ndarray, "V 3"]  # m
    corners: Int64[np.ndarray, " C"]  # vertex of each corner of each polygon, from 0
    sizes: Int64[np.ndarray, " P"]  # corners of each polygon
    dropped: Dropped = frozenset()
    colors: UInt8[np.ndarray, "V 3"] | None = None  # of the vertices, sRGB
    uv: Float32[np.ndarray, "C 2"] | None = None  # of the corners, as `Mesh.uv`; NaN where a corner has none
    texture: Texture | None = None
    colored: Bool[np.ndarray, " V"] | None = None  # which vertices have a colour; None: all
    face_colors: UInt8[np.ndarray, "P 3"] | None = None  # of polygons
    libraries: tuple[str, ...] = ()  # files of an OBJ's materials
    materials: tuple[str, ...] = ()  # names of materials in these files
    pictures: tuple[str, ...] = ()  # files of a PLY's pictures, in place of materials
    material_of: Int64[np.ndarray, " P"] | None = None  # number of each polygon's material or picture, -1 for none

    @property
    def has_looks(self) -> bool:
        """True if colours or pictures of materials and faces are to be added to those of vertices."""
        parts = (self.material_of, self.face_colors, self.colored)
        return bool(self.libraries or self.pictures) or any(part is not None for part in parts)

    def naming(self, dropped: Iterable[str]) -> Polygons:
        """Return the same polygons with more names of data that are not kept."""
        return replace(self, dropped=self.dropped | {*dropped})


def eight_bits(values: np.ndarray, what: str = "vertex") -> UInt8[np.ndarray, "..."]:
    """Convert to 8 bits: 16-bit integers, fractions of 1, 0 to 255, as of floats beyond 2. Raises as `shares_of`."""
    if values.dtype.kind in "iu":
        most = 65535.0 if values.dtype.kind == "u" and values.dtype.itemsize == 2 else 255.0
    else:
        finite = values[np.isfinite(values)]
        most = 1.0 if finite.max(initial=0.0) <= 2.0 else 255.0
    return (shares_of(values, most, what) * 255.0).round().astype(np.uint8)


def shares_of(colors: np.ndarray, most: float, what: str = "vertex") -> Float64[np.ndarray, "V 3"]:
    """Return colours as shares, 0 to 1, of `most`, which blended ones exceed a little. Raises Unreadable for others."""
    shares = colors.astype(np.float64) / most
    strange = np.flatnonzero(~((shares >= -1.0) & (shares <= 2.0)).all(axis=1))
    if len(strange):
        red, green, blue = colors[strange[0]]
        text = f"{what} {strange[0]} has the colour ({red:g}, {green:g}, {blue:g})"
        raise Unreadable(f"{text}, and {len(strange)} in all are not within 0 to {most:g}")
    return np.clip(shares, 0.0, 1.0)


def triangulate(polygons: Polygons) -> Int64[np.ndarray, "F 3"]:
    """Cut polygons, which are checked, into triangles without folds; return their corners' numbers among all."""
    sizes, corners = polygons.sizes, np.arange(len(polygons.corners))
    if (sizes == 3).all():
        return corners.reshape(-1, 3)
    vertices = polygons.vertices[polygons.corners]
    first_corner = np.cumsum(sizes) - sizes
    first_face = np.cumsum(sizes - 2) - (sizes - 2)
    faces = np.empty((int((sizes - 2).sum()), 3), dtype=np.int64)
    for size in np.unique(sizes):
        chosen = np.flatnonzero(sizes == size)
        same = corners[first_corner[chosen, None] + np.arange(size)]
        faces[first_face[chosen, None] + np.arange(size - 2)] = _cut(vertices, same)
    return faces


def _cut(vertices: Points, polygons: Corners) -> Int64[np.ndarray, "P N-2 3"]:
    """Return the triangles of polygons with N corners each."""
    fans = _fans(polygons)
    folded = _folds(vertices, polygons, fans)
    if polygons.shape[1] == 4:
        other = _fans(np.roll(polygons, -1, axis=1))
        better = folded & ~_folds(vertices, polygons, other)
        fans[better] = other[better]
    else:
        for row in np.flatnonzero(folded):
            fans[row] = _clip_ears(vertices[polygons[row]], polygons[row])
    return fans


def _fans(polygons: Corners) -> Int64[np.ndarray, "P N-2 3"]:
    hub = np.repeat(polygons[:, :1], polygons.shape[1] - 2, axis=1)
    return np.stack([hub, polygons[:, 1:-1], polygons[:, 2:]], axis=2)


def _folds(vertices: Points, polygons: Corners, fans: Int64[np.ndarray, "P N-2 3"]) -> Bool[np.ndarray, " P"]:
    """Return a mask of the polygons whose fan has a triangle that faces away from the polygon."""
    normals = _newell(vertices[polygons])
    a, b, c = (vertices[fans[:, :, k]] for k in range(3))
    return (np.einsum("pnd,pd->pn", np.cross(b - a, c - a), normals) < 0).any(axis=1)


def _newell(points: Float64[np.ndarray, "P N 3"]) -> Float64[np.ndarray, "P 3"]:
    """Return twice the vector area of each polygon, relative to its first corner for precision far from the origin."""
    local = points - points[:, :1]
    return np.cross(local, np.roll(local, -1, axis=1)).sum(axis=1)


def _clip_ears(points: Float64[np.ndarray, "N 3"], names: Int64[np.ndarray, " N"]) -> Int64[np.ndarray, "N-2 3"]:
    """Return the triangles of one concave polygon; a rest without an ear becomes a fan."""
    normal = _newell(points[None])[0]
    drop = int(np.argmax(np.abs(normal)))  # projection along the largest axis keeps the orientation
    flat = np.delete(points - points[0], drop, axis=1) * np.array([1.0, -1.0 if drop == 1 else 1.0])
    flat = flat if normal[drop] > 0 else flat * np.array([1.0, -1.0])
    if len(names) > _MOST_CORNERS:
        raise Unreadable(f"a polygon that is not convex has {len(names)} corners, of at most {_MOST_CORNERS}")
    ring, faces, searches = list(range(len(names))), [], 0
    ears = [_is_ear(flat, ring, k) for k in ring]
    while len(ring) > 3:
        at = next((k for k, corner in enumerate(ring) if ears[corner]), -1)
        if at < 0 and (searches := searches + 1) <= _SEARCHES:  # a corner may be one that was none before
            for k, corner in enumerate(ring):
                ears[corner] = _is_ear(flat, ring, k)
            at = next((k for k, corner in enumerate(ring) if ears[corner]), -1)
        at = at if at >= 0 else 1
        faces.append((ring[at - 1], ring[at], ring[(at + 1) % len(ring)]))
        ring.pop(at)
        for k in (at - 1, at % len(ring)):
            ears[ring[k]] = _is_ear(flat, ring, k % len(ring))
    return names[np.array([*faces, tuple(ring)])]


def _is_ear(flat: Float64[np.ndarray, "N 2"], ring: list[int], k: int) -> bool:
    a, b, c = ring[k - 1], ring[k], ring[(k + 1) % len(ring)]
    corners = flat[[a, b, c]]
    if _turn(corners[0], corners[1], corners[2]) <= 0:
        return False
    others = flat[ring]
    inside = np.ones(len(ring), bool)
    for i in range(3):
        inside &= _turn(corners[i], corners[(i + 1) % 3], others) >= 0
    inside[[k - 1, k, (k + 1) % len(ring)]] = False
    return not inside.any()


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray | np.floating:
    return (b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0])


@dataclass(frozen=True, slots=True)
class Lines:
    """Text and the positions of its lines."""

    text: UInt8[np.ndarray, " B"]
    starts: Int64[np.ndarray, " L"]  # behind leading blanks
    ends: Int64[np.ndarray, " L"]  # before comments and newlines: text goes on behind each of them

    @staticmethod
    def of(data: bytes, comment: str = "#") -> Lines:
        """Return the lines of a text with any newlines, without comments and leading blanks."""
        text = np.frombuffer(data + b"\n", dtype=np.uint8)
        starts, ends = _core.split_lines(text[:-1], comment)
        return Lines(text, starts.view(np.int64), ends.view(np.int64))  # of the same size, by its usual name

    def __len__(self) -> int:
        return len(self.starts)

    def written(self, number: int | np.integer) -> str:
        """Return one line with what looks like a comment."""
        begin = int(self.starts[number])
        end = int(self.starts[number + 1]) if number + 1 < len(self) else len(self.text)
        line = self.text[begin:end].tobytes().decode("utf-8", "replace")
        return (line.splitlines() or [""])[0].strip()

    def line(self, number: int | np.integer) -> str:
        """Return one line, shortened for an error message."""
        text = self.text[self.starts[number] : self.ends[number]].tobytes().decode("utf-8", "replace").strip()
        return text if len(text) <= 60 else text[:57] + "..."

    def values(
        self, chosen: Int64[np.ndarray, " N"], skip: int = 0, stop: str = "", field: int = 0
    ) -> tuple[Float64[np.ndarray, " M"], Int64[np.ndarray, " N"]]:
        """Return all numbers of the chosen lines, without their first `skip` bytes, and the count in each line.

        A number ends at the letter `stop` in a word; a `field` above 0 selects what is behind so many of these, or NaN.
        """
        starts, ends = self.starts[chosen] + skip, self.ends[chosen]
        values, counts, bad = _core.read_numbers(self.text, starts, ends, stop or "\0", field)
        if bad >= 0:
            number = int(np.searchsorted(self.starts, bad, side="right")) - 1
            word = self.text[bad : self.ends[number]].tobytes().split()[0]
            start = (word.split(stop.encode())[0] if stop else word)[:20].decode("utf-8", "replace")
            raise Unreadable(f"line {number + 1} ({self.line(number)!r}) has {start!r} where a number must be")
        return values, counts.astype(np.int64)


def whole(values: np.ndarray, what: str) -> Int64[np.ndarray, "..."]:
    """Return the values as integers. Raises Unreadable for fractions, NaN, and magnitudes of 2^53 or more."""
    if np.can_cast(values.dtype, np.int64):
        return values.astype(np.int64)
    with np.errstate(invalid="ignore"):
        bad = np.flatnonzero(~((np.abs(values) < 2**53) & (values == np.floor(values))))
    if len(bad):
        raise Unreadable(f"{what} is {values.reshape(-1)[bad[0]]:g} where a whole number must be")
    return values.astype(np.int64)
