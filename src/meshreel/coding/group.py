"""A group of frames and its payload: the `laplacian` form, and the choice of the decoder by the first byte.

In -> out: reference mesh + displacement field <-> bytes (paper, section 3.3). The displacements are coded against the
reference as decoded and subdivided, which both sides have.
"""

from __future__ import annotations

from itertools import accumulate

import numpy as np
from jaxtyping import Float64

from ..errors import FormatError
from ..format.layout import DracoGroup, Form, LaplacianGroup, LayersPatches
from ..format.records import pack, unpack_all
from ..geometry.topology import subdivide_midpoint
from ..types import Mesh
from .displacements import DisplacementOptions, decode_displacements, encode_displacements, frames_of, layer_sizes
from .intra import decode_empty, decode_intra
from .layers import LayersState, decode_layers, layers_end, layers_parts
from .mesh import check_growth, check_step, decode_mesh
from .patches import decode_patches
from .reference import CodedReference


def encode_group(
    reference: CodedReference, field: Float64[np.ndarray, "V T 3"], options: DisplacementOptions
) -> tuple[bytes, tuple[int, ...]]:
    """The payload of a `laplacian` group and its layer ends: k + 1 layers decode with k components."""
    displacements = encode_displacements(field, reference.base, options)
    record = LaplacianGroup(Form.LAPLACIAN, reference.levels, reference.step, reference.data, displacements)
    payload = pack(record)
    sizes = layer_sizes(displacements)
    return payload, tuple(accumulate(sizes[1:], initial=len(payload) - sum(sizes[1:])))


def decode_group(data: bytes, frame_count: int, layers: int | None = None) -> list[Mesh]:
    """The frames of a group in normalised units, of whatever form, from a whole payload or a prefix of its layers.

    With `layers`, at most so many beyond the first: components of a `laplacian` group, levels of a `layers` group.
    Raises FormatError where the bytes are damaged, hold another number of frames, or need another group.
    """
    return continue_group(data, frame_count, layers, None)[0]


def continue_group(
    data: bytes, frame_count: int, layers: int | None, previous: LayersState | None
) -> tuple[list[Mesh], LayersState | None]:
    """As `decode_group`, of a group that may be predicted from the one before; and what the next may be predicted from.

    `previous` is what this gave for the group before, with the same `layers`. Only the form `layers` has such a state.
    """
    form = data[0] if data else None
    state = None
    if form == Form.EMPTY:
        meshes = decode_empty(data, frame_count)
    elif form == Form.DRACO:
        meshes = decode_intra(data)
    elif form == Form.LAPLACIAN:
        meshes = _decode_laplacian(unpack_all(LaplacianGroup, data), layers)
    elif form == Form.LAYERS:
        meshes, state = _decode_layers(data, layers, previous)
    else:
        raise FormatError(f"group form {form} is not known to this reader")
    if len(meshes) != frame_count:
        raise FormatError(f"a group of {len(meshes)} frames where the index says {frame_count}")
    return meshes, state


def _decode_layers(
    data: bytes, levels: int | None, previous: LayersState | None
) -> tuple[list[Mesh], LayersState | None]:
    """Frames of a payload, with their patches where it has them and more layers than its levels are wanted."""
    head, end = layers_end(data, levels)
    faces, positions, state = decode_layers(data[:end], levels, previous)
    if end == len(data) or (levels is not None and levels <= head.levels):
        return [Mesh(frame, faces) for frame in positions], state
    record = unpack_all(LayersPatches, data[end:])
    patches = decode_patches(record, head.frames, len(faces))
    return patches.apply(positions, faces), state


def _decode_laplacian(record: LaplacianGroup, components: int | None) -> list[Mesh]:
    check_step(record.step)
    reference = decode_mesh(record.reference, record.step)
    check_growth(reference, record.levels, frames_of(record.displacements))
    base = subdivide_midpoint(reference, record.levels)
    field = decode_displacements(record.displacements, base, components)
    return [Mesh(np.ascontiguousarray(base.vertices + field[:, t]), base.faces) for t in range(field.shape[1])]


def payload_parts(data: bytes) -> dict[str, int]:
    """Bytes of a payload by what they are for. Raises FormatError on damaged bytes."""
    form = data[0] if data else None
    if form == Form.LAPLACIAN:
        record = unpack_all(LaplacianGroup, data)
        head, *components = layer_sizes(record.displacements)
        parts = {"reference": len(record.reference), "basis": head, "displacements": sum(components)}
    elif form == Form.LAYERS:
        parts = layers_parts(data)
    elif form == Form.DRACO:
        parts = {"draco": sum(len(mesh) for mesh in unpack_all(DracoGroup, data).meshes)}
    else:
        parts = {}
    return parts | {"group head": len(data) - sum(parts.values())}
