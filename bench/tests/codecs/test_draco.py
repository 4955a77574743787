"""Codecs of single frames: decimated Draco, in a file or alone; with a background once, or colours; meshoptimizer."""

from dataclasses import replace

import numpy as np
import pytest
from meshreel_bench.codecs import make_codec
from meshreel_bench.codecs.background_once import BackgroundOnceDracoCodec
from meshreel_bench.codecs.draco import DecimatedDracoCodec

from meshreel.decoder.video import open as open_video
from meshreel.errors import FormatError, InputError
from meshreel.format.layout import ChunkKind
from meshreel.geometry.closest_points import Surface, distances
from meshreel.metrics.color import color_errors
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh, MeshList, Texture
from tests.small_scene import balls, scene
from tests.spheres import sliding_sphere

POINT = {"fraction": 0.5, "qp": 10}


def test_meshes_alone_are_those_of_the_file_in_fewer_bytes():
    balls = sliding_sphere(2, levels=3)
    file, alone = make_codec("decimated_draco", POINT), make_codec("decimated_draco", POINT | {"decoder": "DracoPy"})
    assert alone.name == "decimated_draco, DracoPy"
    data, fewer = file.encode(balls), alone.encode(balls)
    assert len(fewer) < len(data)
    for ball, one, other in zip(balls, file.decode(data), alone.decode(fewer), strict=True):
        assert len(one.faces) == len(other.faces) and np.allclose(one.diagonal, other.diagonal, rtol=1e-3)
        quality = surface_errors(ball, one).symmetric_psnr
        assert surface_errors(ball, other).symmetric_psnr == pytest.approx(quality, abs=1)


@pytest.mark.parametrize("wrong", [{"decoder": "zip"}, {"decoder": "DracoPy", "levels": 1}])
def test_what_has_no_decoder_is_refused(wrong):
    with pytest.raises(InputError, match="give DracoPy and no levels"):
        make_codec("decimated_draco", POINT | wrong)


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


BALL = sliding_sphere(1, levels=3)[0]
SHADES = np.linspace(30, 220, 64)[None, :, None] * np.array([1.0, 0.8, 0.6]) * np.linspace(0.6, 1, 64)[:, None, None]
PIXELS = SHADES.astype(np.uint8)


def textured():
    """A ball seen from above and from below, each in a half of the texture."""
    places = BALL.vertices[BALL.faces][..., [0, 2]]
    above = BALL.vertices[BALL.faces].mean(axis=1)[:, 1] > 0
    uv = 0.25 + 0.2 * places + np.where(above, 0.0, 0.5)[:, None, None]
    return replace(BALL, uv=uv.astype(np.float32), texture=Texture.of(PIXELS))


def coded(mesh, **options):
    codec = make_codec("colored_draco", options)
    data = codec.encode(MeshList((mesh, mesh)))
    return codec, data, list(codec.decode(data))


@pytest.mark.parametrize("bits", [4, 8])
def test_colours_of_vertices_come_back_to_their_bits(bits):
    colors = (127 + 120 * BALL.vertices).astype(np.uint8)
    codec, data, frames = coded(replace(BALL, colors=colors), bits=bits)
    assert len(frames) == 2 and surface_errors(BALL, frames[0]).d2_psnr > 50
    found = color_errors(replace(BALL, colors=colors), frames[1])
    assert found["y_psnr"] > {4: 32, 8: 45}[bits] and codec.color_bytes(data) is None


@pytest.mark.parametrize("options", [{"color": "avif", "quality": 80}, {"color": "av1", "quality": 20}])
def test_textures_come_back_with_their_places(options):
    codec, data, frames = coded(textured(), size=64, bits=12, **options)
    assert len(frames) == 2 and color_errors(textured(), frames[1])["y_psnr"] > 32
    sizes = codec.color_bytes(data).pictures
    assert len(sizes) == 2 and all(sizes) and sum(sizes) < len(data)


def test_vertices_show_a_texture_where_these_are_asked_for():
    assert color_errors(textured(), coded(textured())[2][0])["y_psnr"] > 30


def test_frames_without_textures_and_options_out_of_range_are_refused():
    with pytest.raises(InputError, match="frame 0 has no texture; give color vertices"):
        coded(BALL, color="avif")
    wrong_ones = ({"color": "jpeg"}, {"bits": 9}, {"color": "av1", "bits": 21}, {"size": 65}, {"quality": 0}, {"qp": 1})
    for wrong in wrong_ones:
        with pytest.raises(InputError, match="give"):
            make_codec("colored_draco", wrong)


def check(codec, qp):
    balls = MeshList((*sliding_sphere(2, levels=3), Mesh.empty()))
    *decoded, empty = codec.decode(codec.encode(balls))
    assert empty.is_empty and len(decoded) == 2
    for ball, mesh in zip(balls, decoded, strict=False):
        assert len(mesh.faces) == len(ball.faces)
        step = np.ptp(ball.vertices, axis=0).max() / (2**qp - 1)
        assert surface_errors(ball, mesh).symmetric_rms < step


@pytest.mark.parametrize("qp", [8, 12])
def test_meshoptimizer_keeps_surfaces_to_its_lattice(qp):
    pytest.importorskip("meshoptimizer")
    check(make_codec("meshoptimizer", {"qp": qp}), qp)


@pytest.mark.parametrize("level", [0, 5, 10])
def test_draco_keeps_surfaces_at_every_level(level):
    codec = make_codec("draco", {"qp": 10, "level": level})
    assert codec.name == "draco, other levels"
    check(codec, 10)


@pytest.mark.parametrize(
    ("codec", "options", "text"), [("draco", {"level": 11}, "give 0 to 10"), ("meshoptimizer", {"qp": 17}, "16 bits")]
)
def test_points_that_are_not_there_are_refused(codec, options, text):
    with pytest.raises(InputError, match=text):
        make_codec(codec, options)
