from dataclasses import replace
from io import BytesIO
from itertools import accumulate

import numpy as np

import meshreel
from meshreel.coding.colored import canvas_of, decode_group_colors, encode_group_colors
from meshreel.coding.group import continue_group
from meshreel.container.writer import Companion, ReelWriter
from meshreel.format.layout import ChunkKind
from tests.golden import GOLDEN

OPTIONS = 1 / 64


def waves(vertices: np.ndarray) -> np.ndarray:
    return (128 + 100 * np.sin(5 * vertices)).astype(np.uint8)


def test_frames_without_surface_have_no_colours_and_those_around_them_keep_theirs() -> None:
    with meshreel.open(GOLDEN / "draco.reel") as video:
        payload = video.reader.read_chunk(0)
        meshes, _ = continue_group(payload, len(video), None, None)
    canvas = canvas_of(payload, [len(mesh.vertices) for mesh in meshes])
    colors = [waves(mesh.vertices) for mesh in meshes]
    coded = encode_group_colors(canvas, colors, OPTIONS, None)
    found, _ = decode_group_colors(coded.payload, canvas, None, None)
    assert [len(some) for some in found] == [len(some) for some in colors]
    assert 0 in map(len, found)
    for some, wanted in zip(found, colors, strict=True):
        assert np.abs(some.astype(int) - wanted).max(initial=0) < 16


def test_colours_behind_a_group_with_patches_are_the_same_whichever_frame_is_asked_for_first() -> None:
    file, state = BytesIO(), None
    with meshreel.open(GOLDEN / "layers_patched.reel") as video, ReelWriter(file, video.reader.header) as writer:
        for chunk in video.reader.groups:
            payload, last = video.reader.read_chunk(chunk.number), writer.last_of(0)
            ends = tuple(accumulate(layer.size for layer in chunk.layers))
            needed = () if last is None else (last,)
            group = writer.add_group(chunk.first_frame, chunk.frame_count, payload, ends, needed)
            meshes, after = continue_group(payload, chunk.frame_count, None, state)
            assert after is not None
            canvas = canvas_of(payload, [len(mesh.vertices) for mesh in meshes], None, state)
            known = None if state is None else state.colors
            coded = encode_group_colors(canvas, [waves(mesh.vertices) for mesh in meshes], OPTIONS, known)
            before = writer.companion_of(last, ChunkKind.COLORS)
            needed = (group,) if before is None else (group, before)
            writer.add_companion(Companion(ChunkKind.COLORS, coded.payload, coded.layers), needed)
            state = replace(after, colors=coded.state)
    with meshreel.open(file.getvalue()) as first, meshreel.open(file.getvalue()) as played:
        frames = [mesh.colors for mesh in played]
        assert len(video.reader.groups) > 1
        assert np.array_equal(first[len(frames) - 1].colors, frames[-1])
