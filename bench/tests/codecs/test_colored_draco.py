"""Draco with colours: what comes back, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from meshreel_bench.codecs import make_codec

from meshreel.errors import InputError
from meshreel.metrics.color import color_errors
from meshreel.metrics.distance import surface_errors
from meshreel.types import MeshList, Texture
from tests.spheres import sliding_sphere

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
    assert found.y > {4: 32, 8: 45}[bits] and codec.color_bytes(data) is None


@pytest.mark.parametrize("options", [{"color": "avif", "quality": 80}, {"color": "av1", "quality": 20}])
def test_textures_come_back_with_their_places(options):
    codec, data, frames = coded(textured(), size=64, bits=12, **options)
    assert len(frames) == 2 and color_errors(textured(), frames[1]).y > 32
    sizes = codec.color_bytes(data).pictures
    assert len(sizes) == 2 and all(sizes) and sum(sizes) < len(data)


def test_vertices_show_a_texture_where_these_are_asked_for():
    assert color_errors(textured(), coded(textured())[2][0]).y > 30


def test_frames_without_textures_and_options_out_of_range_are_refused():
    with pytest.raises(InputError, match="frame 0 has no texture; give color vertices"):
        coded(BALL, color="avif")
    wrong_ones = ({"color": "jpeg"}, {"bits": 9}, {"color": "av1", "bits": 21}, {"size": 65}, {"quality": 0}, {"qp": 1})
    for wrong in wrong_ones:
        with pytest.raises(InputError, match="give"):
            make_codec("colored_draco", wrong)
