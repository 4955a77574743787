"""The decoder in C++ against the pairs in `coding/`: the same bits and refusals on golden files and the corpus."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from core.fuzz import verdict
from meshreel import _core
from meshreel.coding.appearance.atlas import decode_atlas
from meshreel.coding.appearance.splats import decode_splats
from meshreel.coding.background import decode_background, decode_change
from meshreel.coding.colored import atlas_base, canvas_of, decode_group_colors, paint_background
from meshreel.coding.group import continue_group
from meshreel.coding.layers.coder import LayersState
from meshreel.container.reader import Chunk, ReelReader
from meshreel.container.sources import BytesSource
from meshreel.errors import FormatError
from meshreel.format.layout import ChunkKind, Form
from meshreel.geometry.splats import bind
from meshreel.types import Mesh, Placement
from tests.golden import GOLDEN

FILES = sorted([*GOLDEN.rglob("*.reel"), *verdict.corpus()])
MOST_CHUNKS = 12  # of a file: some of the corpus repeat themselves


def outcome(decode: Callable[[], Any]) -> Any:
    """Return what a decoder gives; None where it refuses."""
    try:
        return decode()
    except FormatError:
        return None


def check_same(wanted: Mesh, found: Mesh) -> None:
    for name in ("vertices", "faces", "colors", "uv"):
        own, other = getattr(wanted, name), getattr(found, name)
        assert (own is None) == (other is None), name
        if own is not None:
            np.testing.assert_array_equal(own, other, err_msg=name)


class Walk:
    """All chunks of a file, decoded by the pairs and in C++."""

    def __init__(self, data: bytes, layers: int | None) -> None:
        self.reader, self.layers = ReelReader(BytesSource(data)), layers
        self.place = Placement(self.reader.header.scale, self.reader.header.origin)
        self.core_place = self.reader.header.scale, self.reader.header.origin
        self.states = dict[int, tuple[LayersState | None, _core.GroupState | None]]()
        self.backgrounds = dict[int, tuple[Mesh, _core.Background]]()

    def read(self, chunk: Chunk) -> bytes | None:
        return outcome(lambda: self.reader.read_chunk(chunk.number, None if self.layers is None else self.layers + 1))

    def check(self) -> None:
        for chunk in self.reader.chunks[:MOST_CHUNKS]:
            if chunk.kind == ChunkKind.GROUP and (data := self.read(chunk)):
                self.check_group(chunk, data)
            elif chunk.kind == ChunkKind.STATIC and (data := outcome(partial(self.reader.read_chunk, chunk.number))):
                self.check_background(chunk, data)

    def check_group(self, chunk: Chunk, data: bytes) -> None:
        before = self.reader.group_before(chunk)
        if before is not None and before.number not in self.states:
            return
        previous, core_previous = (None, None) if before is None else self.states[before.number]
        frames, layers = chunk.frame_count, self.layers
        wanted = outcome(lambda: continue_group(data, frames, layers, previous))
        found = outcome(lambda: _core.Group(data, frames, layers, core_previous, self.core_place))
        assert (wanted is None) == (found is None), chunk
        if wanted is None:
            return
        meshes, state = wanted
        painted, colored = None, self.read_companion(chunk, ChunkKind.COLORS)
        if colored is not None:
            canvas = canvas_of(data, [len(mesh.vertices) for mesh in meshes], layers, previous)
            painted = outcome(lambda: decode_group_colors(colored, canvas, previous, state))
            assert (painted is None) == (outcome(lambda: found.paint(colored) or True) is None)
            if painted is not None:
                colors, state = painted
                meshes = [Mesh(mesh.vertices, mesh.faces, some) for mesh, some in zip(meshes, colors, strict=True)]
        self.states[chunk.number] = state, self.skipped(chunk, data, core_previous, painted is not None)
        meshes = [self.place.of(mesh) for mesh in meshes]
        for mesh, arrays in zip(meshes, found.frames(), strict=True):
            check_same(mesh, Mesh(*arrays))
        self.check_splats(chunk, data, [mesh.vertices for mesh in meshes], found, previous)

    def skipped(
        self, chunk: Chunk, data: bytes, previous: _core.GroupState | None, colored: bool
    ) -> _core.GroupState | None:
        """Return the state after a group that is not shown, which the next groups are decoded from."""
        group = _core.Group(data, chunk.frame_count, self.layers, previous, self.core_place, shown=False)
        of = self.reader.companion_of(chunk, ChunkKind.COLORS)
        if colored and of is not None and group.state is not None:
            group.paint(self.reader.read_chunk(of.number, group.state.levels + 1))
        return group.state

    def check_splats(
        self, chunk: Chunk, data: bytes, places: list[np.ndarray], group: _core.Group, previous: LayersState | None
    ) -> None:
        coded = self.read_companion(chunk, ChunkKind.SPLATS)
        if coded is None:
            return
        owner = self.reader.read_chunk(chunk.number, 1)
        splats = outcome(lambda: decode_splats(coded, len(atlas_base(owner).faces)))
        core = outcome(lambda: _core.read_splats(coded, owner))
        assert (splats is None) == (core is None)
        if splats is None:
            return
        canvas = canvas_of(data, [len(points) for points in places], self.layers, previous)
        meshes = [Mesh(points, np.zeros((0, 3), np.int32)) for points in places]
        for number, carrier in enumerate(canvas.carriers(meshes, self.place.scale)):
            wanted, found = bind(splats, carrier), core.bind(group, number, self.place.scale)
            for name, numbers in zip(wanted.__slots__, found, strict=True):  # sines of two libraries
                np.testing.assert_allclose(getattr(wanted, name), numbers, atol=1e-12)

    def check_background(self, chunk: Chunk, data: bytes) -> None:
        is_change = chunk.form == Form.PATCH
        if is_change and chunk.depends_on[0] not in self.backgrounds:
            return
        before, core_before = self.backgrounds[chunk.depends_on[0]] if is_change else (Mesh.empty(), None)
        wanted = outcome(lambda: decode_change(data, before) if is_change else decode_background(data))
        found = outcome(lambda: _core.Background(data, core_before, self.core_place))
        assert (wanted is None) == (found is None), chunk
        if wanted is None:
            return
        colored = self.read_companion(chunk, ChunkKind.COLORS)
        if colored is not None:
            painted = outcome(lambda: paint_background(wanted, data, colored))
            assert (painted is None) == (outcome(lambda: found.paint(colored) or True) is None)
            wanted = wanted if painted is None else painted
        self.backgrounds[chunk.number] = wanted, found
        check_same(self.place.of(wanted), Mesh(*found.arrays()))
        coded = self.read_companion(chunk, ChunkKind.ATLAS)
        if coded is not None:
            layout = outcome(lambda: decode_atlas(coded, atlas_base(data)))
            core = outcome(lambda: _core.read_atlas(coded, data))
            assert (layout is None) == (core is None)
            if layout is not None:
                assert (core.width, core.height) == (layout.width, layout.height)

    def read_companion(self, chunk: Chunk, kind: ChunkKind) -> bytes | None:
        of = self.reader.companion_of(chunk, kind)
        return None if of is None else self.read(of)


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_each_chunk_decodes_as_the_pairs_say_or_is_refused_by_both(path):
    for layers in (None, 1):
        walk = outcome(partial(Walk, path.read_bytes(), layers))
        if walk is not None:
            walk.check()
