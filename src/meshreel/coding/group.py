"""Decode a group of any form by its first byte.

In: the payload of a group, and the state of the group that predicts it. Out: its frames. The rare form `laplacian` is
imported on first use.
"""

from __future__ import annotations

from ..errors import FormatError
from ..format.layout import DracoGroup, Form
from ..format.records import unpack_all
from ..types import Mesh, Placement
from .intra import decode_empty, decode_intra
from .layers.coder import (
    LayersState,
    has_patches,
    layers_bytes_by_purpose,
    patches_of,
    place_layers,
    read_layers,
    state_after,
)


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
    `place`, the frames are in metres. Errors as in `decode_group`.
    """
    form = _form_of(data)
    if form == Form.LAYERS:
        meshes, state = _decode_layers(data, layers, previous, place)
    else:
        meshes, state = _decode_alone(data, form, frame_count, layers), None
        if place is not None and form != Form.EMPTY:  # empty frames are one mesh
            meshes = [place.of(mesh) for mesh in meshes]
    _check_count(len(meshes), frame_count)
    return meshes, state


def skip_group(data: bytes, frame_count: int, layers: int | None, previous: LayersState | None) -> LayersState | None:
    """Return the state that `continue_group` returns, without decoding the frames of the group. Errors as there."""
    if _form_of(data) != Form.LAYERS:
        return None
    records = read_layers(data, layers)
    _check_count(records.head.frames, frame_count)
    return state_after(records, previous)


def _form_of(data: bytes) -> int | None:
    return data[0] if data else None


def _check_count(frames: int, frame_count: int) -> None:
    if frames != frame_count:
        raise FormatError(f"a group of {frames} frames where the index says {frame_count}")


def _decode_alone(data: bytes, form: int | None, frame_count: int, layers: int | None) -> list[Mesh]:
    """Decode a group of a form that never needs another group."""
    if form == Form.EMPTY:
        return decode_empty(data, frame_count)
    if form == Form.DRACO:
        return decode_intra(data)
    if form == Form.LAPLACIAN:
        from .paper.group import decode_laplacian

        return decode_laplacian(data, layers)
    raise FormatError(f"group form {form} is not known to this reader")


def _decode_layers(
    data: bytes, levels: int | None, previous: LayersState | None, place: Placement | None
) -> tuple[list[Mesh], LayersState | None]:
    """Decode a `layers` group, with its patches if it has them and `levels` does not exclude them."""
    records = read_layers(data, levels)
    decoded = place_layers(records, previous, place, spare=has_patches(data, records, levels))
    patches = patches_of(data, records, levels, len(decoded.faces))
    if patches is None:
        return [Mesh(frame, decoded.faces) for frame in decoded.positions], decoded.state
    return patches.apply(decoded.positions, decoded.faces, place, decoded.spare), decoded.state


def payload_bytes_by_purpose(data: bytes) -> dict[str, int]:
    """Return the bytes of a payload by purpose. Raises FormatError on damaged bytes."""
    form = _form_of(data)
    if form == Form.LAPLACIAN:
        from .paper.group import laplacian_bytes_by_purpose

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
