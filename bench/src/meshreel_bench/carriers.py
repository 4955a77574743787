"""Carriers of splats in each frame of a stream: the meshes of chains of groups. Bytes of a .reel file -> chains."""

from __future__ import annotations

from meshreel.coding.colored import canvas_of
from meshreel.coding.group import continue_group
from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource
from meshreel.format.layout import Form
from meshreel.geometry.splats import Carrier
from meshreel.types import Mesh, Placement

Chain = list[tuple[int, Carrier]]  # numbers of frames, and what carries splats there


def chains_of(data: bytes) -> list[Chain]:
    """Return the chains of groups of one track, frames of other forms than one mesh alone."""
    reader, state, chains = ReelReader(BytesSource(data)), None, list[Chain]()
    place = Placement(reader.header.scale, reader.header.origin)
    for chunk in reader.tracks[0]:
        before = state if reader.group_before(chunk) is not None else None
        payload = reader.read_chunk(chunk.number)
        meshes, state = continue_group(payload, chunk.frame_count, None, before, place)
        numbers = range(chunk.first_frame, chunk.first_frame + chunk.frame_count)
        if chunk.form not in (Form.LAYERS, Form.LAPLACIAN):
            chains += [[(k, alone(mesh))] for k, mesh in zip(numbers, meshes, strict=True)]
            continue
        canvas = canvas_of(payload, [len(mesh.vertices) for mesh in meshes], None, before)
        carried = list(zip(numbers, canvas.carriers(meshes), strict=True))
        chains = [*chains[:-1], chains[-1] + carried] if before is not None else [*chains, carried]
    return chains


def alone(mesh: Mesh) -> Carrier:
    """Return the carrier of splats in a frame that shares no faces with others."""
    return Carrier(mesh.vertices, mesh.faces, 0)
