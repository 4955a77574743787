"""A frame beside what is decoded of it: how far each is from the other, face by face.

In: a frame's surface, the decoded mesh, and what cameras saw through. Out: squared distances, and what changes of them
where faces are dropped or patched, and which faces may not be shown, whatever it costs to say so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import repeat

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from ...geometry import work
from ...geometry.closest_points import Hits, MovingSurface, Surface
from ...geometry.depth import FreeSpace
from ...geometry.strict import dot
from ...geometry.threads import mapped
from ...geometry.topology import blend, components, connected_faces, face_means, face_normals
from ...metrics.distance import BothClosest, Closest
from ...types import Mesh

BODY = 0.98  # share of the surface; the rest is the tails (decision 13)
FAR = 0.006  # diagonals: surface farther than that has no counterpart (1 cm on a body, as for keys: decision 24)
TINY = 1e-300  # of areas: a mesh may have none


class ShownFrame:
    """A frame and its decoded mesh, sampled at vertices and centroids, with the distances between both."""

    def __init__(
        self,
        surface: Surface,
        decoded: Mesh,
        moving: MovingSurface,
        free: FreeSpace | None = None,
        uneven: Float64[np.ndarray, " V"] | None = None,
    ) -> None:
        """`moving` has the faces of `decoded`. `uneven` is the noise of each vertex, in units of all noise.

        Squared distances are in units of its square.
        """
        work.passed("patch")
        original, self._free = surface.mesh, free
        self._uneven: Float64[np.ndarray, " N"] | None = None
        if uneven is not None:
            self._uneven = np.concatenate([uneven, uneven[original.faces].mean(axis=1)]) ** 2
        self.original, self.decoded, self.surface, self.knows_free = original, decoded, surface, free is not None
        mine, areas = _samples(original)
        shares = np.bincount(original.faces.reshape(-1), np.repeat(areas / 12, 3), len(original.vertices))
        weights = np.concatenate([shares, 0.75 * areas])
        self.weights = weights / weights.sum()
        self._moving = moving
        points, self.areas = _samples(decoded)
        with moving.at(decoded.vertices) as shown:
            ahead = shown.closest(mine)
        back = surface.closest(points)
        self.closest = (ahead.faces, ahead.barycentric), (back.faces, back.barycentric)  # to the samples of either
        self.squared, self.hit = self._by_noise(_squared(ahead, mine), slice(None)), ahead.faces
        self._nearest = self._back(back, points)
        self.apart = self._of_free(points, self._nearest[0], decoded)  # of each decoded face, squared
        self.errors = (
            dot(self.weights, self.squared),
            dot(self.areas, self.apart) / max(float(self.areas.sum()), TINY),
        )

    def ahead(
        self, surface: Surface, some: Int64[np.ndarray, " n"], gone: Bool[np.ndarray, " F"] | None = None
    ) -> tuple[Float64[np.ndarray, " n"], Int32[np.ndarray, " n"]]:
        """Return squared distances of some of the frame's samples from a surface, and its faces that are closest.

        Faces that are `gone` are left out.
        """
        points = self._points(some)
        hits = surface.closest(points, gone)
        return self._by_noise(_squared(hits, points), some), hits.faces

    def _back(
        self, hits: Hits, points: Float64[np.ndarray, "N 3"]
    ) -> tuple[Float64[np.ndarray, " N"], Int32[np.ndarray, " N"]]:
        """Return squared distances of points from their `hits` on the frame's surface, and its faces there."""
        return self._by_noise(_squared(hits, points), len(self.original.vertices) + hits.faces), hits.faces

    def _points(self, some: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 3"]:
        """Return some of the frame's samples, which are not kept."""
        count, faces = len(self.original.vertices), self.original.faces
        middles = some >= count
        points = self.original.vertices[np.where(middles, 0, some)]
        points[middles] = face_means(self.original.vertices, faces[some[middles] - count])
        return points

    def _by_noise(
        self, squared: Float64[np.ndarray, " n"], samples: Int64[np.ndarray, " n"] | Int32[np.ndarray, " n"] | slice
    ) -> Float64[np.ndarray, " n"]:
        """Return squared distances in units of the squared noise of the frame's samples there."""
        return squared if self._uneven is None else squared / self._uneven[samples]

    def wrong(self) -> Bool[np.ndarray, " F"]:
        """Return the decoded faces that face away from the frame's surface, or are farther from it than `FAR`."""
        middles = slice(len(self.decoded.vertices), None)  # of its samples
        squared, hits = (each[middles] for each in self._nearest)
        facing = np.einsum("nd,nd->n", face_normals(self.decoded)[0], self.surface.normals[hits])
        return (facing < 0) | (squared > FAR**2)

    def measured(self, far: float) -> tuple[Bool[np.ndarray, " F"], Bool[np.ndarray, " F"]]:
        """Return the decoded faces that cameras face, and those that are within a squared distance of the surface."""
        middles = len(self.decoded.vertices)
        points = face_means(self.decoded.vertices, self.decoded.faces)
        there = self._nearest[0][middles:] <= far
        if self._free is None:
            return np.zeros_like(there), there
        return self._free.faced(points, face_normals(self.decoded)[0]), there

    def body(self) -> float:
        """Return the mean squared distance from the frame to the decoded mesh except its farthest 2 %."""
        order = np.argsort(self.squared, kind="stable")
        inside = order[: np.searchsorted(np.cumsum(self.weights[order]), BODY)]
        return dot(self.weights[inside], self.squared[inside])

    def gains(self, gone: Bool[np.ndarray, " F"]) -> Float64[np.ndarray, " F"]:
        """Return how much each face lowers the mean of both errors when all these faces are dropped."""
        if not gone.any():
            return np.zeros(len(gone))
        invented = self.areas * (self.apart - self.errors[1]) / max(self.areas.sum(), TINY)
        lost = self.weights * (self.left(gone) - self.squared)
        return (invented * gone - np.bincount(self.hit, lost, len(gone))) / 2

    def left(self, gone: Bool[np.ndarray, " F"] | None) -> Float64[np.ndarray, " N"]:
        """Return squared distances from the frame's samples to the decoded mesh without the dropped faces."""
        if gone is None or not gone.any():
            return self.squared
        if gone.all():
            return np.full(len(self.squared), np.inf)
        squared = self.squared.copy()
        moved = np.flatnonzero(gone[self.hit])
        with self._moving.at(self.decoded.vertices) as shown:
            squared[moved] = self.ahead(shown, moved, gone)[0]
        return squared

    def errors_with(self, gone: Bool[np.ndarray, " F"], patch: Mesh, least: float) -> tuple[float, float]:
        """Return mean squared distances, forward and backward, with a patch and without the dropped faces.

        Samples that are nearer than `least` (squared) are not asked whether the patch is nearer still.
        """
        squared, areas, apart = self.left(gone), self.areas * ~gone, self.apart
        if not patch.is_empty:
            far = np.flatnonzero(squared > least)
            squared = squared.copy()
            squared[far] = np.minimum(squared[far], self.ahead(Surface(patch), far)[0])
            points, added = _samples(patch)
            away = self._of_free(points, self._back(self.surface.closest(points), points)[0], patch)
            areas, apart = np.concatenate([areas, added]), np.concatenate([apart, away])
        return dot(self.weights, squared), dot(areas, apart) / float(areas.sum()) if areas.any() else np.inf

    def closest_with(self, gone: Bool[np.ndarray, " F"], patch: Mesh) -> BothClosest:
        """Return the closest points between the frame and the mesh as it is shown: without dropped faces, with a patch.

        Faces are numbered as `Patches.apply` puts them together; samples are of the vertices that have faces then.
        """
        kept, used, count = ~gone, np.zeros(len(self.decoded.vertices), bool), len(self.decoded.vertices)
        used[self.decoded.faces[kept]] = True
        ahead, (faces, weights) = self._ahead_with(gone, patch), self.closest[1]
        hits, first = self.surface.closest(_samples(patch)[0]), len(patch.vertices)
        back = (
            np.concatenate([own[:count][used], added[:first], own[count:][kept], added[first:]])
            for own, added in ((faces, hits.faces), (weights, hits.barycentric))
        )
        return ahead, (next(back), next(back))

    def _ahead_with(self, gone: Bool[np.ndarray, " F"], patch: Mesh) -> Closest:
        """Return the closest points of the mesh, as it is shown, to the frame's samples."""
        points, kept = _samples(self.original)[0], ~gone
        faces, weights = (each.copy() for each in self.closest[0])
        moved = np.flatnonzero(gone[faces])
        if len(moved) and kept.any():
            with self._moving.at(self.decoded.vertices) as shown:
                hits = shown.closest(points[moved], gone)
            faces[moved], weights[moved] = hits.faces, hits.barycentric
        corners = self.decoded.faces[faces]
        squared = ((blend(self.decoded.vertices, corners, weights) - points) ** 2).sum(axis=1)
        if not kept.any():  # the patch is all that is left
            squared[:] = np.inf
        faces = (np.cumsum(kept, dtype=np.int32) - 1)[faces]
        if not patch.is_empty:
            low, high = patch.vertices.min(axis=0), patch.vertices.max(axis=0)
            to_box = np.maximum(np.maximum(low - points, points - high), 0.0)
            asked = np.flatnonzero((to_box**2).sum(axis=1) < squared)  # others are nearer to what is kept
            hits = Surface(patch).closest(points[asked])
            nearer = _squared(hits, points[asked]) < squared[asked]
            faces[asked[nearer]] = np.count_nonzero(kept) + hits.faces[nearer]
            weights[asked[nearer]] = hits.barycentric[nearer]
        return faces, weights

    def lost(self, squared: Float64[np.ndarray, " N"], limit: float) -> Iterator[Int64[np.ndarray, " S"]]:
        """Yield connected faces, with a rim, that are farther than a squared limit from the decoded mesh."""
        faces, count = self.original.faces, len(self.original.vertices)
        far = _of_faces(squared, faces) > limit
        touched = np.zeros(count, bool)
        touched[faces[far]] = True
        wide = np.flatnonzero(touched[faces].any(axis=1))
        labels = connected_faces(faces[wide], count)
        order = np.argsort(labels, kind="stable")
        yield from np.split(wide[order], np.flatnonzero(np.diff(labels[order])) + 1) if len(wide) else ()

    def _of_free(
        self, points: Float64[np.ndarray, "N 3"], squared: Float64[np.ndarray, " N"], mesh: Mesh
    ) -> Float64[np.ndarray, " F"]:
        """Return mean squared distances of faces from those of samples, which count where a camera saw through them."""
        if self._free is not None:
            squared = np.where(self._free.at(points), squared, 0.0)
        return _of_faces(squared, mesh.faces)


def shown_frames(
    frames: Sequence[Mesh | Surface],
    decoded: Sequence[Mesh],
    free: Sequence[FreeSpace | None] = (),
    uneven: Sequence[Float64[np.ndarray, " _"] | None] = (),
) -> list[ShownFrame]:
    """Return each frame beside its decoded mesh, with what cameras saw through and the noise of its vertices.

    Decoded meshes have the same faces.
    """
    surfaces = mapped(lambda frame: frame if isinstance(frame, Surface) else Surface(frame), frames)
    moving = MovingSurface(decoded[0])
    return mapped(ShownFrame, surfaces, decoded, repeat(moving), free or repeat(None), uneven or repeat(None))


def _samples(mesh: Mesh) -> tuple[Float64[np.ndarray, "N 3"], Float64[np.ndarray, " F"]]:
    return np.concatenate([mesh.vertices, face_means(mesh.vertices, mesh.faces)]), face_normals(mesh)[1]


def _squared(hits: Hits, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    return ((hits.points - points) ** 2).sum(axis=1)


def _of_faces(squared: Float64[np.ndarray, " N"], faces: Int32[np.ndarray, "F 3"]) -> Float64[np.ndarray, " F"]:
    """Return means over the faces; 1/12 for each corner and 3/4 for the centroid integrate quadratics exactly."""
    a, b, c = faces.T
    return (squared[a] + squared[b] + squared[c]) / 12 + 0.75 * squared[-len(faces) :]


SHARD = 1e-5  # squared diagonals: half a square centimetre of a body that faces the wrong way shows (guess)
HOLE = 0.002  # squared diagonals, half a foot: larger holes are patched, larger surplus dropped, at any price (guess)
SELDOM = 0.25  # share of the frames in which cameras face surface, below which its measurements are noise (guess)
OFTEN = 0.3  # share of the frames in which cameras must face it, for that to be said (guess)
POOLED = 3  # rings of faces around each that are judged together, so that no crumbs are left (guess)


def ghosts(frames: Sequence[ShownFrame], faces: Int32[np.ndarray, "F 3"], far: float | None) -> Bool[np.ndarray, "T F"]:
    """Mark decoded faces, in regions larger than `HOLE` or `SHARD`, that the frames lack.

    Of noisy bodies these are faces farther than `far`, squared, where a camera saw through, and such as cameras face
    and hardly ever measure. Of clean ones, which have no `far`, they are shards: faces that face away from the frame's
    surface or have no counterpart there.
    """
    if far is None:
        return _large(np.stack([frame.wrong() for frame in frames]), frames, faces, SHARD)
    through = np.stack([(frame.apart > far) & frame.knows_free for frame in frames])
    gone = _large(through | _unseen(frames, faces, far), frames, faces, HOLE)
    for row, frame in zip(gone, frames, strict=True):
        row |= _crumbs(row, frame.areas, faces)
    return gone


def _large(
    found: Bool[np.ndarray, "T F"], frames: Sequence[ShownFrame], faces: Int32[np.ndarray, "F 3"], least: float
) -> Bool[np.ndarray, "T F"]:
    """Return the regions, connected in space and time, that reach an area, squared diagonals, in some frame."""
    labels = regions(faces, found)
    largest = np.zeros(labels.max() + 1)
    for row, frame in zip(labels, frames, strict=True):
        largest = np.maximum(largest, np.bincount(row[row >= 0], frame.areas[row >= 0], len(largest)))
    return found & np.append(largest >= least, False)[labels]


def _unseen(frames: Sequence[ShownFrame], faces: Int32[np.ndarray, "F 3"], far: float) -> Bool[np.ndarray, "T F"]:
    """Return the faces that cameras often face and hardly ever measure, in the frames in which they do not."""
    faced, there = (np.stack(each) for each in zip(*(frame.measured(far) for frame in frames), strict=True))
    counts = np.stack([faced.sum(axis=0), (faced & there).sum(axis=0), np.full(len(faces), len(frames))])
    pooled = list(counts.astype(np.float64))
    for _ in range(POOLED):  # sums over the faces near each
        pooled = [np.bincount(faces.reshape(-1), each.repeat(3))[faces].sum(axis=1) for each in pooled]
    often, seen, most = pooled
    return ~there & (seen < SELDOM * often) & (often >= OFTEN * most)


def _crumbs(
    gone: Bool[np.ndarray, " F"], areas: Float64[np.ndarray, " F"], faces: Int32[np.ndarray, "F 3"]
) -> Bool[np.ndarray, " F"]:
    """Return the faces of bits that would be left at the rim of dropped faces."""
    kept, count = np.flatnonzero(~gone), int(faces.max()) + 1
    rim, labels = np.zeros(count, bool), connected_faces(faces[kept], count)
    rim[faces[gone]] = True
    sizes = np.bincount(labels, areas[kept])
    beside = np.bincount(labels, rim[faces[kept]].any(axis=1)) > 0
    found = np.zeros_like(gone)
    found[kept] = (beside & (sizes < HOLE))[labels]
    return found


def regions(faces: Int32[np.ndarray, "F 3"], far: Bool[np.ndarray, "T F"]) -> Int64[np.ndarray, "T F"]:
    """Label regions of faces that share a vertex or are the same face in the next frame; -1 outside."""
    count = int(faces.max()) + 1
    frames, at = np.nonzero(far)
    corners = frames[:, None] * count + faces[at]
    stays = far[1:] & far[:-1]
    earlier, same = np.nonzero(stays)
    ends = earlier * count + faces[same, 0]
    links = np.stack([ends, ends + count, ends], axis=1)
    used, inverse = np.unique(np.concatenate([corners, links]), return_inverse=True)
    triples = inverse.reshape(-1, 3).astype(np.int32)
    labels = np.full(far.shape, -1)
    labels[far] = components(triples, len(used))[triples[: len(at), 0]]
    return labels
