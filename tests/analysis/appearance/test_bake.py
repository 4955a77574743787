"""Baking: texels and the places that they have, colours of texels and vertices, and what lies between charts."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.analysis.appearance.bake import (
    bake,
    median_colors,
    picture,
    projected,
    shown_whole,
    steady_normals,
    texels_of,
    unwrap,
    vertex_colors,
)
from meshreel.errors import InputError
from meshreel.geometry.atlas import Layout
from meshreel.geometry.cameras import Camera, CameraPose
from meshreel.geometry.color_views import ColorPicture, ColorViews, Painted, bilinear
from meshreel.geometry.topology import concatenate, face_normals, subdivide_midpoint, unique_edges
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


WALL = Mesh.of([[-1, -0.6, 2], [1, -0.6, 2], [1, 0.6, 2], [-1, 0.6, 2]], [[0, 2, 1], [0, 3, 2]])  # faces both cameras
INTRINSIC = np.array([[100.0, 0, 80], [0, 100, 60], [0, 0, 1]])


def looking(*sides: float) -> list[ColorPicture]:
    """Pictures of cameras that look along +z from places beside the origin."""
    poses = [CameraPose.of_world(np.array([[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])) for x in sides]
    camera = Camera.of(160, 120, INTRINSIC, np.eye(4))
    return [ColorPicture(replace(camera, pose=pose), np.zeros((120, 160, 3), np.uint8)) for pose in poses]


def test_a_large_face_that_something_hides_is_cut_and_each_piece_is_whole_in_a_picture() -> None:
    screen = Mesh.of([[-0.05, -0.05, 1], [0.05, -0.05, 1], [0.05, 0.05, 1], [-0.05, 0.05, 1]], [[0, 2, 1], [0, 3, 2]])
    mesh = concatenate([WALL, screen])
    views = ColorViews(looking(-0.2), mesh)
    whole = projected(mesh, views)[0].places[:2]
    assert (whole == whole[:, :1]).all(axis=(1, 2)).any()  # the picture has not all of it
    cut = shown_whole(mesh, views)
    places = projected(cut, views)[0].places
    placed = (places != places[:, :1]).any(axis=(1, 2))
    area = face_normals(cut)[1]
    assert area[placed].sum() > 0.95 * area.sum() and 20 < len(cut.faces) < 1500
    assert shown_whole(WALL, ColorViews(looking(0.0), WALL)) is WALL  # all of it is seen, and squarely


def test_a_large_face_that_perspective_bends_is_cut() -> None:
    floor = Mesh.of([[-0.6, 0.5, 1], [0.6, 0.5, 1], [0.6, 0.5, 4], [-0.6, 0.5, 4]], [[0, 1, 2], [0, 2, 3]])  # y is down
    [picture] = looking(0.0)
    cut = shown_whole(floor, ColorViews([picture], floor))
    corners = picture.project(cut.vertices)[0][cut.faces]
    middles = cut.vertices[cut.faces].mean(axis=1)
    off = np.linalg.norm(picture.project(middles)[0] - corners.mean(axis=1), axis=1)
    assert 8 < len(cut.faces) < 800 and off.max() < 0.5  # pixels


def test_faces_beside_each_other_are_in_one_picture_where_both_show_them_as_well(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mesh = subdivide_midpoint(WALL, 4)
    mesh = mesh.at(mesh.vertices + np.random.default_rng(0).normal(0, 0.01, mesh.vertices.shape))  # rough
    views, (edges, sides) = ColorViews(looking(-0.1, 0.1), mesh), unique_edges(mesh.faces)

    def seams() -> float:
        """The share of edges between two pictures."""
        layout, scale = projected(mesh, views)
        first = layout.places[:, 0, 0] < 160 * scale
        counts = np.stack([np.bincount(sides[of].reshape(-1), minlength=len(edges)) for of in (first, ~first)])
        return float((counts > 0).all(axis=0).mean())

    few = seams()
    monkeypatch.setattr("meshreel.analysis.appearance.bake.SEAM", 0.0)
    assert few < 0.08 and few < seams() / 3


def test_a_thin_face_has_the_normal_of_the_faces_beside_it() -> None:
    bent = Mesh.of(
        [[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, -1e-6, 1e-3], [0.5, -1, 0]],
        [[0, 1, 2], [0, 3, 1], [0, 4, 3], [3, 4, 1]],
    )
    normals = steady_normals(bent)
    assert face_normals(bent)[0][1, 2] < 0.1 and normals[1, 2] > 0.99
    np.testing.assert_array_equal(normals[[0, 2, 3]], face_normals(bent)[0][[0, 2, 3]])
