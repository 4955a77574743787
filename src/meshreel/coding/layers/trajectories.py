"""Encode the motion of the base mesh: the first layer of the form `layers`.

In: the places of the base mesh's vertices in every frame. Out: what moves all of them alike, a mean shift or a pose for
each frame, and their displacements from it, predicted in a hierarchy that both sides build from the base as decoded
(decisions 12 and 34).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ... import _core
from ...format.layout import CodedField, Common, Form, LayersGroup, Origin
from ...format.records import pack
from ...geometry.rigid import fit_rigid, multiply, quaternions
from ...geometry.topology import vertex_normals
from ...shapes import Float64, Int32
from ...types import Mesh
from .. import entropy
from .fields import Rate, SurfaceWeight, encode_field
from .graph import hierarchy

_RIGID = 0.25  # largest share of the energy of motion without its mean that poses leave where they are tried (guess)
_MOST_TURN = 2.0  # largest twice the tangent of half a turn from a frame to the next, 90 degrees (guess)


@dataclass(frozen=True, slots=True)
class EncodedMotion:
    """Motion of a base mesh as coded, and its places as they decode."""

    common: Common
    record: CodedField
    decoded: Float64[np.ndarray, "T V 3"]

    @property
    def size(self) -> int:
        """Bytes of the streams."""
        return len(self.record.basis) + len(self.record.symbols)


def encode_trajectories(
    positions: Float64[np.ndarray, "T V 3"], base: Mesh, rate: Rate, tangential: float
) -> EncodedMotion:
    """Encode the motion of the base's vertices, with a pose for each frame where that takes fewer bytes.

    `tangential` is the weight of a squared error along the surface: where on it a vertex lies hardly shows.
    """
    still = np.broadcast_to(base.vertices, positions.shape)
    plain = _encoded(positions, base, still, None, rate, tangential)
    poses = _poses(positions, base, rate)
    if poses is None:
        return plain
    alone = CodedField(0, rate.rung, entropy.encode_integers(poses), b"")
    head = LayersGroup(Form.LAYERS, Origin.PREVIOUS, len(positions), 0, 1.0, b"", Common.POSES, alone)
    posed = np.ascontiguousarray(np.moveaxis(decode_trajectories(pack(head), base, len(positions)), 2, 0))
    moved = positions - still
    if ((positions - posed) ** 2).sum() > _RIGID * ((moved - moved.mean(axis=1, keepdims=True)) ** 2).sum():
        return plain
    rigid = _encoded(positions, base, posed, poses, rate, tangential)
    return rigid if rigid.size < plain.size else plain


def decode_trajectories(record: bytes, base: Mesh, frames: int) -> Float64[np.ndarray, "V 3 T"]:
    """Decode the positions of the base's vertices in every frame, as rows.

    `record` is a packed LayersGroup of `frames` frames. Raises FormatError if it is damaged.
    """
    return _core.decode_motion(record, base.vertices, base.faces, frames)


def decode_last_places(record: bytes, base: Mesh, frames: int) -> Float64[np.ndarray, "V 3"]:
    """Decode the positions of the base's vertices in the last frame alone; otherwise as `decode_trajectories`."""
    return _core.decode_last_places(record, base.vertices, base.faces, frames)


def _encoded(
    positions: Float64[np.ndarray, "T V 3"],
    base: Mesh,
    alike: Float64[np.ndarray, "T V 3"],
    poses: Int32[np.ndarray, " N"] | None,
    rate: Rate,
    tangential: float,
) -> EncodedMotion:
    """Encode the displacements from where the vertices are if all move alike, as `poses` say, if any."""
    places = hierarchy(base)
    offsets = np.moveaxis(positions - alike, 0, 1)[places.order]
    frames = [vertex_normals(Mesh(np.ascontiguousarray(frame), base.faces)) for frame in positions]
    normals = np.stack(frames, axis=1)[places.order].reshape(len(base.vertices), -1)
    surface = SurfaceWeight(np.ascontiguousarray(normals), tangential)
    field = encode_field(offsets.reshape(len(base.vertices), -1), places.graph, rate, surface, poses)
    known = np.empty_like(positions)
    known[:, places.order] = np.moveaxis(field.decoded.reshape(offsets.shape), 0, 1) + alike[:, places.order]
    shared = Common.SHIFTS if field.has_mean else Common.NONE
    return EncodedMotion(shared if poses is None else Common.POSES, field.record, known)


def _poses(positions: Float64[np.ndarray, "T V 3"], base: Mesh, rate: Rate) -> Int32[np.ndarray, " N"] | None:
    """Return the integers of a pose for each frame (FORMAT.md, "Fields"); None where one turns too far."""
    frames, bits = len(positions), rate.common_bits
    turned = quaternions(
        fit_rigid(np.broadcast_to(base.vertices, positions.shape), positions, np.ones(positions.shape[:2]))[0]
    )
    shifts = np.rint(np.ldexp((positions - base.vertices).mean(axis=1), bits))
    turns, known = np.zeros((frames, 3)), np.array([[1.0, 0.0, 0.0, 0.0]])
    for t in range(frames):
        left = multiply(turned[t : t + 1], known * [1, -1, -1, -1])[0]
        if 2 * np.linalg.norm(left[1:]) > _MOST_TURN * abs(left[0]):
            return None
        turns[t] = np.rint(np.ldexp(2 * left[1:] / left[0], bits))
        known = multiply(np.append(1.0, np.ldexp(turns[t], -bits - 1))[None], known)
        known /= np.linalg.norm(known)
    steps = np.diff(shifts, axis=0, prepend=0)
    return np.concatenate([[bits], steps.ravel(), turns.ravel()]).astype(np.int32)
