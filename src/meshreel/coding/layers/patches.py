"""Encode patches where no template fits: for each frame, faces to drop and a small mesh to add (decision 13).

In -> out: for each frame of a group a mask over its faces and a mesh on a lattice <-> LayersPatches. Masks are runs
relative to the previous frame; the meshes of all frames are one Draco mesh, side by side, with a single head.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...errors import FormatError, InputError
from ...format.layout import LayersPatches
from ...shapes import Bool, Float64, Int32, Int64
from ...types import Mesh
from .. import entropy
from ..mesh import check_growth, decode_mesh, encode_mesh
from ..steps import RUNGS, step_of

MOST_CELLS = 1 << 20  # of the lattice, over all frames: as many as Draco's float32 positions can resolve


@dataclass(frozen=True, slots=True)
class Patches:
    """Changes to the frames of a group: dropped faces and added meshes."""

    dropped: Bool[np.ndarray, "T F"]  # faces that a frame does not show
    meshes: tuple[Mesh, ...]  # mesh added to each frame; possibly empty

    def apply(self, positions: Float64[np.ndarray, "T V 3"], faces: Int32[np.ndarray, "F 3"]) -> list[Mesh]:
        """Return the patched frames: vertices and faces of a patch follow those of the template."""
        frames = list[Mesh]()
        for points, gone, patch in zip(positions, self.dropped, self.meshes, strict=True):
            shown = faces[~gone] if gone.any() else faces
            if not patch.is_empty:
                shown = np.concatenate([shown, (patch.faces + len(points)).astype(np.int32)])
                points = np.concatenate([points, patch.vertices])
            frames.append(Mesh(points, shown))
        return frames


def fits(far: Float64[np.ndarray, " 3"], rung: int, frames: int) -> bool:
    """Return whether a lattice has cells for coordinates up to `far` in all frames, which lie in a row along x."""
    most = (np.array([MOST_CELLS // frames // 2, MOST_CELLS // 2, MOST_CELLS // 2]) - 0.75) * step_of(rung)
    return bool((far <= most).all())


def encode_patches(
    dropped: Bool[np.ndarray, "T F"], meshes: Sequence[Mesh], rung: int
) -> tuple[LayersPatches, tuple[Mesh, ...]]:
    """Encode patches; return the record and the meshes as they decode.

    Raises InputError if the meshes need more cells than Draco can resolve.
    """
    runs = encode_runs(dropped)
    width, side_by_side = _set_out(meshes, step_of(rung))
    data = encode_mesh(side_by_side, step_of(rung))
    record = LayersPatches(len(runs), entropy.encode_integers(runs), rung, width, data)
    return record, _taken_in(record, len(meshes))


def decode_patches(record: LayersPatches, frames: int, faces: int) -> Patches:
    """Decode the patches of a group whose finest level has `faces` faces. Raises FormatError on damaged records."""
    if record.step_level >= RUNGS:
        raise FormatError(f"patches: step level {record.step_level}, there are {RUNGS}")
    if record.runs > 2 * faces + frames * (faces + 1) + 2:
        raise FormatError(f"patches: {record.runs} runs over {frames} frames of {faces} faces")
    runs = entropy.decode_integers(record.dropped, record.runs)
    return Patches(decode_runs(runs, frames, faces), _taken_in(record, frames))


def encode_runs(dropped: Bool[np.ndarray, "T F"]) -> Int32[np.ndarray, " N"]:
    """Return run lengths of two bit sequences: faces ever dropped; then, for these, changes since the previous frame.

    Each begins with a run of bits that are not set, the only one that may be empty. No runs if nothing is dropped.
    """
    if not dropped.any():
        return np.zeros(0, np.int32)
    ever = dropped.any(axis=0)
    changing = dropped[:, ever]
    turned = changing ^ np.concatenate([np.zeros((1, changing.shape[1]), bool), changing[:-1]])
    return np.concatenate([run_lengths(np.asarray(ever)), run_lengths(turned.reshape(-1))])


def decode_runs(runs: Int32[np.ndarray, " N"], frames: int, faces: int) -> Bool[np.ndarray, "T F"]:
    """Return the mask of dropped faces. Raises FormatError if the runs do not fill it exactly."""
    dropped = np.zeros((frames, faces), bool)
    if len(runs) == 0:
        return dropped
    ever, rest = fill_runs(runs, faces)
    count = int(ever.sum())
    turned, rest = fill_runs(rest, frames * count)
    if len(rest):
        raise FormatError(f"patches: {len(rest)} runs too many")
    dropped[:, np.flatnonzero(ever)] = np.logical_xor.accumulate(turned.reshape(frames, count), axis=0)
    return dropped


def run_lengths(bits: Bool[np.ndarray, " N"]) -> Int32[np.ndarray, " R"]:
    """Return the lengths of alternating runs of bits, beginning with bits that are not set; only the first may be 0."""
    turns = np.flatnonzero(np.diff(bits, prepend=False))
    return np.diff(np.concatenate([[0], turns, [len(bits)]])).astype(np.int32)


def fill_runs(runs: Int32[np.ndarray, " N"], count: int) -> tuple[Bool[np.ndarray, " C"], Int32[np.ndarray, " R"]]:
    """Return `count` bits from the first runs, and the remaining runs. FormatError if no run ends with the bits."""
    if (runs < 0).any():
        raise FormatError("patches: a run of negative length")
    ends = np.cumsum(runs.astype(np.int64))
    last = int(np.searchsorted(ends, count))
    if last >= len(runs) or ends[last] != count:
        raise FormatError(f"patches: runs that do not end with the {count} faces they describe")
    if (runs[1 : last + 1] == 0).any():
        raise FormatError("patches: a run without length")
    return np.repeat(np.arange(last + 1) % 2 == 1, runs[: last + 1]), runs[last + 1 :]


def _set_out(meshes: Sequence[Mesh], step: float) -> tuple[int, Mesh]:
    """Return the cells of a frame along x, and the meshes joined, with that of frame t shifted by t frames."""
    cells = [np.rint(mesh.vertices / step).astype(np.int64) for mesh in meshes]
    width = 2 * max((int(np.abs(points[:, 0]).max(initial=0)) for points in cells), default=0) + 2
    if width * len(meshes) > MOST_CELLS:
        raise InputError(f"patches of {len(meshes)} frames, {width} cells wide: raise the step")
    starts = np.cumsum([0, *(len(points) for points in cells)])
    moved = [points + [t * width, 0, 0] for t, points in enumerate(cells)]
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return width, Mesh.of(np.concatenate(moved) * step, np.concatenate(faces))


def _taken_in(record: LayersPatches, frames: int) -> tuple[Mesh, ...]:
    """Decode the mesh of a record and separate it into the meshes of the frames."""
    step = step_of(record.step_level)
    mesh = decode_mesh(record.mesh, step)
    if mesh.is_empty:
        return (Mesh.empty(),) * frames
    check_growth(mesh, 0)
    if not 0 < record.width * frames <= MOST_CELLS or np.abs(mesh.vertices).max() > 2 * MOST_CELLS * step:
        raise FormatError(f"patches: {frames} frames, {record.width} cells wide")
    cells = np.rint(mesh.vertices / step).astype(np.int64)
    of_vertices = (cells[:, 0] + record.width // 2) // record.width
    of_faces = of_vertices[mesh.faces]
    if of_faces.min() < 0 or of_faces.max() >= frames or (of_faces != of_faces[:, :1]).any():
        raise FormatError(f"patches: a face that is in none of {frames} frames, or in two")
    cells[:, 0] -= of_vertices * record.width
    return _parted(Mesh(cells * step, mesh.faces), of_vertices, of_faces[:, 0], frames)


def _parted(
    mesh: Mesh, of_vertices: Int64[np.ndarray, " V"], of_faces: Int64[np.ndarray, " F"], frames: int
) -> tuple[Mesh, ...]:
    """Separate a mesh into frames, keeping the order of faces and vertices; one pass for any number of frames."""
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.faces.reshape(-1)] = True
    numbers = np.flatnonzero(used)
    numbers = numbers[np.argsort(of_vertices[numbers], kind="stable")]
    place = np.zeros(len(used), np.int64)
    place[numbers] = np.arange(len(numbers))
    order = np.argsort(of_faces, kind="stable")
    points, faces = mesh.vertices[numbers], place[mesh.faces[order]]
    starts = np.searchsorted(of_vertices[numbers], np.arange(frames + 1)).tolist()
    ends = np.searchsorted(of_faces[order], np.arange(frames + 1)).tolist()
    spans = zip(pairwise(starts), pairwise(ends), strict=True)
    return tuple(Mesh.of(points[a:b].copy(), faces[c:d] - a) for (a, b), (c, d) in spans)
