"""Decode a group of any form by its first byte.

In: the payload of a group, and the state of the group that predicts it. Out: its frames. The rare form `laplacian` is
imported on first use.
"""

from __future__ import annotations

from ..errors import FormatError
from ..format.layout import DracoGroup, Form
from ..format.records import unpack_all
from ..types import Mesh
from .layers.coder import LayersState, decode_records, layers_bytes_by_purpose, patches_of, read_layers
from .mesh import decode_empty, decode_intra


def decode_group(data: bytes, frame_count: int, layers: int | None = None) -> list[Mesh]:
    """Decode the frames of a group of any form, in normalised units, from a whole payload or a prefix of its layers.

    `layers` limits the layers beyond the first: components of a `laplacian` group, levels of a `layers` group. Raises
    FormatError if the bytes are damaged, hold another number of frames, or need another group.
    """
    return continue_group(data, frame_count, layers, None)[0]


def continue_group(
    data: bytes, frame_count: int, layers: int | None, previous: LayersState | None
) -> tuple[list[Mesh], LayersState | None]:
    """Decode a group that may be predicted from the previous one; also return the state that predicts the next one.

    `previous` is the state returned for the previous group with the same `layers`; only the form `layers` has one.
    Errors as in `decode_group`.
    """
    form, state = data[0] if data else None, None
    if form == Form.LAYERS:
        meshes, state = _decode_layers(data, layers, previous)
    elif form == Form.EMPTY:
        meshes = decode_empty(data, frame_count)
    elif form == Form.DRACO:
        meshes = decode_intra(data)
    elif form == Form.LAPLACIAN:
        from .paper.displacements import decode_laplacian

        meshes = decode_laplacian(data, layers)
    else:
        raise FormatError(f"group form {form} is not known to this reader")
    if len(meshes) != frame_count:
        raise FormatError(f"a group of {len(meshes)} frames where the index says {frame_count}")
    return meshes, state


def _decode_layers(data: bytes, levels: int | None, previous: LayersState | None) -> tuple[list[Mesh], LayersState]:
    """Decode a `layers` group, with its patches if it has them and `levels` does not exclude them."""
    records = read_layers(data, levels)
    faces, positions, state = decode_records(records, previous)
    patches = patches_of(data, records, levels, len(faces))
    if patches is None:
        return [Mesh(frame, faces) for frame in positions], state
    return patches.apply(positions, faces), state


def payload_bytes_by_purpose(data: bytes) -> dict[str, int]:
    """Return the bytes of a payload by purpose. Raises FormatError on damaged bytes."""
    form = data[0] if data else None
    if form == Form.LAPLACIAN:
        from .paper.displacements import laplacian_bytes_by_purpose

        sizes = laplacian_bytes_by_purpose(data)
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
