"""FORMAT.md is true: its Python decodes what the encoder writes."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from meshreel.coding import entropy
from meshreel.coding.appearance.atlas import decode_atlas, encode_atlas
from meshreel.coding.appearance.colors import ColoredMesh, decode_colors, encode_colors
from meshreel.coding.appearance.splats import decode_splats, encode_splats
from meshreel.coding.background import decode_background, decode_change, encode_background, encode_change
from meshreel.coding.layers.coder import LayerCodingOptions, LayersState, encode_layers
from meshreel.coding.layers.patches import encode_patches
from meshreel.coding.mesh import code_reference, decode_mesh
from meshreel.coding.paper import laplacian
from meshreel.coding.paper.displacements import DisplacementOptions, decode_displacements, encode_displacements
from meshreel.coding.steps import step_of
from meshreel.format import records
from meshreel.format.layout import (
    AnchorRule,
    Atlas,
    CodedField,
    ColorsLevel,
    DisplacementHead,
    Gaussians,
    GaussiansLayer,
    LayersGroup,
    LayersLevel,
    Origin,
    SharedMotion,
    StaticPatch,
    VertexColors,
)
from meshreel.format.records import pack
from meshreel.geometry.atlas import Layout
from meshreel.geometry.splats import Carrier, bind
from meshreel.geometry.topology import subdivide_midpoint
from meshreel.types import Mesh
from tests.coding.decoded_layers import decode_layers
from tests.splats import some_splats

DOCUMENT = Path(__file__).resolve().parents[2] / "FORMAT.md"


def require(condition: bool) -> None:
    assert condition


@pytest.fixture(scope="module")
def decoder() -> dict[str, Any]:
    """What the document's Python defines."""
    names: dict[str, Any] = {"np": np, "math": math, "sqrt": math.sqrt, "require": require}
    names |= {value.name: value for values in (AnchorRule, Origin, SharedMotion) for value in values}
    for block in re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL):
        exec(block, names)
    return names


def body() -> Mesh:
    """A grid, a triangle apart from it, a degenerate face, a sliver, and a vertex of no face."""
    side = 12
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    points = np.stack([x, y, np.sin(x) * np.cos(y)], axis=2).reshape(-1, 3) * 0.05
    corner = (x[:-1, :-1] + side * y[:-1, :-1]).reshape(-1)
    faces = np.concatenate([np.stack([corner, corner + 1, corner + side], 1),
                            np.stack([corner + 1, corner + side + 1, corner + side], 1)])  # fmt: skip
    more = np.array([[2.0, 0, 0], [2.1, 0, 0], [2.05, 1e-7, 0], [3.0, 3.0, 3.0]])
    n = len(points)
    faces = np.concatenate([faces, [[n, n + 1, n + 2], [5, 5, 6], [n + 2, n + 1, n + 2]]])
    return Mesh.of(np.concatenate([points, more]), faces)


def field(vertices: int, frames: int) -> np.ndarray:
    generator = np.random.default_rng(3)
    rough = generator.laplace(size=(vertices, 4)) @ generator.normal(size=(4, 3 * frames))
    return 0.01 * np.cumsum(rough.reshape(vertices, frames, 3), axis=0)


@pytest.mark.parametrize("rule", AnchorRule)
def test_the_document_decodes_displacements(
    decoder: dict[str, Any], rule: AnchorRule, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("meshreel.coding.paper.displacements.ANCHORS", rule)
    base, options = body(), DisplacementOptions(step=3e-3, anchor_count=7, anchor_weight=3)
    data = encode_displacements(field(len(base.vertices), 3), base, options)
    head, offset = records.unpack(DisplacementHead, data)
    assert len(head.components) >= 4
    streams = []
    for component in head.components:
        middle, end = offset + component.anchors_size, offset + component.anchors_size + component.deltas_size
        streams.append((data[offset:middle], data[middle:end]))
        offset = end
    plain = [tuple(point) for point in base.vertices.tolist()], [tuple(face) for face in base.faces.tolist()]
    told = np.array(decoder["decode_displacements"](head, streams, *plain)).reshape(len(base.vertices), -1, 3)
    np.testing.assert_allclose(told, decode_displacements(data, base), rtol=0, atol=1e-9)
    told = np.array(decoder["decode_displacements"](head, streams[:2], *plain)).reshape(len(base.vertices), -1, 3)
    np.testing.assert_allclose(told, decode_displacements(data, base, 2), rtol=0, atol=1e-9)


def test_the_document_decodes_every_size_of_delta(decoder: dict[str, Any]) -> None:
    base, generator = body(), np.random.default_rng(4)
    vertices = len(base.vertices)
    sizes = np.exp2(generator.uniform(0, 31, (vertices, 8)) * np.array([0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1]))
    symbols = np.rint(generator.choice([-1, 1], sizes.shape) * sizes).astype(np.int32)
    symbols[generator.random(symbols.shape) < 0.3] = 0
    streams = entropy.encode_weights(symbols, entropy.causal_neighbours(base.faces, vertices))
    told = decoder["decode_weights"](streams, vertices, [tuple(face) for face in base.faces.tolist()])
    np.testing.assert_array_equal(np.array(told).T, symbols)


def test_the_document_decodes_integers_of_every_length(decoder: dict[str, Any]) -> None:
    values = np.array([0, *(sign * (2**k + 1) for k in range(31) for sign in (1, -1)), 2**31 - 1, -(2**31)], np.int32)
    assert decoder["decode_integers"](entropy.encode_integers(values), len(values)) == values.tolist()


@pytest.mark.parametrize("rule", AnchorRule)
def test_the_document_chooses_the_same_anchors(decoder: dict[str, Any], rule: AnchorRule) -> None:
    base = body()
    for count in (0, 1, 2, 5, 40, len(base.vertices)):
        told = decoder["anchors"](rule, count, [tuple(face) for face in base.faces.tolist()], len(base.vertices))
        assert told == laplacian.anchors(rule, count, base.faces, len(base.vertices)).tolist()


def told_by(decoder: dict[str, Any], payload: bytes, before: dict[str, Any] | None) -> tuple[np.ndarray, Any, Any]:
    """What the document's decoder makes of a LAYERS payload: places, faces, and what it leaves behind."""
    group, offset = records.unpack(LayersGroup, payload)
    levels = []
    for _ in range(group.levels):
        level, offset = records.unpack(LayersLevel, payload, offset)
        levels.append(level)
    if group.origin == Origin.ALONE:
        mesh = decode_mesh(group.base, group.step)
        base, faces = [tuple(v) for v in mesh.vertices.tolist()], [tuple(f) for f in mesh.faces.tolist()]
    else:
        assert before is not None
        base, faces = before["base"], before["faces"]
    places, faces, left = decoder["decode_layers"](group, levels, base, faces, before)
    return np.array(places), np.array(faces), left


@pytest.mark.parametrize(("frames", "turn"), [(1, 0.0), (3, 0.0), (3, 0.4)])
def test_the_document_decodes_layers_to_the_bit(decoder: dict[str, Any], frames: int, turn: float) -> None:
    reference = code_reference(body(), 9, 2)
    generator = np.random.default_rng(5)
    state: LayersState | None = None
    left = None
    for round_number in range(2):
        shape = subdivide_midpoint(reference.mesh, 2).vertices
        time = np.arange(frames)[:, None, None] + round_number * frames
        wanted = shape * (1 + 0.02 * time) + 0.003 * generator.normal(size=(frames, *shape.shape))
        turns = Rotation.from_rotvec(turn * time[:, :, 0] * np.array([0.6, 0.0, 0.8])).as_matrix()
        wanted = np.einsum("tij,tvj->tvi", turns, wanted)
        payload = encode_layers(reference, wanted, LayerCodingOptions(step=4e-3), state).payload
        faces, positions, state = decode_layers(payload, None, state)
        assert (records.unpack(LayersGroup, payload)[0].shared == SharedMotion.POSES) == (turn > 0)
        told, told_faces, left = told_by(decoder, payload, left)
        np.testing.assert_array_equal(told_faces, faces)
        np.testing.assert_array_equal(told, positions)


def test_the_document_decodes_a_change_of_the_background_to_the_bit(decoder: dict[str, Any]) -> None:
    generator, step = np.random.default_rng(7), 2.0**-12
    before = decode_background(encode_background(body(), step))
    shape = [tuple(v) for v in before.vertices.tolist()], [tuple(f) for f in before.faces.tolist()]
    for more in (body(), Mesh.empty()):
        for density in (0.0, 0.1, 0.9, 1.0):
            data = encode_change(before, generator.random(len(before.faces)) < density, more, step)
            record, after = records.unpack_all(StaticPatch, data), decode_change(data, before)
            one = decode_mesh(record.mesh, step)
            lists = [tuple(v) for v in one.vertices.tolist()], [tuple(f) for f in one.faces.tolist()]
            vertices, faces = decoder["decode_change"](record, *shape, lists)
            np.testing.assert_array_equal(np.reshape(vertices, (-1, 3)), after.vertices)
            np.testing.assert_array_equal(np.reshape(faces, (-1, 3)), after.faces)


def test_the_document_decodes_patches_to_the_bit(decoder: dict[str, Any]) -> None:
    generator, mesh = np.random.default_rng(6), body()
    shapes = [Mesh.of(0.05 * mesh.vertices - 0.1 * t, mesh.faces) for t in range(3)]
    for patches in (shapes, [Mesh.empty(), shapes[1], Mesh.empty()], [Mesh.empty()] * 3):
        for density in (0.0, 0.1, 1.0):
            dropped = generator.random((3, 50)) < density
            record, decoded = encode_patches(dropped, patches, 70)
            one = decode_mesh(record.mesh, step_of(70))
            lists = [tuple(v) for v in one.vertices.tolist()], [tuple(f) for f in one.faces.tolist()]
            told = decoder["decode_patches"](record, lists, 3, 50)
            for t, (kept, places, faces) in enumerate(told):
                np.testing.assert_array_equal(kept, np.flatnonzero(~dropped[t]))
                np.testing.assert_array_equal(np.reshape(places, (-1, 3)), decoded[t].vertices)
                np.testing.assert_array_equal(np.reshape(faces, (-1, 3)), decoded[t].faces)


def test_the_document_decodes_colors_to_the_bit(decoder: dict[str, Any]) -> None:
    generator, mesh, frames = np.random.default_rng(8), body(), 3
    count = len(subdivide_midpoint(mesh, 2).vertices)
    shape = ColoredMesh(mesh, 2, frames, count)
    plain = [tuple(point) for point in mesh.vertices.tolist()], [tuple(face) for face in mesh.faces.tolist()]
    state: np.ndarray | None = None
    left: Any = None
    for round_number in range(2):
        wanted = generator.integers(0, 256, (1, count, 3)) + 9 * np.arange(frames)[:, None, None] + 20 * round_number
        colors = np.clip(wanted, 0, 255).astype(np.uint8)
        data = encode_colors([shape], [colors], 1 / 8, state).payload
        [found], state = decode_colors(data, [shape], state)
        head, offset = records.unpack(VertexColors, data)
        assert (head.origin == Origin.PREVIOUS) == (round_number > 0)
        coded, offset = records.unpack(CodedField, data, offset)
        levels = []
        for _ in range(2):
            level, offset = records.unpack(ColorsLevel, data, offset)
            levels.append(level)
        told, left = decoder["decode_colors"](head, coded, levels, *plain, frames, left)
        np.testing.assert_array_equal(told, found)


def test_colors_take_at_most_a_tenth_more_than_the_entropy_of_their_contexts(
    decoder: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh, frames, counts = body(), 3, dict[int, list[Any]]()
    points = subdivide_midpoint(mesh, 3).vertices
    waves = np.sin(points @ np.array([[40.0, 5, 3], [-4, 60, 6], [2, -7, 80]]))
    noise = np.random.default_rng(10).normal(0, 12, (frames, *points.shape))
    shape = ColoredMesh(mesh, 3, frames, len(points))
    colors = np.clip(128 + 90 * waves + noise, 0, 255).astype(np.uint8)
    data = encode_colors([shape], [colors], 1 / 16).payload
    kind, raw = decoder["Decoder"], [0]

    def bit(self: Any, model: Any, code: Any = kind.bit) -> int:
        found = code(self, model)
        counts.setdefault(id(model), [model, 0, 0])[1 + found] += 1  # the model itself, so that no other gets its id
        return found

    def sign(self: Any, code: Any = kind.raw) -> int:
        raw[0] += 1
        return code(self)

    monkeypatch.setattr(kind, "bit", bit)
    monkeypatch.setattr(kind, "raw", sign)
    _, offset = records.unpack(VertexColors, data)
    coded, offset = records.unpack(CodedField, data, offset)
    base, faces = [tuple(point) for point in mesh.vertices.tolist()], [tuple(face) for face in mesh.faces.tolist()]
    decoder["decode_columns"](coded.symbols, coded.columns, decoder["hierarchy"](base, faces)[1])
    count = len(base)
    for _ in range(shape.levels):
        level, offset = records.unpack(ColorsLevel, data, offset)
        edges, faces, siblings = decoder["subdivide"](faces, count)
        decoder["decode_columns"](level.values.symbols, level.values.columns, [(near, None) for near in siblings])
        count += len(edges)
    bits = raw[0] - sum(n * math.log2(n / (a + b)) for _, a, b in counts.values() for n in (a, b) if n)
    assert 8 * len(data) <= 1.1 * bits  # on basketball_player's three frames .99 of it


def test_the_document_decodes_an_atlas(decoder: dict[str, Any]) -> None:
    mesh, generator = body(), np.random.default_rng(9)
    flat = np.rint(mesh.vertices[:, :2] * 300).astype(np.int32) + 8
    flat = np.clip(flat, 0, 1024)
    for places in (flat[mesh.faces], generator.integers(0, 64, (len(mesh.faces), 3, 2)).astype(np.int32)):
        places = np.ascontiguousarray(places)
        record = records.unpack_all(Atlas, encode_atlas(mesh, Layout(1024, 1024, places)))
        streams = [
            decoder["decode_integers"](data, count)
            for data, count in (
                (record.joins, record.join_count),
                (record.starts, record.start_count),
                (record.rests, record.rest_count),
            )
        ]
        plain = [tuple(point) for point in mesh.vertices.tolist()], [tuple(face) for face in mesh.faces.tolist()]
        told = decoder["decode_places"](*streams, *plain)
        proper = [f for f, face in enumerate(mesh.faces.tolist()) if len(set(face)) == 3]
        np.testing.assert_array_equal(np.array(told)[proper], places[proper])
        np.testing.assert_array_equal(decode_atlas(pack(record), mesh).places[proper], places[proper])


def test_the_document_decodes_splats_and_binds_them(decoder: dict[str, Any]) -> None:
    base = body()
    wanted = some_splats(300, len(base.faces))
    data, _ = encode_splats(wanted, np.ones(300))
    head, offset = records.unpack(Gaussians, data)
    layers = list[GaussiansLayer]()
    while offset < len(data):
        layer, offset = records.unpack(GaussiansLayer, data, offset)
        layers.append(layer)
    for count in range(1, len(layers) + 1):
        told = decoder["decode_splats"](head, layers[:count], len(base.faces))
        known = decode_splats(data[: len(pack(head)) + sum(len(pack(one)) for one in layers[:count])], len(base.faces))
        fine = subdivide_midpoint(base, 2)
        bound = bind(known, Carrier(fine.vertices, fine.faces, 2))
        for number, splat in enumerate(told):
            face, weights, along = decoder["locate_splat"](splat, 2)
            corners = fine.vertices[fine.faces[face]].tolist()
            found = decoder["bind_splat"](splat, corners, weights, along)
            for value, name in zip(found, ("means", "axes", "scales"), strict=True):
                np.testing.assert_allclose(value, getattr(bound, name)[number], atol=1e-12)
            np.testing.assert_allclose(splat["color"], bound.colors[number])
            assert bound.opacities[number] == (splat["opacity"] if np.any(found[1][2]) else 0)
