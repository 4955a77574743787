"""Colours of the vertices of a group of any form, or of a background: the meshes that they are coded over.

In: the payload of a group, and the state of the group that it is predicted from. Out: its meshes before they are
subdivided, and for each frame the colours of its vertices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..errors import FormatError
from ..format.budget import check_colors
from ..format.layout import DracoGroup, Form, LaplacianGroup, StaticPatch
from ..format.records import unpack_all
from ..geometry.atlas import Layout
from ..geometry.splats import Carrier
from ..geometry.subdivision import levels_of
from ..geometry.topology import concatenate
from ..shapes import Bool, Float32, Float64, Int32, UInt8
from ..types import Mesh
from .appearance.colors import ColorCodingOptions, ColoredMesh, EncodedColors, decode_colors, encode_colors
from .layers.coder import LayersState, base_of, patches_of, read_layers
from .mesh import decode_mesh


@dataclass(frozen=True, slots=True)
class Canvas:
    """The meshes of a group whose vertices have colours: one for all frames, or one for each."""

    meshes: tuple[ColoredMesh, ...]
    patches: tuple[int, ...] = ()  # vertices of the patch of each frame, which the last of the meshes has together
    is_layered: bool = False  # each level of the first mesh is a layer
    dropped: Bool[np.ndarray, "T F"] | None = None  # faces of the template that each frame lacks
    added: tuple[int, ...] = ()  # faces of the patch of each frame
    empty: tuple[int, ...] = ()  # frames without surface, where each has a mesh of its own: they have none

    def uv(self, layout: Layout) -> list[Float32[np.ndarray, "_ 3 2"]]:
        """Return the places of the corners of each frame's faces in a texture; NaN for those of patches."""
        template = self.meshes[0]
        whole = layout.uv(template.levels)
        if self.dropped is None:
            return [whole] * template.frames
        found = list[Float32[np.ndarray, "_ 3 2"]]()
        for gone, added in zip(self.dropped, self.added, strict=True):
            kept = whole[~gone] if gone.any() else whole
            found.append(np.concatenate([kept, np.full((added, 3, 2), np.nan, np.float32)]) if added else kept)
        return found

    def carriers(self, frames: Sequence[Mesh], unit: float = 1.0) -> list[Carrier]:
        """Return what carries splats in each frame: the template, where it is and what of it the frame lacks.

        `unit` is that of normalised coordinates in the frames.
        """
        template, lacking = self.meshes[0], self.dropped
        faces = finest_faces(template.base, template.levels)
        return [
            Carrier(
                np.ascontiguousarray(mesh.vertices[: template.vertices]),
                faces,
                template.levels,
                None if lacking is None else lacking[number],
                unit,
            )
            for number, mesh in enumerate(frames)
        ]

    def by_frame(self, colors: Sequence[UInt8[np.ndarray, "_ _ 3"]]) -> list[UInt8[np.ndarray, "_ 3"]]:
        """Return the colours of the vertices of each frame from those of the meshes."""
        if not self.patches:
            found = [frame for some in colors for frame in some]
            for number in self.empty:
                found.insert(number, np.zeros((0, 3), np.uint8))
            return found
        template, [added] = colors
        bounds = pairwise(np.cumsum([0, *self.patches]).tolist())
        return [np.concatenate([frame, added[a:b]]) for frame, (a, b) in zip(template, bounds, strict=True)]

    def by_mesh(self, colors: Sequence[UInt8[np.ndarray, "_ 3"]]) -> list[UInt8[np.ndarray, "_ _ 3"]]:
        """Return the colours of the vertices of each mesh from those of the frames."""
        if not self.patches:
            found, rest = list[UInt8[np.ndarray, "_ _ 3"]](), list(colors)
            for number in reversed(self.empty):
                del rest[number]
            for mesh in self.meshes:
                found.append(np.stack(rest[: mesh.frames]))
                rest = rest[mesh.frames :]
            return found
        shared = self.meshes[0].vertices
        added = np.concatenate([frame[shared:] for frame in colors])
        return [np.stack([frame[:shared] for frame in colors]), added[None]]


def canvas_of(
    data: bytes, counts: Sequence[int], layers: int | None = None, previous: LayersState | None = None
) -> Canvas:
    """Return the meshes of a payload, or of a prefix of its layers, whose frames have so many vertices.

    Raises FormatError as `continue_group` does.
    """
    form = data[0] if data else None
    if form == Form.LAYERS:
        records = read_layers(data, layers)
        base, levels = base_of(records, previous), len(records.layers) - 1
        found = patches_of(data, records, layers, 4**levels * len(base.faces))
        if found is None:
            return Canvas((ColoredMesh(base, levels, len(counts), counts[0]),), is_layered=True)
        added = tuple(len(mesh.vertices) for mesh in found.meshes)
        template = ColoredMesh(base, levels, len(counts), counts[0] - added[0])
        faces = tuple(len(mesh.faces) for mesh in found.meshes)
        if not any(added):
            return Canvas((template,), is_layered=True, dropped=found.dropped, added=faces)
        patch = ColoredMesh(concatenate(found.meshes), 0, 1, sum(added))
        return Canvas((template, patch), added, True, found.dropped, faces)
    if form == Form.LAPLACIAN:
        record = unpack_all(LaplacianGroup, data)
        reference = decode_mesh(record.reference, record.step)
        return Canvas((ColoredMesh(reference, record.levels, len(counts), counts[0]),))
    if form == Form.DRACO:
        group = unpack_all(DracoGroup, data)
        pairs = zip(group.meshes, counts, strict=True)
        meshes = (ColoredMesh(decode_mesh(one, group.step), group.levels, 1, n) for one, n in pairs if n)
        return Canvas(tuple(meshes), empty=tuple(t for t, n in enumerate(counts) if not n))
    return Canvas((), empty=tuple(range(len(counts))))


def encode_group_colors(
    canvas: Canvas,
    colors: Sequence[UInt8[np.ndarray, "_ 3"]],
    options: ColorCodingOptions,
    before: Float64[np.ndarray, "V 3"] | None,
) -> EncodedColors:
    """Encode the colours of the vertices of each frame of a group; CostlyError where a reader would refuse them."""
    encoded = encode_colors(canvas.meshes, canvas.by_mesh(colors), options, before, canvas.is_layered)
    _check_cost(canvas, len(encoded.payload))
    return encoded


def decode_group_colors(
    data: bytes, canvas: Canvas, before: LayersState | None, after: LayersState | None
) -> tuple[list[UInt8[np.ndarray, "_ 3"]], LayersState | None]:
    """Decode the colours of the vertices of each frame of a group, by the states of geometry before and after it.

    Return also the state after it with what the next colours are predicted from. Raises FormatError where the colours
    are damaged, or need those of a group that are not at hand.
    """
    _check_cost(canvas, len(data))
    found, values = decode_colors(data, canvas.meshes, None if before is None else before.colors)
    return canvas.by_frame(found), None if after is None else replace(after, colors=values)


def paint_background(mesh: Mesh, data: bytes, colors: bytes) -> Mesh:
    """Return a decoded background with the colours of a payload; those of a change are of what it adds, at the end.

    Raises FormatError where the colours are damaged.
    """
    canvas = background_canvas(data)
    _check_cost(canvas, len(colors))
    [[found]], _ = decode_colors(colors, canvas.meshes)
    if data[0] != Form.PATCH and len(found) == len(mesh.vertices):
        return replace(mesh, colors=found)
    if mesh.colors is None or len(found) > len(mesh.vertices):
        raise FormatError(f"colours of {len(found)} of {len(mesh.vertices)} vertices of a background")
    kept = mesh.colors[: len(mesh.vertices) - len(found)]
    return replace(mesh, colors=np.concatenate([kept, found]))


def background_canvas(data: bytes) -> Canvas:
    """Return the mesh of a background, or that which a change of it adds. Raises FormatError on damaged bytes."""
    if data[:1] == bytes([Form.PATCH]):
        change = unpack_all(StaticPatch, data)
        added = decode_mesh(change.mesh, change.step)
        return Canvas((ColoredMesh(added, 0, 1, len(added.vertices)),))
    group = unpack_all(DracoGroup, data)
    whole = decode_mesh(group.meshes[0], group.step) if group.meshes else Mesh.empty()
    return Canvas((ColoredMesh(whole, 0, 1, len(whole.vertices)),))


def atlas_base(data: bytes) -> Mesh:
    """Return the mesh that an atlas or splats are of, from the first layer of their group, or from a background."""
    if data[:1] == bytes([Form.LAYERS]):
        return base_of(read_layers(data, 0), None)
    if data[:1] == bytes([Form.LAPLACIAN]):
        record = unpack_all(LaplacianGroup, data)
        return decode_mesh(record.reference, record.step)
    return background_canvas(data).meshes[0].base


def finest_faces(base: Mesh, levels: int) -> Int32[np.ndarray, "F 3"]:
    """Return the faces of a base mesh after its subdivisions."""
    finer = levels_of(base.faces, len(base.vertices), levels)
    return finer[-1].faces if finer else base.faces


def _check_cost(canvas: Canvas, size: int) -> None:
    check_colors([(mesh.vertices, mesh.frames) for mesh in canvas.meshes], size)
