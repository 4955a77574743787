"""Colours of the vertices of a group of any form, or of a background, and the meshes over which they are coded.

In: the payload of a group, and the state of the group that predicts it. Out: its meshes before subdivision, and the
colours of each frame's vertices.
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
from ..geometry.splats import Carrier
from ..geometry.topology import concatenate, levels_of
from ..shapes import Bool, Float64, Int32, UInt8
from ..types import Mesh
from .appearance.colors import ColoredMesh, EncodedColors, decode_colors, encode_colors
from .layers.coder import LayersState, base_of, patches_of, read_layers
from .mesh import decode_mesh


@dataclass(frozen=True, slots=True)
class Canvas:
    """The meshes of a group whose vertices have colours: one for all frames, or one for each."""

    meshes: tuple[ColoredMesh, ...]
    patches: tuple[int, ...] = ()  # vertices of each frame's patch; the last mesh has the vertices of all patches
    is_layered: bool = False  # each level of the first mesh is a layer
    dropped: Bool[np.ndarray, "T F"] | None = None  # faces of the template that each frame lacks
    empty: tuple[int, ...] = ()  # frames without surface, which have no mesh in groups with one mesh per frame

    def carriers(self, frames: Sequence[Mesh], unit: float = 1.0) -> list[Carrier]:
        """Return the carrier of splats in each frame: the template's positions, and its faces that the frame lacks.

        `unit` is that of normalised coordinates in the frames.
        """
        template, levels = self.meshes[0], self.meshes[0].levels
        faces = finest_faces(template.base, levels)
        places = [np.ascontiguousarray(mesh.vertices[: template.vertices]) for mesh in frames]
        lacking = [None] * len(frames) if self.dropped is None else list(self.dropped)
        return [Carrier(at, faces, levels, gone, unit) for at, gone in zip(places, lacking, strict=True)]

    def by_frame(self, colors: Sequence[UInt8[np.ndarray, "_ _ 3"]]) -> list[UInt8[np.ndarray, "_ 3"]]:
        """Regroup colours of vertices from meshes to frames."""
        if not self.patches:
            by_frame = [frame for of_mesh in colors for frame in of_mesh]
            for number in self.empty:
                by_frame.insert(number, np.zeros((0, 3), np.uint8))
            return by_frame
        template, [added] = colors
        bounds = pairwise(np.cumsum([0, *self.patches]).tolist())
        return [np.concatenate([frame, added[a:b]]) for frame, (a, b) in zip(template, bounds, strict=True)]

    def by_mesh(self, colors: Sequence[UInt8[np.ndarray, "_ 3"]]) -> list[UInt8[np.ndarray, "_ _ 3"]]:
        """Regroup colours of vertices from frames to meshes."""
        if not self.patches:
            by_mesh, remaining = list[UInt8[np.ndarray, "_ _ 3"]](), list(colors)
            for number in reversed(self.empty):
                del remaining[number]
            for mesh in self.meshes:
                by_mesh.append(np.stack(remaining[: mesh.frames]))
                remaining = remaining[mesh.frames :]
            return by_mesh
        shared = self.meshes[0].vertices
        added = np.concatenate([frame[shared:] for frame in colors])
        return [np.stack([frame[:shared] for frame in colors]), added[None]]


def canvas_of(
    data: bytes, counts: Sequence[int], layers: int | None = None, previous: LayersState | None = None
) -> Canvas:
    """Return the meshes of a payload, or of a prefix of its layers; `counts` are the frames' numbers of vertices.

    Raises FormatError as `continue_group` does.
    """
    form = data[0] if data else None
    if form == Form.LAYERS:
        records = read_layers(data, layers)
        base, levels = base_of(records, previous), len(records.layers) - 1
        patches = patches_of(data, records, layers, 4**levels * len(base.faces))
        if patches is None:
            return Canvas((ColoredMesh(base, levels, len(counts), counts[0]),), is_layered=True)
        added = tuple(len(mesh.vertices) for mesh in patches.meshes)
        template = ColoredMesh(base, levels, len(counts), counts[0] - added[0])
        if not any(added):
            return Canvas((template,), is_layered=True, dropped=patches.dropped)
        patch = ColoredMesh(concatenate(patches.meshes), 0, 1, sum(added))
        return Canvas((template, patch), added, True, patches.dropped)
    if form == Form.LAPLACIAN:
        record = unpack_all(LaplacianGroup, data)
        reference = decode_mesh(record.reference, record.step)
        return Canvas((ColoredMesh(reference, record.levels, len(counts), counts[0]),))
    if form == Form.DRACO:
        group = unpack_all(DracoGroup, data)
        pairs = zip(group.meshes, counts, strict=True)
        meshes = (ColoredMesh(decode_mesh(frame, group.step), group.levels, 1, n) for frame, n in pairs if n)
        return Canvas(tuple(meshes), empty=tuple(t for t, n in enumerate(counts) if not n))
    return Canvas((), empty=tuple(range(len(counts))))


def encode_group_colors(
    canvas: Canvas, colors: Sequence[UInt8[np.ndarray, "_ 3"]], step: float, before: Float64[np.ndarray, "V 3"] | None
) -> EncodedColors:
    """Encode the colours of the vertices of each frame of a group; CostlyError if a reader would refuse them."""
    encoded = encode_colors(canvas.meshes, canvas.by_mesh(colors), step, before, canvas.is_layered)
    _check_cost(canvas, len(encoded.payload))
    return encoded


def decode_group_colors(
    data: bytes, canvas: Canvas, before: LayersState | None, after: LayersState | None
) -> tuple[list[UInt8[np.ndarray, "_ 3"]], LayersState | None]:
    """Decode the colours of the vertices of each frame of a group, given the geometry's states before and after it.

    Also return the state after it with the colours that predict the next group's. Raises FormatError if the colours are
    damaged, or predicted from missing ones.
    """
    _check_cost(canvas, len(data))
    colors, values = decode_colors(data, canvas.meshes, None if before is None else before.colors)
    return canvas.by_frame(colors), None if after is None else replace(after, colors=values)


def paint_background(mesh: Mesh, data: bytes, colors: bytes) -> Mesh:
    """Return a decoded background with the colours of a payload; a change colours only the vertices that it adds.

    Raises FormatError if the colours are damaged.
    """
    canvas = background_canvas(data)
    _check_cost(canvas, len(colors))
    [[added]], _ = decode_colors(colors, canvas.meshes)
    if data[0] != Form.PATCH and len(added) == len(mesh.vertices):
        return replace(mesh, colors=added)
    if mesh.colors is None or len(added) > len(mesh.vertices):
        raise FormatError(f"colours of {len(added)} of {len(mesh.vertices)} vertices of a background")
    return replace(mesh, colors=np.concatenate([mesh.colors[: len(mesh.vertices) - len(added)], added]))


def background_canvas(data: bytes) -> Canvas:
    """Return the mesh of a background, or the mesh that a change adds. Raises FormatError on damaged bytes."""
    if data[:1] == bytes([Form.PATCH]):
        change = unpack_all(StaticPatch, data)
        added = decode_mesh(change.mesh, change.step)
        return Canvas((ColoredMesh(added, 0, 1, len(added.vertices)),))
    group = unpack_all(DracoGroup, data)
    background = decode_mesh(group.meshes[0], group.step) if group.meshes else Mesh.empty()
    return Canvas((ColoredMesh(background, 0, 1, len(background.vertices)),))


def atlas_base(data: bytes) -> Mesh:
    """Return the base mesh of an atlas or splats, from the first layer of their group, or from a background."""
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
