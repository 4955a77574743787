"""The most expensive files that the rules admit, built for a number of bytes: of each form, and of the container."""

import io
from collections.abc import Callable
from dataclasses import replace
from itertools import accumulate

import numpy as np

from meshreel import _core
from meshreel.coding import entropy
from meshreel.coding.appearance.atlas import encode_atlas
from meshreel.coding.appearance.pictures import VideoEncoder, encode_pictures
from meshreel.coding.background import encode_background
from meshreel.coding.layers import orthonormal
from meshreel.coding.layers.graph import Graph, connectivity, hierarchy
from meshreel.coding.layers.patches import encode_patches
from meshreel.coding.mesh import decode_mesh, encode_empty, encode_mesh
from meshreel.coding.paper import laplacian
from meshreel.container.writer import Companion, ReelWriter
from meshreel.format import budget
from meshreel.format.budget import LIMITS, Size
from meshreel.format.checks import MOST_CHANGES, MOST_NESTED, MOST_TRACKS
from meshreel.format.layout import (
    AnchorRule,
    ChunkKind,
    CodedField,
    ColorsLevel,
    Component,
    DisplacementHead,
    DracoGroup,
    Form,
    Gaussians,
    GaussiansLayer,
    Header,
    LaplacianGroup,
    LayersGroup,
    LayersLevel,
    Origin,
    SharedMotion,
    StaticPatch,
    VertexColors,
)
from meshreel.format.records import pack
from meshreel.geometry.atlas import Layout
from meshreel.geometry.topology import subdivide_midpoint
from meshreel.types import Mesh

HEADER = Header(30.0, (0.0, 0.0, 0.0), 1.0, (-1.0,) * 3, (1.0,) * 3, "{}")
STEP = 2.0**-10
LARGE = 8000  # bytes of a payload whose own bytes count beside what any may cost


def grid(side: int, noise: float = 0.0) -> Mesh:
    """A square of side x side cells; the fewest bytes that a mesh of so many faces takes, without noise."""
    x, y = (axis.reshape(-1) for axis in np.meshgrid(np.arange(side + 1), np.arange(side + 1)))
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1)
    first = np.stack([corner, corner + 1, corner + side + 1], axis=1)
    second = np.stack([corner + 1, corner + side + 2, corner + side + 1], axis=1)
    z = noise * np.random.default_rng(side).normal(size=x.shape)
    return Mesh.of(STEP * np.rint(np.stack([x, y, z], axis=1)), np.concatenate([first, second]))


def of_bytes(size: int) -> bytes:
    """A Draco mesh of about so many bytes."""
    side = 1
    while len(data := encode_mesh(grid(2 * side, 100.0), STEP)) < size:
        side *= 2
    for shorter in range(2 * side - 1, side, -max(1, side // 16)):
        if len(data) <= size:
            break
        data = encode_mesh(grid(shorter, 100.0), STEP)
    return data


def file_of(*groups: tuple[int, bytes], depends: bool = False) -> bytes:
    """A file of one track with these groups, of so many frames each; each `depends` on the one before."""
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        for frames, payload in groups:
            last = writer.last_of(0)
            before = (last,) if depends and last is not None else ()
            writer.add_group(writer.frames_of(0), frames, payload, depends_on=before)
    return file.getvalue()


def largest(costs: Callable[[int], int], size: int) -> int:
    """The greatest number whose cost `size` bytes may have."""
    low, high = 1, 2
    while costs(high) <= budget.allowance(size):
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if costs(middle) <= budget.allowance(size) else (low, middle)
    return low


def most_levels(costs: Callable[[int], int], size: int) -> int:
    """The greatest number of levels whose cost `size` bytes may have."""
    return next(levels for levels in range(1, 20) if costs(levels) > budget.allowance(size)) - 1


def base_of(size: int, costs: Callable[[Size], int], levels: int) -> tuple[bytes, int]:
    """A Draco mesh for a payload of `size` bytes, and the levels of subdivision that these may have.

    A small one is the largest grid that any payload may have subdivided `levels` times, a large one has as many bytes.
    """
    if size < LARGE:
        side = largest(lambda side: costs(Size(2 * side**2, (side + 1) ** 2, levels)), 0)
        return encode_mesh(grid(side), STEP), levels
    shape = Size.of(decode_mesh(data := of_bytes(size), STEP))
    return data, most_levels(lambda levels: costs(replace(shape, levels=levels)), len(data))


def field(graph: Graph, columns: int, width: int, head: int = 0) -> CodedField:
    vectors = orthonormal.forward(np.eye(width)[:columns], np.full(columns, 6.0))
    basis = entropy.encode_integers(np.concatenate([np.zeros(head, np.int32), vectors]))
    symbols, _ = _core.encode_field(np.zeros((columns, len(graph.starts) - 1), np.int32), graph.core)
    return CodedField(columns, 80, basis, symbols)


def layers(data: bytes, levels: int, frames: int, patched: bool = False, predicted: bool = False) -> bytes:
    """A group with as many columns as there can be, and faces dropped and added in every second frame."""
    base = decode_mesh(data, STEP)
    motion = field(hierarchy(base)[1], 3 * frames, 3 * frames, head=1 + 6 * frames)
    origin = Origin.PREVIOUS if predicted else Origin.ALONE
    head = LayersGroup(
        Form.LAYERS, origin, frames, levels, STEP, b"" if predicted else data, SharedMotion.POSES, motion
    )
    payload, faces, vertices = pack(head), base.faces, len(base.vertices)
    for _ in range(levels):
        near = connectivity(faces, vertices)
        scalars = field(near.siblings.graph(16), frames, frames)
        payload += pack(LayersLevel(Origin.ALONE, 16, 16, scalars))
        faces, vertices = near.level.faces, near.level.count
    if patched:
        dropped = np.zeros((frames, len(faces)), bool)
        dropped[::2, ::2] = True
        record, _ = encode_patches(dropped, [grid(1)] * frames, 80)
        payload += pack(record)
    return payload


def laplacian_group(data: bytes, levels: int, frames: int, components: int, anchors: int, rule: AnchorRule) -> bytes:
    """A group that is still, with so many components and anchors."""
    base = subdivide_midpoint(decode_mesh(data, STEP), levels)
    count = len(base.vertices)
    fixed = len(laplacian.anchors(rule, anchors, base.faces, count))
    near = entropy.causal_neighbours(base.faces, count)
    deltas = entropy.encode_weights(np.zeros((count, components), np.int32), near)
    values = entropy.encode_integers(np.zeros(fixed, np.int32))
    basis = entropy.encode_integers(np.zeros(3 * frames * (1 + components), np.int32))
    parts = tuple(Component(10, 80, len(values), len(stream)) for stream in deltas)
    head = pack(DisplacementHead(frames, rule, anchors, 1, 10, parts, basis))
    return pack(LaplacianGroup(Form.LAPLACIAN, levels, STEP, data, head + b"".join(values + s for s in deltas)))


def fan(count: int) -> Mesh:
    """A disc of so many triangles that all meet in one vertex, whose row of the least squares is full."""
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    rim = 1 + np.arange(count)
    points = np.concatenate([np.zeros((1, 3)), np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)])
    return Mesh.of(STEP * np.rint(2**12 * points), np.stack([np.zeros(count, int), rim, np.roll(rim, -1)], axis=1))


def draco(size: int) -> bytes:
    """One frame of as many faces as so many bytes may have."""
    data, levels = base_of(size, lambda shape: budget.draco_cost([shape]), 4)
    return file_of((1, pack(DracoGroup(Form.DRACO, levels, STEP, (data,)))))


def draco_frames(size: int) -> bytes:
    """Sixteen frames of as many faces."""
    data, levels = base_of(size // 16, lambda shape: budget.draco_cost([shape] * 16), 3)
    return file_of((16, pack(DracoGroup(Form.DRACO, levels, STEP, (data,) * 16))))


def layered(size: int, levels: int = 2, predicted: int = 0) -> bytes:
    """A group of 64 frames with patches, and groups predicted from it, which have next to no bytes."""
    data, levels = base_of(size, lambda shape: budget.layers_cost(shape, 64), levels)
    groups = [layers(data, levels, 64, patched=True)] + [still(levels, 64)] * predicted
    return file_of(*[(64, group) for group in groups], depends=True)


def still(levels: int, frames: int) -> bytes:
    """A group predicted from another, where nothing moves."""
    nothing = CodedField(0, 80, b"", b"")
    head = LayersGroup(Form.LAYERS, Origin.PREVIOUS, frames, levels, STEP, b"", SharedMotion.NONE, nothing)
    return pack(head) + levels * pack(LayersLevel(Origin.PREVIOUS, 16, 16, nothing))


def solved(size: int, frames: int = 1) -> bytes:
    """Least squares with as many unknowns as so many bytes may have, and with many anchors."""
    data, levels = base_of(size, lambda shape: budget.laplacian_cost(shape, frames, 1, 20 * shape.faces), 1)
    return file_of((frames, laplacian_group(data, levels, frames, 1, 100, AnchorRule.FARTHEST)))


def fanned(size: int) -> bytes:
    """Least squares one of whose rows is full."""
    count = largest(lambda count: budget.laplacian_cost(Size(count, count + 1), 1, 1, count * count), size)
    while len(data := encode_mesh(fan(count), STEP)) > size:
        count = count * 9 // 10
    count = min(count, largest(lambda count: budget.laplacian_cost(Size(count, count + 1), 1, 1, count**2), len(data)))
    return file_of((1, laplacian_group(encode_mesh(fan(count), STEP), 0, 1, 1, 100, AnchorRule.SPREAD)))


def handles(side: int, count: int) -> Mesh:
    """A grid with tubes between faces that are far from each other: no order of elimination fills in little."""
    mesh, used, ends = grid(side), set[int](), list[int]()
    for face in np.random.default_rng(0).permutation(len(mesh.faces)).tolist():
        corners = set(mesh.faces[face].tolist())
        if not corners & used and len(ends) < 2 * count:
            used |= corners
            ends.append(face)
    tubes = [
        row
        for a, b in zip(ends[::2], ends[1::2], strict=True)
        for p, q in [(mesh.faces[a], mesh.faces[b][::-1])]
        for i, j in ((0, 1), (1, 2), (2, 0))
        for row in ((p[i], p[j], q[i]), (p[j], q[j], q[i]))
    ]
    return Mesh.of(mesh.vertices, np.concatenate([np.delete(mesh.faces, ends, axis=0), np.array(tubes)]))


def painted(size: int, frames: int = 16, levels: int = 2, side: int = 0) -> bytes:
    """A group whose vertices have colours in as many columns as there can be; with a texture of side x side texels."""
    data, levels = base_of(size, lambda shape: budget.layers_cost(shape, frames), levels)
    base, colors, pictures = decode_mesh(data, STEP), list[Companion](), list[bytes]()
    parts, faces, count = [pack(VertexColors(Form.VERTEX_COLORS, Origin.ALONE, 64))], base.faces, len(base.vertices)
    parts.append(pack(field(hierarchy(base)[1], 3 * frames, 3 * frames)))
    for _ in range(levels):
        near = connectivity(faces, count)
        parts.append(pack(ColorsLevel(24, field(near.siblings.graph(24), 3 * frames, 3 * frames))))
        faces, count = near.level.faces, near.level.count
    if side:
        parts.append(pack(CodedField(0, 80, b"", b"")))  # of the vertices of the patches
    ends = tuple(accumulate([len(parts[0] + parts[1]), *map(len, parts[2:])]))
    colors.append(Companion(ChunkKind.COLORS, b"".join(parts), ends))
    if side:
        places = np.rint(base.vertices[base.faces][..., :2] / STEP).astype(np.int32) % side
        colors.append(Companion(ChunkKind.ATLAS, encode_atlas(base, Layout(side, side, places))))
        encoder = VideoEncoder(side, side)
        for frame in range(frames):
            pictures += encoder.add(np.full((side * 3 // 2, side), 16 + frame, np.uint8))
        colors.append(Companion(ChunkKind.PICTURES, encode_pictures(pictures + encoder.finish())))
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        writer.add_group(0, frames, layers(data, levels, frames, patched=bool(side)))
        for number, companion in enumerate(colors):
            writer.add_companion(companion, (0,) if number < 2 else (0, 2))
    return file.getvalue()


def changed(size: int) -> bytes:
    """As many changes of a background as may lead to a state; each copies all of it."""
    floor, added = grid(70), encode_mesh(grid(1), STEP)
    before = Size.of(floor)
    most = LIMITS.chain * budget.allowance(0) // budget.change_cost(before, before) - 10
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        last = writer.add_static(encode_background(floor, STEP))
        for count in range(min(most, MOST_CHANGES, size // 220)):
            gone = entropy.encode_integers(np.array([0, 1, before.faces + count - 1], np.int32))
            patch = pack(StaticPatch(Form.PATCH, STEP, 3, gone, added))
            last = writer.add_static(patch, depends_on=(last,))
        writer.add_group(0, 2, encode_empty(), depends_on=(last,))
    return file.getvalue()


def crowded(size: int) -> bytes:
    """As many tracks as there may be, each with as much as its bytes may have."""
    data = encode_mesh(grid(8), STEP)
    levels = most_levels(lambda levels: budget.draco_cost([Size(128, 81, levels)]), 0)
    payload = pack(DracoGroup(Form.DRACO, levels, STEP, (data,)))
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        for track in range(max(1, min(MOST_TRACKS, size // (len(payload) + 15)))):
            writer.add_group(0, 1, payload, track=track)
    return file.getvalue()


def moving_tracks(size: int, splats: bytes = b"") -> bytes:
    """As many tracks, each with a state that takes more memory than its frame; and splats, if they are given."""
    data, levels = base_of(0, lambda shape: budget.layers_cost(shape, 1), 5)
    payload, file = layers(data, levels, 1), io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        for track in range(size // (len(payload) + len(splats) + 40)):
            number = writer.add_group(0, 1, payload, track=track)
            if splats:
                writer.add_companion(Companion(ChunkKind.SPLATS, splats), (number,))
    return file.getvalue()


def cheap_splats() -> bytes:
    """As many splats as a chunk of few bytes may have."""
    count = LIMITS.free // LIMITS.splat
    columns = {"faces": 1, "places": 2, "offsets": 1, "turns": 1, "scales": 2, "opacities": 1, "colors": 3}
    streams = {name: entropy.encode_integers(np.zeros(n * count, np.int32)) for name, n in columns.items()}
    head = Gaussians(Form.GAUSSIANS, 7, 6, 6, 7, 106, 48, count)
    return pack(head) + pack(GaussiansLayer(count, **streams))


def empty(size: int) -> bytes:
    """As many frames without surface as so many bytes may have, in one track or in many."""
    tracks, floor = 16, encode_background(decode_mesh(of_bytes(size), STEP), STEP)
    each = (LIMITS.frames + LIMITS.frames_per_byte * len(floor)) // tracks
    file = io.BytesIO()
    with ReelWriter(file, HEADER) as writer:
        for track in range(tracks):
            writer.add_group(0, min(each, LIMITS.frames), encode_empty(), track=track)
        writer.add_static(floor)
    return file.getvalue()


def headed(size: int) -> bytes:
    """As many chunks, layers, times and nested metadata as so many bytes hold."""
    text = '{"a": ' + "[" * (MOST_NESTED - 1) + "]" * (MOST_NESTED - 1) + "}"
    count = size // 20
    header = replace(HEADER, metadata=text, intervals=(1,) * (count - 1))
    file = io.BytesIO()
    with ReelWriter(file, header) as writer:
        for frame in range(count):
            writer.add_group(frame, 1, encode_empty())
    return file.getvalue()
