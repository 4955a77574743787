"""The anchor that sends a background once: on a scene, and on what is none."""

from __future__ import annotations

import numpy as np
import pytest
from meshreel_bench.codecs import make_codec
from meshreel_bench.codecs.background_once import BackgroundOnceDracoCodec
from meshreel_bench.codecs.draco import DecimatedDracoCodec

from meshreel.decoder.video import open as open_video
from meshreel.errors import FormatError, InputError
from meshreel.format.layout import ChunkKind
from meshreel.geometry.closest_points import Surface, distances
from meshreel.types import Mesh, MeshList
from tests.small_scene import balls, scene
from tests.spheres import sliding_sphere

SCENE = scene()


def test_the_background_is_sent_once_and_what_moves_in_every_frame():
    codec = BackgroundOnceDracoCodec(0.5, 11)
    data = codec.encode(SCENE)
    video = open_video(data)
    static = [chunk for chunk in video.reader.chunks if chunk.kind == ChunkKind.STATIC]
    assert len(static) == 1 and len(video.reader.groups) == len(SCENE) == len(codec.decode(data))
    for number in (0, len(SCENE) - 1):
        gaps = distances(SCENE[number].vertices, codec.decode(data)[number])
        assert np.quantile(gaps, 0.95) < 0.01 * SCENE[number].diagonal
        shown = video.moving(number)
        assert np.abs(shown.vertices.mean(axis=0) - balls_of(number)).max() < 0.05
    assert data == codec.encode(SCENE)
    smaller = BackgroundOnceDracoCodec(0.1, 8).encode(SCENE)
    assert len(smaller) - static[0].size < 0.8 * (len(data) - static[0].size)
    with pytest.raises(FormatError):
        open_video(data[: len(data) // 2])[len(SCENE) - 1]


def balls_of(number):
    """The middle of both balls."""
    return np.concatenate([ball.vertices for ball in balls(number)]).mean(axis=0)


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
