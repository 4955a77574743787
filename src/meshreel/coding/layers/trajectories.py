"""Encode the motion of the base mesh: the first layer of the form `layers`.

In: the places of the base mesh's vertices in every frame. Out: their displacements from the base as decoded, predicted
in a hierarchy that both sides build from it (docs/decisions).
"""

from __future__ import annotations

import numpy as np

from ... import _core
from ...geometry.topology import vertex_normals
from ...shapes import Float64
from ...types import Mesh
from .fields import EncodedField, Rate, SurfaceWeight, encode_field
from .graph import hierarchy


def encode_trajectories(
    positions: Float64[np.ndarray, "T V 3"], base: Mesh, rate: Rate, tangential: float
) -> tuple[EncodedField, Float64[np.ndarray, "T V 3"]]:
    """Encode the motion of the base's vertices; return the field and the decoded positions.

    `tangential` is the weight of a squared error along the surface: where on it a vertex lies hardly shows.
    """
    places = hierarchy(base)
    offsets = np.moveaxis(positions - base.vertices, 0, 1)[places.order]
    frames = [vertex_normals(Mesh(np.ascontiguousarray(frame), base.faces)) for frame in positions]
    normals = np.stack(frames, axis=1)[places.order].reshape(len(base.vertices), -1)
    surface = SurfaceWeight(np.ascontiguousarray(normals), tangential)
    field = encode_field(offsets.reshape(len(base.vertices), -1), places.graph, rate, surface)
    known = np.empty_like(positions)
    known[:, places.order] = np.moveaxis(field.decoded.reshape(offsets.shape), 0, 1) + base.vertices[places.order]
    return field, known


def decode_trajectories(record: bytes, base: Mesh, frames: int) -> Float64[np.ndarray, "V 3 T"]:
    """Decode the positions of the base's vertices in every frame, as rows.

    `record` is a packed LayersGroup of `frames` frames. Raises FormatError if it is damaged.
    """
    return _core.decode_motion(record, base.vertices, base.faces, frames)


def decode_last_places(record: bytes, base: Mesh, frames: int) -> Float64[np.ndarray, "V 3"]:
    """Decode the positions of the base's vertices in the last frame alone; otherwise as `decode_trajectories`."""
    return _core.decode_last_places(record, base.vertices, base.faces, frames)
