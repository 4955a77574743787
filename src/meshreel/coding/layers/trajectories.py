"""Encode the motion of the base mesh: the first layer of the form `layers`.

In: the positions of the base mesh's vertices in every frame. Out: their shared motion, a mean shift or a pose for each
frame, and their displacements from it, predicted in a hierarchy that both sides build from the decoded base (decisions
12 and 34).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ... import _core
from ...format.layout import CodedField, SharedMotion
from ...geometry import strict
from ...geometry.rigid import fit_rigid, multiply, quaternions
from ...geometry.strict import rotations_of
from ...geometry.topology import vertex_normals
from ...shapes import Float64, Int32
from ...types import Mesh
from .fields import NOTHING, Rate, SurfaceWeight, encode_field
from .graph import hierarchy

MOST_BITS = 30  # fraction bits of shared motion, so that a shift by a diagonal fits 32 bits
_RIGID = 0.25  # largest share of the energy of motion without its mean that poses may leave (guess)
_MOST_TURN = 2.0  # largest turn between frames, as twice the tangent of its half: 90 degrees (guess)


@dataclass(frozen=True, slots=True)
class _Alike:
    """Motion shared by all vertices: its integers (FORMAT.md, "Fields"), and the positions that it gives them."""

    kind: SharedMotion
    head: Int32[np.ndarray, " N"]
    places: Float64[np.ndarray, "T V 3"]


def encode_trajectories(
    positions: Float64[np.ndarray, "T V 3"], base: Mesh, rate: Rate, tangential: float
) -> tuple[SharedMotion, CodedField]:
    """Encode the motion of the base's vertices, with a pose for each frame if that takes fewer bytes.

    `tangential` is the weight of a squared error along the surface, where sliding hardly shows.
    """
    order, graph = hierarchy(base)
    frames = [vertex_normals(Mesh(np.ascontiguousarray(frame), base.faces)) for frame in positions]
    normals = np.stack(frames, axis=1)[order].reshape(len(base.vertices), -1)
    surface, coded = SurfaceWeight(np.ascontiguousarray(normals), tangential), list[tuple[SharedMotion, CodedField]]()
    # Shared motion is rounded to a sixteenth of a step.
    bits = min(max(strict.ceil_log2(8.0 / rate.step), 0), MOST_BITS)
    for alike in (_shifts(positions, base, rate, bits), _poses(positions, base, bits)):
        if alike is not None:
            offsets = np.moveaxis(positions - alike.places, 0, 1)[order].reshape(normals.shape)
            coded.append((alike.kind, encode_field(offsets, graph, rate, surface, alike.head).record))
    return min(coded, key=lambda pair: len(pair[1].basis) + len(pair[1].symbols))


def decode_trajectories(record: bytes, base: Mesh, frames: int) -> Float64[np.ndarray, "V 3 T"]:
    """Decode the positions of the base's vertices in every frame, as rows.

    `record` is a packed LayersGroup of `frames` frames. Raises FormatError if it is damaged.
    """
    return _core.decode_motion(record, base.vertices, base.faces, frames)


def _shifts(positions: Float64[np.ndarray, "T V 3"], base: Mesh, rate: Rate, bits: int) -> _Alike:
    """Return the mean shift of each frame; no motion if it does not pay."""
    offsets = positions - base.vertices
    mean = np.rint(np.ldexp(offsets.mean(axis=1), bits))
    worth = rate.price * rate.step**2 * strict.log2(2 * np.abs(mean) + 1).sum()
    if not len(base.vertices) * (np.ldexp(mean, -bits) ** 2).sum() > worth:
        return _Alike(SharedMotion.NONE, NOTHING, np.broadcast_to(base.vertices, positions.shape))
    head = np.append(bits, mean.ravel()).astype(np.int32)
    return _Alike(SharedMotion.SHIFTS, head, base.vertices + np.ldexp(mean, -bits)[:, None])


def _poses(positions: Float64[np.ndarray, "T V 3"], base: Mesh, bits: int) -> _Alike | None:
    """Return a pose for each frame; None if one turns too far, or if poses explain little of the motion."""
    rest = np.broadcast_to(base.vertices, positions.shape)
    turned = quaternions(fit_rigid(rest, positions, np.ones(positions.shape[:2]))[0])
    shifts = np.rint(np.ldexp((positions - rest).mean(axis=1), bits))
    turns, decoded_turn = np.zeros((len(positions), 3)), np.array([[1.0, 0.0, 0.0, 0.0]])
    for t in range(len(positions)):
        remaining = multiply(turned[t : t + 1], decoded_turn * [1, -1, -1, -1])[0]
        if 2 * strict.norm(remaining[1:]) > _MOST_TURN * abs(remaining[0]):
            return None
        turns[t] = np.rint(np.ldexp(2 * remaining[1:] / remaining[0], bits))
        decoded_turn = multiply(np.append(1.0, np.ldexp(turns[t], -bits - 1))[None], decoded_turn)
        decoded_turn /= strict.norm(decoded_turn)
        turned[t] = decoded_turn[0]
    middle = base.vertices.mean(axis=0)
    arms = np.broadcast_to(base.vertices - middle, positions.shape)
    away = strict.products(arms, np.swapaxes(rotations_of(turned), 1, 2))
    posed = away + middle + np.ldexp(shifts, -bits)[:, None]
    free = positions - rest - (positions - rest).mean(axis=1, keepdims=True)
    if ((positions - posed) ** 2).sum() > _RIGID * (free**2).sum():
        return None
    steps = np.diff(shifts, axis=0, prepend=0)
    head = np.concatenate([[bits], steps.ravel(), turns.ravel()]).astype(np.int32)
    return _Alike(SharedMotion.POSES, head, posed)
