"""Baking: texels and the places that they have, colours of texels and vertices, and what lies between charts."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.analysis.appearance.bake import bake, median_colors, picture, texels_of, unwrap, vertex_colors
from meshreel.errors import InputError
from meshreel.geometry.atlas import Layout
from meshreel.geometry.color_views import Painted, bilinear
from meshreel.geometry.topology import subdivide_midpoint
from meshreel.types import GREY, Mesh, Texture
from tests.metrics.shapes import sphere

SQUARE = Mesh.of([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
PLACES = (np.array([[0, 32], [32, 32], [32, 0], [0, 0]], np.int32))[SQUARE.faces]
LAYOUT = Layout(64, 32, np.ascontiguousarray(PLACES))
PICTURE = np.random.default_rng(0).integers(0, 256, (16, 16, 3)).astype(np.uint8)
TEXTURED = replace(SQUARE, uv=(LAYOUT.uv(0) * [2, 1]).astype(np.float32), texture=Texture.of(PICTURE))


@pytest.mark.parametrize("levels", [0, 1, 2])
def test_texels_are_where_the_square_has_them(levels: int) -> None:
    texels = texels_of(LAYOUT, levels)
    rows, columns = np.divmod(texels.pixels, 64)
    assert len(texels.pixels) == 32 * 33 and columns.max() == 32  # one beside the square shows its edge
    wanted = np.stack([np.minimum((columns + 0.5) / 32, 1), 1 - (rows + 0.5) / 32, 0 * rows], axis=1)
    wrong, inside = np.abs(texels.places(subdivide_midpoint(SQUARE, levels)) - wanted), columns < 32
    assert wrong[inside].max() < 1e-12 and wrong.max() < 0.5 / 32


def test_a_texture_of_twice_the_size_has_the_same_colors() -> None:
    texels = texels_of(LAYOUT, 1)
    colors, seen = bake(Painted(TEXTURED), subdivide_midpoint(SQUARE, 1), texels)
    rows, columns = np.divmod(texels.pixels, 64)
    wanted, inside = bilinear(PICTURE, np.stack([(columns + 0.5) / 32, 1 - (rows + 0.5) / 32], axis=1)), columns < 32
    assert seen.all() and np.abs(colors - wanted)[inside].max() <= 0.51


def test_a_chart_has_no_seam_of_what_lies_beside_it() -> None:
    texels = texels_of(LAYOUT, 0)
    bands = np.where(np.arange(32) // 4 % 2 == 0, 40, 220).astype(np.uint8)[texels.pixels // 64]
    whole = picture(texels, SQUARE, bands[:, None].repeat(3, axis=1), np.ones(len(bands), bool))
    edge = bilinear(whole, np.column_stack([np.full(32, 0.5), 1 - (np.arange(32) + 0.5) / 32]))[:, 0]
    assert np.abs(edge - bands[texels.pixels % 64 == 31]).max() <= 2  # half of it is beside the chart


def test_what_is_between_charts_leads_from_one_to_the_other() -> None:
    texels = texels_of(LAYOUT, 0)
    colors = np.full((len(texels.pixels), 3), 200, np.uint8)
    whole = picture(texels, SQUARE, colors, np.ones(len(colors), bool))
    assert whole.shape == (32, 64, 3) and (whole == 200).all()
    half = texels.pixels % 64 < 16
    colors[half] = 100
    unseen = picture(texels, SQUARE, colors, (texels.pixels % 64 < 8) | (texels.pixels % 64 >= 24))
    assert (np.diff(unseen[10, :32, 0].astype(int)) >= 0).all() and 100 < unseen[10, 16, 0] < 200
    assert (picture(texels, SQUARE, colors, np.zeros(len(colors), bool)) == GREY).all()


def test_texels_that_nobody_saw_have_the_color_of_their_surface_and_not_of_the_chart_beside() -> None:
    apart = Mesh.of([*SQUARE.vertices, *SQUARE.vertices + [0, 0, 1]], [*SQUARE.faces, *SQUARE.faces + 4])
    near = subdivide_midpoint(apart, 2)
    places = np.concatenate([PLACES[:, :, :], PLACES + [32, 0]])  # side by side, without a gap
    texels = texels_of(Layout(64, 32, np.ascontiguousarray(places.astype(np.int32))), 2)
    left = texels.pixels % 64 < 32
    colors = np.where(left[:, None], 40, 220).astype(np.uint8).repeat(3, axis=1)
    found = picture(texels, near, colors, (texels.pixels % 64 < 30) & (texels.pixels % 64 != 0) | ~left)
    assert (found[:, :32] == 40).all() and (found[:, 32:] == 220).all()


def test_colors_that_are_linear_on_faces_are_those_of_the_vertices() -> None:
    ball = subdivide_midpoint(sphere(levels=2), 1)
    colors = (120 + 100 * ball.vertices / np.abs(ball.vertices).max()).astype(np.uint8)
    found = vertex_colors(Painted(replace(ball, colors=colors)), ball)
    assert np.abs(found.astype(int) - colors).max() <= 4


def test_the_median_has_no_ghost_of_who_passes() -> None:
    points = SQUARE.vertices
    usual, passer = np.full((4, 3), 50.0), np.full((4, 3), 250.0)

    class Seen:
        def __init__(self, colors: np.ndarray, known: list[bool]) -> None:
            self.answer = colors, np.array(known)

        def at(self, *_):
            return self.answer

        def pixels_on(self, _):
            return 0.0

    frames = [Seen(usual, [True, True, True, False])] * 3 + [Seen(passer, [True, True, False, False])]
    colors, seen = median_colors(points, points, frames)
    assert seen.tolist() == [True, True, True, False]
    assert colors[:3].tolist() == [[50, 50, 50]] * 3 and colors[3].tolist() == [GREY] * 3
    assert not median_colors(points, points, [])[1].any()


def test_unwrapped_faces_do_not_overlap_and_fill_a_third_of_the_texture() -> None:
    pytest.importorskip("xatlas")
    ball = sphere(levels=3)
    layout = unwrap(ball, [256])
    assert layout.width == 256 and layout.height <= 256 and layout.places.min() >= 0
    texels = texels_of(layout, 0)
    a, b, c = np.moveaxis(layout.places.astype(float), 1, 0)
    areas = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert areas.sum() > layout.width * layout.height / 3
    assert 1 < len(texels.pixels) / areas.sum() < 1.1  # texels that two faces have would count once
    np.testing.assert_array_equal(unwrap(ball, [256]).places, layout.places)


def test_a_mesh_of_many_small_charts_takes_the_first_texture_into_which_it_fits() -> None:
    pytest.importorskip("xatlas")
    corners = np.random.default_rng(0).random((900, 1, 3)) * [40, 40, 1] + np.eye(3)
    rags = Mesh.of(corners.reshape(-1, 3), np.arange(2700).reshape(-1, 3))
    assert unwrap(rags, [128, 256, 512]).width == 256
    with pytest.raises(InputError, match="900 faces does not fit a texture of 128 texels"):
        unwrap(rags, [128])
