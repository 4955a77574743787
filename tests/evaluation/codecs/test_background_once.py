"""The anchor that sends a background once: on a scene, and on what is none."""

from __future__ import annotations

import numpy as np
import pytest

from meshreel.capture.procedural import sliding_sphere
from meshreel.decoder import open as open_video
from meshreel.errors import FormatError, InputError
from meshreel.evaluation.codecs import make_codec
from meshreel.evaluation.codecs.background_once import BackgroundOnceDracoCodec
from meshreel.evaluation.codecs.draco import DecimatedDracoCodec
from meshreel.evaluation.datasets import open_known
from meshreel.format.layout import ChunkKind
from meshreel.geometry.nearest import Surface, distances
from meshreel.types import Mesh, MeshList

FRAMES = 8


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """Every third frame of the procedural room, captured."""
    return open_known("procedural_room", tmp_path_factory.mktemp("none"), FRAMES, tmp_path_factory.mktemp("cache"))


@pytest.mark.slow
def test_the_background_is_sent_once_and_what_moves_in_every_frame(room):
    codec = BackgroundOnceDracoCodec(0.5, 11)
    data = codec.encode(room.sequence)
    video = open_video(data)
    static = [chunk for chunk in video.reader.chunks if chunk.kind == ChunkKind.STATIC]
    assert len(static) == 1 and len(video.reader.groups) == FRAMES == len(codec.decode(data))
    diagonal = room.sequence[0].diagonal
    for number in (0, FRAMES - 1):
        gaps = distances(room.sequence[number].vertices, codec.decode(data)[number])
        assert np.quantile(gaps, 0.95) < 0.01 * diagonal
    assert data == codec.encode(room.sequence)
    smaller = BackgroundOnceDracoCodec(0.1, 8).encode(room.sequence)
    assert len(smaller) - static[0].size < 0.4 * (len(data) - static[0].size)
    with pytest.raises(FormatError):
        codec.decode(data[: len(data) // 2])[FRAMES - 1]


def test_what_is_no_scene_is_decimated_draco():
    balls = sliding_sphere(2, levels=3)
    found = BackgroundOnceDracoCodec(0.3, 9).decode(BackgroundOnceDracoCodec(0.3, 9).encode(balls))
    plain = DecimatedDracoCodec(0.3, 9).decode(DecimatedDracoCodec(0.3, 9).encode(balls))
    for a, b in zip(found, plain, strict=True):
        assert np.array_equal(a.vertices, b.vertices) and np.array_equal(a.faces, b.faces)


def test_empty_frames_stay_empty():
    ball = sliding_sphere(1, levels=2)[0]
    codec = BackgroundOnceDracoCodec(0.5, 10)
    decoded = codec.decode(codec.encode(MeshList((ball, Mesh.empty(), ball))))
    assert decoded[1].is_empty and Surface(decoded[2]).mesh.diagonal == pytest.approx(ball.diagonal, rel=0.05)


@pytest.mark.parametrize("options", [{"fraction": 0.0}, {"qp": 1}, {"levels": 9}])
def test_options_are_refused(options):
    with pytest.raises(InputError, match=next(iter(options))):
        make_codec("background_once_draco", options)
