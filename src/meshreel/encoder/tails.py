"""The worst one or two per cent of a group: faces to drop and patches to add, each only where it pays for its bytes.

In -> out: frames, the group as its layers decode, its size -> a LayersPatches and the frames as shown, or nothing.
A byte is worth what it would gain in the layers: there the squared error falls by 4 dB when the rate doubles, but for
the tails, which no step makes smaller, so they are left out of that account.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from ..coding import entropy
from ..coding.layers.patches import Patches, encode_patches, encode_runs, reach
from ..coding.mesh import encode_mesh
from ..coding.steps import rung_of, step_of
from ..format.layout import LayersPatches
from ..format.records import pack
from ..geometry.closest_points import Surface
from ..geometry.decimate import decimate
from ..geometry.depth import FreeSpace
from ..geometry.strict import dot
from ..geometry.topology import clean, components, concatenate, connected_faces, drop_unreferenced, face_normals
from ..types import Mesh

BODY = 0.98  # share of the surface; the rest is the tails (decision 13)
LEAST_BYTES = 4  # bytes of a region or a patch at least (guess)
DRACO_HEAD = 36  # bytes of a Draco mesh that all patches share
EXACT = 1e-7  # RMS distance of the rest, of the diagonal, below which no byte is worth spending (guess)


NOISY_REST = 1.0  # RMS noise that the rest of a noisy body may be off (guess)
FAR = 0.006  # diagonals: surface farther than that has no counterpart (1 cm on a body, as for keys: decision 24)
SHARD = 2e-5  # squared diagonals: half a square centimetre of a body that faces the wrong way shows (guess)
HOLE = 0.002  # squared diagonals of such surface, half a foot, that are patched at any price (guess)
TINY = 1e-300  # of areas: a mesh may have none


@dataclass(frozen=True, slots=True)
class TailOptions:
    """Candidates that the search for patches tries."""

    thresholds: tuple[float, ...] = (4.0, 6.0, 9.0)  # distances of the tails, in RMS distances of the rest
    shares: tuple[float, ...] = (0.1, 0.25, 0.5)  # of a patch's vertices that are kept
    lattice: float = 2.0  # spacing of the patches' lattice, in RMS distances of the rest
    exchange: float = 1.33  # relative fall of the squared error for a rise of the rate: 4 dB a doubling (decision 13)


@dataclass(frozen=True, slots=True)
class Tails:
    """A layer of patches, and the frames as decoded with it."""

    record: LayersPatches
    frames: list[Mesh]


def find_tails(
    frames: Sequence[Mesh | Surface],
    decoded: Sequence[Mesh],
    size: int,
    options: TailOptions = TailOptions(),
    *,
    noise: float,
    free: Sequence[FreeSpace | None] = (),
) -> Tails | None:
    """Find the layer of patches that lowers squared error + price x bytes most; None where none does.

    The `decoded` meshes of a group have the same faces; `size` is that of their layers, bytes. `noise` is the RMS
    distance of the frames from the truth: thresholds count from there where the rest is nearer. `free` is what cameras
    saw through in each frame: surface that a frame lacks stays unless one saw through it. Neither the mean nor the
    larger of both directions' errors rises by more than the layer's bytes are worth; but holes are patched at any
    price.
    """
    surfaces = [frame if isinstance(frame, Surface) else Surface(frame) for frame in frames]
    shown = [_Frame(*each) for each in zip_longest(surfaces, decoded, free)]
    faces = decoded[0].faces
    usual = float(np.mean([frame.body() for frame in shown]))  # squared
    if not EXACT**2 < usual < np.inf:
        return None
    if noise > 0:  # a foot that the template lacks may be more than a tail
        usual = min(usual, (NOISY_REST * noise) ** 2)
    price = options.exchange * len(frames) * usual / size
    usual = max(usual, noise**2)
    rung = _rung([surface.mesh for surface in surfaces], options.lattice * usual**0.5)
    search = _Search(shown, faces, usual, price, options, rung, noise)
    ghosts = search.ghosts()
    best, least = None, np.inf if ghosts.any() else search.cost(None)
    better = list[_Coded]()  # each than those before it
    for dropped in search.masks(ghosts):
        tried = search.coded(dropped, (Mesh.empty(),) * len(frames))
        if (cost := search.cost(tried)) < least:
            best, least = tried, cost
            better.append(tried)
    dropped = best.parts.dropped if best else search.nothing
    if torn := any(search.holes(dropped)):
        better, least = [], np.inf
    for patches in search.patches(best):
        tried = search.coded(dropped, patches)
        if (cost := search.cost(tried)) < least:
            least = cost
            better.append(tried)
    least_of_all = better[0] if ghosts.any() and better else None
    chosen = next((tried for tried in reversed(better) if torn or search.holds(tried)), least_of_all)
    return (
        None
        if chosen is None
        else Tails(chosen.record, chosen.parts.apply(np.stack([mesh.vertices for mesh in decoded]), faces))
    )


@dataclass(frozen=True, slots=True)
class _Coded:
    record: LayersPatches
    parts: Patches
    size: int


@dataclass(frozen=True, slots=True)
class _Search:
    frames: list[_Frame]
    faces: Int32[np.ndarray, "F 3"]
    usual: float  # mean squared distance without the tails
    price: float  # of a byte, squared distances summed over the frames
    options: TailOptions
    rung: int  # of the patches' lattice
    noise: float  # RMS distance of the frames from the truth

    @property
    def nothing(self) -> Bool[np.ndarray, "T F"]:
        """Return a mask that drops no face."""
        return np.zeros((len(self.frames), len(self.faces)), bool)

    def coded(self, dropped: Bool[np.ndarray, "T F"], meshes: Sequence[Mesh]) -> _Coded:
        """Return a mask and patches as a decoder sees them."""
        record, decoded = encode_patches(dropped, meshes, self.rung)
        return _Coded(record, Patches(dropped, decoded), len(pack(record)))

    def cost(self, tried: _Coded | None) -> float:
        """Return the cost: the squared error, mean of both directions, plus the price of the bytes."""
        return self._errors(tried).mean(axis=1).sum() + (self.price * tried.size if tried else 0.0)

    def holds(self, tried: _Coded) -> bool:
        """True where the fall of the larger error of both directions also pays for the bytes."""
        before, after = (self._errors(which).max(axis=1).sum() for which in (None, tried))
        return bool(after + self.price * tried.size < before)

    def _errors(self, tried: _Coded | None) -> Float64[np.ndarray, "T 2"]:
        if tried is None:
            return np.array([frame.errors for frame in self.frames])
        pairs = zip(self.frames, tried.parts.dropped, tried.parts.meshes, strict=True)
        return np.array([frame.errors_with(gone, patch, self.usual) for frame, gone, patch in pairs])

    def masks(self, ghosts: Bool[np.ndarray, "T F"]) -> Iterator[Bool[np.ndarray, "T F"]]:
        """Yield a mask of the faces worth dropping for each threshold, and those of ghosts, except empty masks."""
        for threshold in self.options.thresholds:
            chosen = ghosts | self._paying(np.stack([frame.apart > threshold**2 * self.usual for frame in self.frames]))
            if chosen.any():
                yield chosen

    def ghosts(self) -> Bool[np.ndarray, "T F"]:
        """Return the faces of surface, more than a bit, that stands where a camera saw through.

        Of a clean body they are shards, which face away from the frame's surface or have no counterpart there.
        """
        if self.noise == 0:
            far = np.stack([frame.wrong() for frame in self.frames])
        else:
            far = np.stack([(frame.apart > self._far) & frame.knows_free for frame in self.frames])
        labels = _regions(self.faces, far)
        largest = np.zeros(labels.max() + 1)
        for row, frame in zip(labels, self.frames, strict=True):
            there = np.bincount(row[row >= 0], frame.areas[row >= 0], len(largest))
            largest = np.maximum(largest, there)
        return far & np.append(largest >= (HOLE if self.noise else SHARD), False)[labels]

    def _paying(self, far: Bool[np.ndarray, "T F"]) -> Bool[np.ndarray, "T F"]:
        """Return the regions of faces, connected in space and time, that are worth their bytes."""
        labels = _regions(self.faces, far)
        gains = np.zeros(far.shape)
        for gain, frame, gone in zip(gains, self.frames, far, strict=True):
            if gone.any():
                gain += frame.gains(gone)
        totals = np.bincount(labels[far], gains[far], labels.max() + 1)
        chosen = np.zeros_like(far)
        for label in np.flatnonzero(totals > self.price * LEAST_BYTES):
            region = labels == label
            if totals[label] > self.price * len(entropy.encode_integers(encode_runs(region))):
                chosen |= region
        return chosen

    def patches(self, best: _Coded | None) -> Iterator[tuple[Mesh, ...]]:
        """Yield the patches worth their bytes for each threshold."""
        if not self.options.shares:
            return
        left = [frame.left(best.parts.dropped[t] if best else None) for t, frame in enumerate(self.frames)]
        for threshold in self.options.thresholds:
            meshes = tuple(
                self._patch(frame, squared, threshold) for frame, squared in zip(self.frames, left, strict=True)
            )
            if not all(mesh.is_empty for mesh in meshes):
                yield meshes

    def holes(self, dropped: Bool[np.ndarray, "T F"]) -> Iterator[bool]:
        """Yield for each frame whether it has surface, more than a bit, where nothing is decoded."""
        for frame, gone in zip(self.frames, dropped, strict=True):
            left = frame.left(gone)
            yield any(self._is_hole(frame, left, faces) for faces in frame.lost(left, self._far))

    @property
    def _far(self) -> float:
        """Squared distance beyond which surface of a frame has no counterpart."""
        return max(FAR**2, self.options.thresholds[0] ** 2 * self.usual)

    def _is_hole(self, frame: _Frame, squared: Float64[np.ndarray, " N"], faces: Int64[np.ndarray, " S"]) -> bool:
        corners = frame.original.faces[faces]
        far = (squared[corners] > self._far).all(axis=1)
        return bool(frame.surface.areas[faces[far]].sum() >= HOLE)

    def _patch(self, frame: _Frame, squared: Float64[np.ndarray, " N"], threshold: float) -> Mesh:
        """Yield the patches of a frame where its samples are farther than a limit from the decoded mesh."""
        chosen = []
        for faces in frame.lost(squared, threshold**2 * self.usual):
            samples, hole = frame.samples_of(faces), self._is_hole(frame, squared, faces)
            if not hole and dot(frame.weights[samples], squared[samples]) < 2 * self.price * LEAST_BYTES:
                continue
            tried = [(self._worth(frame, squared, samples, small), small) for small in self._reduced(frame, faces)]
            worth, small = max(tried, key=lambda pair: pair[0], default=(0.0, None))
            if small is not None and (hole or worth > 0):
                chosen.append(small)
        return drop_unreferenced(concatenate(chosen))

    def _reduced(self, frame: _Frame, faces: Int64[np.ndarray, " S"]) -> Iterator[Mesh]:
        mesh = clean(Mesh(frame.original.vertices, frame.original.faces[faces]))
        for share in self.options.shares:
            small = decimate(mesh, max(4, round(share * len(mesh.vertices))))
            step = step_of(self.rung)
            small = clean(Mesh(np.rint(small.vertices / step) * step, small.faces))
            if not small.is_empty and _within(np.abs(small.vertices).max(axis=0), self.rung, len(self.frames)):
                yield small

    def _worth(
        self, frame: _Frame, squared: Float64[np.ndarray, " N"], samples: Int64[np.ndarray, " n"], patch: Mesh
    ) -> float:
        size = max(len(encode_mesh(patch, step_of(self.rung))) - DRACO_HEAD, LEAST_BYTES)
        near = _squared(Surface(patch), frame.points[samples])[0]
        gain = dot(frame.weights[samples], np.maximum(squared[samples] - near, 0.0))
        return float(gain / 2 - self.price * size)


def _rung(frames: Sequence[Mesh], step: float) -> int:
    """Return the rung of the wanted lattice, or of the finest lattice that holds every part of the frames."""
    rung = rung_of(step)
    far = np.max([np.abs(frame.vertices).max(axis=0) for frame in frames], axis=0)
    while rung > 0 and not _within(far, rung, len(frames)):
        rung -= 1
    return rung


def _within(far: Float64[np.ndarray, " 3"], rung: int, frames: int) -> bool:
    across, elsewhere = reach(rung, frames)
    return bool(far[0] <= across and far[1:].max() <= elsewhere)


class _Frame:
    """A frame and its decoded mesh, sampled at vertices and centroids, with the distances between both."""

    def __init__(self, surface: Surface, decoded: Mesh, free: FreeSpace | None = None) -> None:
        original, self._free = surface.mesh, free
        self.original, self.decoded, self.surface, self.knows_free = original, decoded, surface, free is not None
        self.points, areas = _samples(original)
        shares = np.bincount(original.faces.reshape(-1), np.repeat(areas / 12, 3), len(original.vertices))
        weights = np.concatenate([shares, 0.75 * areas])
        self.weights = weights / weights.sum()
        self.squared, self.hit = _squared(Surface(decoded), self.points)
        points, self.areas = _samples(decoded)
        self._nearest = _squared(self.surface, points)  # of the decoded mesh's samples
        self.apart = self._of_free(points, self._nearest[0], decoded)  # of each decoded face, squared
        self.errors = (
            dot(self.weights, self.squared),
            dot(self.areas, self.apart) / max(float(self.areas.sum()), TINY),
        )

    def wrong(self) -> Bool[np.ndarray, " F"]:
        """Return the decoded faces that face away from the frame's surface, or are farther from it than `FAR`."""
        middles = slice(len(self.decoded.vertices), None)  # of its samples
        squared, hits = (each[middles] for each in self._nearest)
        facing = np.einsum("nd,nd->n", face_normals(self.decoded)[0], self.surface.normals[hits])
        return (facing < 0) | (squared > FAR**2)

    def body(self) -> float:
        """Return the mean squared distance from the frame to the decoded mesh except its farthest 2 %."""
        order = np.argsort(self.squared, kind="stable")
        inside = order[: np.searchsorted(np.cumsum(self.weights[order]), BODY)]
        return dot(self.weights[inside], self.squared[inside])

    def gains(self, gone: Bool[np.ndarray, " F"]) -> Float64[np.ndarray, " F"]:
        """Return how much each face lowers the mean of both errors when all these faces are dropped."""
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
        moved = gone[self.hit]
        kept = Surface(Mesh(self.decoded.vertices, self.decoded.faces[~gone]))
        squared[moved] = _squared(kept, self.points[moved])[0]
        return squared

    def errors_with(self, gone: Bool[np.ndarray, " F"], patch: Mesh, least: float) -> tuple[float, float]:
        """Return mean squared distances, forward and backward, with a patch and without the dropped faces.

        Samples that are nearer than `least` (squared) are not asked whether the patch is nearer still.
        """
        squared, areas, apart = self.left(gone), self.areas * ~gone, self.apart
        if not patch.is_empty:
            far = np.flatnonzero(squared > least)
            squared = squared.copy()
            squared[far] = np.minimum(squared[far], _squared(Surface(patch), self.points[far])[0])
            more = self._apart(patch)
            areas, apart = np.concatenate([areas, more[0]]), np.concatenate([apart, more[1]])
        return dot(self.weights, squared), dot(areas, apart) / float(areas.sum()) if areas.any() else np.inf

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

    def samples_of(self, faces: Int64[np.ndarray, " S"]) -> Int64[np.ndarray, " n"]:
        """Return the numbers of the samples on some of the frame's faces."""
        return np.concatenate([np.unique(self.original.faces[faces]), len(self.original.vertices) + faces])

    def _apart(self, mesh: Mesh) -> tuple[Float64[np.ndarray, " F"], Float64[np.ndarray, " F"]]:
        points, areas = _samples(mesh)
        return areas, self._of_free(points, _squared(self.surface, points)[0], mesh)

    def _of_free(
        self, points: Float64[np.ndarray, "N 3"], squared: Float64[np.ndarray, " N"], mesh: Mesh
    ) -> Float64[np.ndarray, " F"]:
        """Return mean squared distances of faces from those of samples, which count where a camera saw through them."""
        if self._free is not None:
            squared = np.where(self._free.at(points), squared, 0.0)
        return _of_faces(squared, mesh.faces)


def _samples(mesh: Mesh) -> tuple[Float64[np.ndarray, "N 3"], Float64[np.ndarray, " F"]]:
    return np.concatenate([mesh.vertices, mesh.vertices[mesh.faces].mean(axis=1)]), face_normals(mesh)[1]


def _squared(
    surface: Surface, points: Float64[np.ndarray, "N 3"]
) -> tuple[Float64[np.ndarray, " N"], Int32[np.ndarray, " N"]]:
    hits = surface.closest(points)
    return ((hits.points - points) ** 2).sum(axis=1), hits.faces


def _of_faces(squared: Float64[np.ndarray, " N"], faces: Int32[np.ndarray, "F 3"]) -> Float64[np.ndarray, " F"]:
    """Return means over the faces; 1/12 for each corner and 3/4 for the centroid integrate quadratics exactly."""
    return squared[faces].sum(axis=1) / 12 + 0.75 * squared[-len(faces) :]


def _regions(faces: Int32[np.ndarray, "F 3"], far: Bool[np.ndarray, "T F"]) -> Int64[np.ndarray, "T F"]:
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
