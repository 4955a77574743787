"""The worst one or two per cent of a group: faces to drop and patches to add, each only where it pays for its bytes.

In -> out: frames, the group as its layers decode, its size -> a LayersPatches and the frames as shown, or nothing.
A byte is worth what it would gain in the layers: there the squared error falls by 4 dB when the rate doubles, but for
the tails, which no step makes smaller, so they are left out of that account.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from ...coding import entropy
from ...coding.layers.patches import Patches, encode_patches, encode_runs, fits
from ...coding.mesh import encode_mesh
from ...coding.steps import rung_of, step_of
from ...format.layout import LayersPatches
from ...format.records import pack
from ...geometry.closest_points import Surface
from ...geometry.decimate import decimate
from ...geometry.strict import dot
from ...geometry.threads import mapped
from ...geometry.topology import clean, concatenate, drop_unreferenced
from ...metrics.distance import BothClosest
from ...types import Mesh
from .shown_frame import FAR, HOLE, ShownFrame, ghosts, regions

LEAST_BYTES = 4  # bytes of a region or a patch at least (guess)
DRACO_HEAD = 36  # bytes of a Draco mesh that all patches share
EXACT = 1e-7  # RMS distance of the rest, of the diagonal, below which no byte is worth spending (guess)
NOISY_REST = 1.0  # RMS noise that the rest of a noisy body may be off (guess)
THRESHOLDS = (4.0, 6.0, 9.0)  # distances of the tails, in RMS distances of the rest (guess)
SHARES = (0.1, 0.25, 0.5)  # of a patch's vertices that are kept (guess)
LATTICE = 2.0  # spacing of the patches' lattice, in RMS distances of the rest (guess)
EXCHANGE = 1.33  # power of the rate with which the squared error falls: 4 dB a doubling (decision 13)


def find_tails(
    shown: list[ShownFrame], size: int, noise: float
) -> tuple[LayersPatches, list[Mesh], list[BothClosest]] | None:
    """Return the layer of patches that lowers squared error + price x bytes most, the frames with it, what is closest.

    None where no layer does. The decoded meshes of a group have the same faces; `size` is that of their layers, bytes.
    `noise` is the RMS distance of the frames from the truth: thresholds count from there where the rest is nearer.
    Surface that a frame lacks stays unless a camera saw through it. Neither the mean nor the larger of both directions'
    errors rises by more than the layer's bytes are worth; but holes are patched at any price.
    """
    faces = shown[0].decoded.faces
    usual = float(np.mean([frame.body() for frame in shown]))  # squared
    if not EXACT**2 < usual < np.inf:
        return None
    if noise > 0:  # a foot that the template lacks may be more than a tail
        usual = min(usual, (NOISY_REST * noise) ** 2)
    price = EXCHANGE * len(shown) * usual / size
    usual = max(usual, noise**2)
    rung = _rung([frame.original for frame in shown], LATTICE * usual**0.5)
    search = _Search(shown, faces, usual, price, rung, noise)
    gone = ghosts(shown, faces, search.far if noise > 0 else None)
    best, least = None, np.inf if gone.any() else search.cost(None)
    better = list[_Coded]()  # each than those before it
    for dropped in search.masks(gone):
        tried = search.coded(dropped, (Mesh.empty(),) * len(shown))
        if (cost := search.cost(tried)) < least:
            best, least = tried, cost
            better.append(tried)
    dropped = best.parts.dropped if best else np.zeros((len(shown), len(faces)), bool)
    if torn := search.is_torn(dropped):
        better, least = [], np.inf
    for patches in search.patches(best):
        tried = search.coded(dropped, patches)
        if (cost := search.cost(tried)) < least:
            least = cost
            better.append(tried)
    least_of_all = better[0] if gone.any() and better else None
    chosen = next((tried for tried in reversed(better) if torn or search.holds(tried)), least_of_all)
    if chosen is None:
        return None
    parts = chosen.parts
    closest = mapped(ShownFrame.closest_with, shown, parts.dropped, parts.meshes)
    return chosen.record, parts.apply(np.stack([frame.decoded.vertices for frame in shown]), faces), closest


@dataclass(frozen=True, slots=True)
class _Coded:
    record: LayersPatches
    parts: Patches
    size: int


@dataclass(frozen=True, slots=True)
class _Search:
    frames: list[ShownFrame]
    faces: Int32[np.ndarray, "F 3"]
    usual: float  # mean squared distance without the tails
    price: float  # of a byte, squared distances summed over the frames
    rung: int  # of the patches' lattice
    noise: float  # RMS distance of the frames from the truth

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
        parts = tried.parts
        return np.array(mapped(ShownFrame.errors_with, self.frames, parts.dropped, parts.meshes, repeat(self.usual)))

    def masks(self, gone: Bool[np.ndarray, "T F"]) -> Iterator[Bool[np.ndarray, "T F"]]:
        """Yield a mask of the faces worth dropping for each threshold, with those gone anyway; no empty one."""
        for threshold in THRESHOLDS:
            chosen = gone | self._paying(np.stack([frame.apart > threshold**2 * self.usual for frame in self.frames]))
            if chosen.any():
                yield chosen

    def _paying(self, far: Bool[np.ndarray, "T F"]) -> Bool[np.ndarray, "T F"]:
        """Return the regions of faces, connected in space and time, that are worth their bytes."""
        labels = regions(self.faces, far)
        gains = np.stack(mapped(ShownFrame.gains, self.frames, far))
        totals = np.bincount(labels[far], gains[far], labels.max() + 1)
        chosen = np.zeros_like(far)
        for label in np.flatnonzero(totals > self.price * LEAST_BYTES):
            region = labels == label
            if totals[label] > self.price * len(entropy.encode_integers(encode_runs(region))):
                chosen |= region
        return chosen

    def patches(self, best: _Coded | None) -> Iterator[tuple[Mesh, ...]]:
        """Yield the patches worth their bytes for each threshold."""
        left = mapped(ShownFrame.left, self.frames, best.parts.dropped if best else repeat(None))
        for threshold in THRESHOLDS:
            meshes = tuple(mapped(self._patch, self.frames, left, repeat(threshold)))
            if not all(mesh.is_empty for mesh in meshes):
                yield meshes

    def is_torn(self, dropped: Bool[np.ndarray, "T F"]) -> bool:
        """Return whether a frame has surface, more than a bit, where nothing is decoded."""
        pairs = ((frame, frame.left(gone)) for frame, gone in zip(self.frames, dropped, strict=True))
        return any(self._is_hole(frame, left, faces) for frame, left in pairs for faces in frame.lost(left, self.far))

    @property
    def far(self) -> float:
        """Squared distance beyond which surface of a frame has no counterpart."""
        return max(FAR**2, THRESHOLDS[0] ** 2 * self.usual)

    def _is_hole(self, frame: ShownFrame, squared: Float64[np.ndarray, " N"], faces: Int64[np.ndarray, " S"]) -> bool:
        corners = frame.original.faces[faces]
        far = (squared[corners] > self.far).all(axis=1)
        return bool(frame.surface.areas[faces[far]].sum() >= HOLE)

    def _patch(self, frame: ShownFrame, squared: Float64[np.ndarray, " N"], threshold: float) -> Mesh:
        """Return the patches of a frame where its samples are farther than a limit from the decoded mesh."""
        chosen = []
        for faces in frame.lost(squared, threshold**2 * self.usual):
            corners = np.unique(frame.original.faces[faces])
            samples = np.concatenate([corners, len(frame.original.vertices) + faces])
            hole = self._is_hole(frame, squared, faces)
            if not hole and dot(frame.weights[samples], squared[samples]) < 2 * self.price * LEAST_BYTES:
                continue
            tried = [(self._worth(frame, squared, samples, small), small) for small in self._reduced(frame, faces)]
            worth, small = max(tried, key=lambda pair: pair[0], default=(0.0, None))
            if small is not None and (hole or worth > 0):
                chosen.append(small)
        return drop_unreferenced(concatenate(chosen))

    def _reduced(self, frame: ShownFrame, faces: Int64[np.ndarray, " S"]) -> Iterator[Mesh]:
        mesh = clean(Mesh(frame.original.vertices, frame.original.faces[faces]))
        for share in SHARES:
            small = decimate(mesh, max(4, round(share * len(mesh.vertices))))
            step = step_of(self.rung)
            small = clean(Mesh(np.rint(small.vertices / step) * step, small.faces))
            if not small.is_empty and fits(np.abs(small.vertices).max(axis=0), self.rung, len(self.frames)):
                yield small

    def _worth(
        self, frame: ShownFrame, squared: Float64[np.ndarray, " N"], samples: Int64[np.ndarray, " n"], patch: Mesh
    ) -> float:
        size = max(len(encode_mesh(patch, step_of(self.rung))) - DRACO_HEAD, LEAST_BYTES)
        near = frame.ahead(Surface(patch), samples)[0]
        gain = dot(frame.weights[samples], np.maximum(squared[samples] - near, 0.0))
        return float(gain / 2 - self.price * size)


def _rung(frames: Sequence[Mesh], step: float) -> int:
    """Return the rung of the wanted lattice, or of the finest lattice that holds every part of the frames."""
    rung = rung_of(step)
    far = np.max([np.abs(frame.vertices).max(axis=0) for frame in frames], axis=0)
    while rung > 0 and not fits(far, rung, len(frames)):
        rung -= 1
    return rung
