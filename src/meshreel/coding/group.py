"""Encode a group in the form `laplacian`, and decode a group of any form by its first byte.

In -> out: reference mesh + displacement field <-> bytes (paper, section 3.3). Displacements are coded relative to the
decoded and subdivided reference, which both sides have.
"""

from __future__ import annotations

from itertools import accumulate

import numpy as np
from jaxtyping import Float64

from ..errors import FormatError
from ..format.budget import Size, check_cost, laplacian_cost
from ..format.layout import DracoGroup, Form, LaplacianGroup, LayersPatches
from ..format.records import pack, unpack_all
from ..geometry.topology import subdivide_midpoint
from ..types import Mesh, Placement
from .intra import decode_empty, decode_intra
from .layers.coder import LayersState, layers_bytes_by_purpose, place_layers, read_layers
from .layers.patches import decode_patches
from .mesh import check_growth, check_step, decode_mesh
from .paper.displacements import DisplacementOptions, claims_of, decode_displacements, encode_displacements, layer_sizes
from .reference_mesh import CodedReference


def encode_group(
    reference: CodedReference, field: Float64[np.ndarray, "V T 3"], options: DisplacementOptions
) -> tuple[bytes, tuple[int, ...]]:
    """Encode a `laplacian` group; return its payload and its layer ends: k + 1 layers decode with k components.

    Raises CostlyError where readers would refuse so few bytes for it.
    """
    displacements = encode_displacements(field, reference.base, options)
    record = LaplacianGroup(Form.LAPLACIAN, reference.levels, reference.step, reference.data, displacements)
    payload = pack(record)
    sizes = layer_sizes(displacements)
    layers = tuple(accumulate(sizes[1:], initial=len(payload) - sum(sizes[1:])))
    _check_growth(record, reference.mesh, layers[0])
    return payload, layers


def decode_group(data: bytes, frame_count: int, layers: int | None = None) -> list[Mesh]:
    """Decode the frames of a group of any form, in normalised units, from a whole payload or a prefix of its layers.

    `layers` limits the layers beyond the first: components of a `laplacian` group, levels of a `layers` group. Raises
    FormatError if the bytes are damaged, hold another number of frames, or need another group.
    """
    return continue_group(data, frame_count, layers, None)[0]


def continue_group(
    data: bytes, frame_count: int, layers: int | None, previous: LayersState | None, place: Placement | None = None
) -> tuple[list[Mesh], LayersState | None]:
    """Decode a group that may be predicted from the previous one; also return the state that predicts the next one.

    `previous` is the state returned for the previous group with the same `layers`; only the form `layers` has one. With
    `place`, the frames are in metres, if the form allows without another pass over them. Errors as in `decode_group`.
    """
    form = data[0] if data else None
    if form == Form.LAYERS:
        meshes, state = _decode_layers(data, layers, previous, place)
    else:
        meshes, state = _decode_alone(data, form, frame_count, layers), None
        if place is not None and form != Form.EMPTY:  # whose frames are one mesh
            meshes = [place.of(mesh) for mesh in meshes]
    if len(meshes) != frame_count:
        raise FormatError(f"a group of {len(meshes)} frames where the index says {frame_count}")
    return meshes, state


def _decode_alone(data: bytes, form: int | None, frame_count: int, layers: int | None) -> list[Mesh]:
    """Decode a group of a form that never needs another group."""
    if form == Form.EMPTY:
        return decode_empty(data, frame_count)
    if form == Form.DRACO:
        return decode_intra(data)
    if form == Form.LAPLACIAN:
        return _decode_laplacian(unpack_all(LaplacianGroup, data), len(data), layers)
    raise FormatError(f"group form {form} is not known to this reader")


def _decode_layers(
    data: bytes, levels: int | None, previous: LayersState | None, place: Placement | None
) -> tuple[list[Mesh], LayersState | None]:
    """Decode a `layers` group, with its patches if it has them and `levels` does not exclude them."""
    records = read_layers(data, levels)
    plain = records.end == len(data) or (levels is not None and levels <= records.head.levels)
    decoded = place_layers(records, previous, place, spare=not plain)
    if plain:
        return [Mesh(frame, decoded.faces) for frame in decoded.positions], decoded.state
    record = unpack_all(LayersPatches, data[records.end :])
    patches = decode_patches(record, records.head.frames, len(decoded.faces))
    return patches.apply(decoded.positions, decoded.faces, place, decoded.spare), decoded.state


def _decode_laplacian(record: LaplacianGroup, size: int, components: int | None) -> list[Mesh]:
    check_step(record.step)
    reference = decode_mesh(record.reference, record.step)
    _check_growth(record, reference, size)
    base = subdivide_midpoint(reference, record.levels)
    field = decode_displacements(record.displacements, base, components)
    return [Mesh(np.ascontiguousarray(base.vertices + field[:, t]), base.faces) for t in range(field.shape[1])]


def _check_growth(record: LaplacianGroup, reference: Mesh, size: int) -> None:
    """Raise FormatError if a group, of which `size` bytes are at hand, grows beyond the limits."""
    frames, components = claims_of(record.displacements)
    check_growth(reference, record.levels, frames)
    corners = np.bincount(reference.faces.reshape(-1)).astype(np.float64)
    cost = laplacian_cost(Size.of(reference, record.levels), frames, components, int(corners @ corners))
    check_cost(cost, size, "laplacian")


def payload_bytes_by_purpose(data: bytes) -> dict[str, int]:
    """Return the bytes of a payload by purpose. Raises FormatError on damaged bytes."""
    form = data[0] if data else None
    if form == Form.LAPLACIAN:
        record = unpack_all(LaplacianGroup, data)
        head, *components = layer_sizes(record.displacements)
        sizes = {"reference": len(record.reference), "basis": head, "displacements": sum(components)}
    elif form == Form.LAYERS:
        sizes = layers_bytes_by_purpose(data)
    elif form == Form.DRACO:
        sizes = {"draco": sum(len(mesh) for mesh in unpack_all(DracoGroup, data).meshes)}
    else:
        sizes = {}
    rest = len(data) - sum(sizes.values())
    if rest < 0:
        raise FormatError(f"a payload of {len(data)} bytes whose streams claim {-rest} more")
    return sizes | {"group head": rest}
