"""Coloured pictures and their errors, on shapes of which the answer is known."""

import math
from dataclasses import replace

import numpy as np
import pytest

from meshreel.metrics.color import render_errors
from meshreel.metrics.comparison import ComparisonOptions, compare_sequences
from meshreel.metrics.viewpoints import Box, ViewOptions, views_around
from meshreel.types import Mesh, Texture
from tests.metrics.rendered import render_colors
from tests.metrics.shapes import sphere

BALL = sphere(levels=4)
VIEWS = views_around(Box.of([BALL]), ViewOptions(96, 96))


def painted(grey: int, mesh: Mesh = BALL) -> Mesh:
    return replace(mesh, colors=np.full(mesh.vertices.shape, grey, np.uint8))


def test_a_picture_shows_colours_on_white() -> None:
    picture = render_colors(painted(40), VIEWS[0])
    assert set(np.unique(picture)) == {40, 255}
    assert (render_colors(BALL, VIEWS[0]) == 128).any()  # without colours: grey
    assert (render_colors(Mesh.empty(), VIEWS[0]) == 255).all()


def test_a_picture_shows_the_texture_the_right_way_up() -> None:
    """A square seen from the front: the upper half of its texture is black."""
    corners, faces = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float), [[0, 1, 2], [0, 2, 3]]
    square = Mesh.of(corners, faces)
    pixels = np.full((8, 8, 3), 200, np.uint8)
    pixels[:4] = 0
    uv = corners[square.faces][..., :2].astype(np.float32)
    picture = render_colors(replace(square, uv=uv, texture=Texture.of(pixels)), VIEWS[0])
    dark, light = np.nonzero(picture[..., 0] == 0)[0], np.nonzero(picture[..., 0] == 200)[0]
    assert len(dark) and len(light) and dark.max() < light.min()


def test_luma_that_differs_by_a_constant_has_the_psnr_of_the_formula() -> None:
    found = render_errors(painted(100), painted(110), VIEWS)
    assert found["view_y_psnr"] == pytest.approx(20 * math.log10(25.5)) == found["view_y_psnr_inside"]
    assert 0.9 < found["view_ssim"] < 1


def test_equal_meshes_are_perfect_and_so_is_nothing() -> None:
    for mesh in (painted(7), Mesh.empty()):
        found = render_errors(mesh, mesh, VIEWS)
        assert (found["view_y_psnr"], found["view_y_psnr_inside"], found["view_ssim"]) == (math.inf, math.inf, 1.0)


def test_silhouettes_count_in_the_union_alone() -> None:
    moved = painted(60, BALL.at(BALL.vertices + [0.1, 0.0, 0.0]))
    found = render_errors(painted(60), moved, VIEWS)
    assert found["view_y_psnr_inside"] == math.inf and 10 < found["view_y_psnr"] < 25
    lost = render_errors(painted(55), Mesh.empty(), VIEWS)
    assert lost["view_y_psnr"] == pytest.approx(20 * math.log10(255 / 200)) and lost["view_y_psnr_inside"] == math.inf


def test_a_comparison_with_views_has_them_where_both_have_colours() -> None:
    options = ComparisonOptions(views=ViewOptions(96, 96))
    row = compare_sequences([painted(100)], [painted(110)], options).to_row()
    assert row["view_y_psnr"] == row["view_y_psnr_inside"] == pytest.approx(20 * math.log10(25.5))
    assert row["view_ssim"] == row["view_ssim_worst"] < 1
    assert "view_ssim" not in compare_sequences([painted(100)], [BALL], options).to_row()
