"""Bodies in the colours of a solid that they are cut from: the same place of a body has the same colour in all frames.

Bodies whose connectivity stays are coloured by their first frame; of others a template is tracked, at a quality above
all that are compared, and carries the colours.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from jaxtyping import Float64, UInt8

from meshreel.coding.colored import canvas_of
from meshreel.coding.group import continue_group
from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource
from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.settings import Settings
from meshreel.errors import InputError
from meshreel.format.layout import Form
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.color_views import Painted
from meshreel.geometry.derived_sequences import DerivedSequence
from meshreel.geometry.splats import Carrier
from meshreel.geometry.topology import blend, subdivide_midpoint
from meshreel.types import Mesh, MeshSequence, Placement, Texture

from . import REMESHED, Store

STRIPE, GRAIN = 0.1, 0.02  # m, periods of the colours
FINER = 2  # midpoint subdivisions before vertices get colours, which then have some millimetres of detail
TRACKED = 80.0  # quality of a template that carries colours
CELL = 6  # pixels of the square that a face has in a texture: about 3 mm each on bodies of 10,000 vertices


def in_colours(source: MeshSequence, painted: Callable[[int], Mesh]) -> DerivedSequence:
    """Return the frames, each with a texture of its own: a square for each face; `painted` returns one in colour."""

    @cache  # some 2 MB each: painting takes a second
    def frame(number: int) -> Mesh:
        mesh = source[number]
        is_bare = not (mesh.is_colored or mesh.is_empty)
        return textured(mesh, Painted(painted(number))) if is_bare else mesh

    return DerivedSequence(source, lambda _, number: frame(number))


def textured(mesh: Mesh, paint: Painted) -> Mesh:
    """Return a mesh with a texture that has a square of `CELL` pixels for each face, whose half shows the face."""
    across = math.ceil(math.sqrt(len(mesh.faces)))
    row, column = np.divmod(np.arange(len(mesh.faces)), across)
    corners = np.array([[0.5, 0.5], [CELL - 0.5, 0.5], [0.5, CELL - 0.5]])
    uv = (corners + CELL * np.column_stack([column, across - 1 - row])[:, None]) / (CELL * across)
    y, x = np.mgrid[:CELL, :CELL].reshape(2, -1) / (CELL - 1)  # from the square's lower left
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)[..., None, :]
    places = a + x[:, None] * (b - a) + y[:, None] * (c - a)
    colors = paint.at(places.reshape(-1, 3), np.zeros((places.size // 3, 3)))[0].reshape(-1, CELL, CELL, 3)
    squares = np.zeros((across * across, CELL, CELL, 3), np.uint8)
    squares[: len(colors)] = np.round(colors[:, ::-1])
    pixels = squares.reshape(across, across, CELL, CELL, 3).swapaxes(1, 2).reshape(across * CELL, across * CELL, 3)
    return replace(mesh, uv=uv.astype(np.float32), texture=Texture.of(pixels))


def solid_colors(points: Float64[np.ndarray, "N 3"]) -> UInt8[np.ndarray, "N 3"]:
    """Return the colours of places in a solid: stripes of two colours, with a grain."""
    stripes = np.sin(2 * np.pi / STRIPE * points[:, 1:2]) > 0
    grain = np.sin(2 * np.pi / GRAIN * points + [0.0, 1.0, 2.0]).prod(axis=1, keepdims=True)
    side = np.where(points[:, :1] > 0, [[205, 160, 120]], [[190, 200, 215]])
    return np.clip(np.where(stripes, side, [[60, 70, 110]]) * (1 + 0.4 * grain), 0, 255).astype(np.uint8)


def coloured(name: str, store: Store, frames: int | None) -> Callable[[int], Mesh]:
    """Return a function of a frame's number: the frame in colour, its own where it has a texture."""
    if name in REMESHED:
        source = store.open(REMESHED[name][0], frames or REMESHED[name][1]).sequence
        rest = subdivide_midpoint(source[0], FINER)
        colors = solid_colors(rest.vertices)
        return lambda number: Mesh(subdivide_midpoint(source[number], FINER).vertices, rest.faces, colors)
    sequence = store.open(name, frames).sequence
    if sequence[0].is_colored:
        return lambda number: sequence[number]
    template = cache(lambda: _tracked(sequence))  # which carries the colours

    def painted(number: int) -> Mesh:
        mesh, carrier, rest = subdivide_midpoint(sequence[number], 1), template()[number], template()[0]
        hits = Surface(carrier).closest(mesh.vertices)
        return replace(mesh, colors=solid_colors(blend(rest.vertices, rest.faces[hits.faces], hits.barycentric)))

    return painted


def _tracked(sequence: MeshSequence) -> list[Mesh]:
    """Return a template in all frames: that of the first chain of groups, which must be the only one."""
    with tempfile.TemporaryDirectory() as folder:
        path, size = Path(folder, "template.reel"), min(len(sequence), 64)
        options = Settings(quality=TRACKED, color="none", group_size=size, dynamic_only=True)
        Encoder(sequence).encode(path, options.resolved())
        chains = chains_of(path.read_bytes())
    if len(chains) > 1:
        raise InputError(f"a template cannot be tracked: {len(chains)} chains; give fewer frames")
    return [Mesh(carrier.vertices, carrier.faces) for _, carrier in chains[0]]


Chain = list[tuple[int, Carrier]]  # numbers of frames, and what carries splats there


def chains_of(data: bytes) -> list[Chain]:
    """Return the chains of groups of one track, frames of other forms than one mesh alone."""
    reader, state, chains = ReelReader(BytesSource(data)), None, list[Chain]()
    place = Placement(reader.header.scale, reader.header.origin)
    for chunk in reader.tracks[0]:
        before = state if reader.group_before(chunk) is not None else None
        payload = reader.read_chunk(chunk.number)
        normalised, state = continue_group(payload, chunk.frame_count, None, before)
        meshes = [place.of(mesh) for mesh in normalised]
        numbers = range(chunk.first_frame, chunk.first_frame + chunk.frame_count)
        if chunk.form not in (Form.LAYERS, Form.LAPLACIAN):
            chains += [[(k, Carrier(mesh.vertices, mesh.faces, 0))] for k, mesh in zip(numbers, meshes, strict=True)]
            continue
        canvas = canvas_of(payload, [len(mesh.vertices) for mesh in meshes], None, before)
        carried = list(zip(numbers, canvas.carriers(meshes), strict=True))
        chains = [*chains[:-1], chains[-1] + carried] if before is not None else [*chains, carried]
    return chains
