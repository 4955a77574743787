"""Pictures of meshes: known places have known colours, edges are smooth, and the same bytes come with any threads."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.geometry.picture import MARGIN, Body, Standing, Viewpoint, draw_picture, finished
from meshreel.geometry.threads import threads
from meshreel.types import UPS, Mesh, Texture, Up

from ..metrics.shapes import plane, sphere

SIZE = (96, 64)
BEFORE = Viewpoint((0.0, 0.0, 3.0), (0.0, 0.0, 0.0))  # sees 3 x 2.485 at the target
QUAD = Mesh.of([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]])
UV = ((QUAD.vertices[QUAD.faces][:, :, :2] + 1) / 2).astype(np.float32)
RED, GREEN, BLUE, WHITE = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)


def drawn(
    mesh: Mesh, view: Viewpoint = BEFORE, background: tuple[int, ...] | None = WHITE, ground: bool = False
) -> np.ndarray:
    standing = Standing(mesh.box)
    return finished(draw_picture([Body.of_track(mesh)], standing, view, SIZE, ground), background)


def pixel(picture: np.ndarray, x: float, y: float) -> tuple[int, ...]:
    """The colour where `BEFORE` sees a place of the plane z = 0."""
    scale = SIZE[1] / 2 / (3 * (np.sqrt(2) - 1))
    return tuple(picture[int(SIZE[1] / 2 - scale * y), int(SIZE[0] / 2 + scale * x)].tolist())


def test_a_textured_quad_has_the_colours_of_its_texture_where_they_belong():
    quarters = np.array([[RED, GREEN], [BLUE, WHITE]], np.uint8).repeat(32, axis=0).repeat(32, axis=1)
    seen = drawn(replace(QUAD, uv=UV, texture=Texture.of(quarters)), background=(1, 2, 3))
    assert [pixel(seen, x, y) for x, y in ((-0.5, 0.5), (0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))] == [
        RED,
        GREEN,
        BLUE,
        WHITE,
    ]
    assert pixel(seen, 1.2, 0) == (1, 2, 3)


def test_a_texture_is_in_perspective():
    """Of a floor that runs away, more than half of what is seen of it is its nearer half."""
    floor = replace(QUAD, vertices=QUAD.vertices[:, [0, 2, 1]] * [1, 1, -2] - [0, 0.4, 0], uv=UV)
    halves = np.array([[RED], [GREEN]], np.uint8).repeat(64, axis=0).repeat(64, axis=1)
    seen = drawn(replace(floor, texture=Texture.of(halves)))[:, SIZE[0] // 2]
    assert 2 * (seen == RED).all(axis=1).sum() < (seen == GREEN).all(axis=1).sum()


def test_a_fine_texture_far_away_is_its_mean_and_does_not_flicker():
    checks = (np.indices((512, 512)).sum(axis=0) % 2 * 255).astype(np.uint8)[..., None].repeat(3, axis=2)
    seen = drawn(replace(QUAD, uv=UV, texture=Texture.of(checks)))
    inner = seen[16:-16, 24:-24].astype(int)
    assert abs(inner.mean() - 128) < 2 and inner.std() < 8


def test_colours_of_vertices_are_blended_and_not_lit():
    colors = np.array([RED, RED, BLUE, BLUE], np.uint8)
    seen = drawn(replace(QUAD, colors=colors))
    assert np.abs(np.subtract(pixel(seen, 0.3, 0), (127, 0, 127))).max() < 8
    assert seen[..., 1].min() == 0


def test_edges_are_smooth_and_a_ball_covers_what_it_should():
    alpha = drawn(sphere(0.5, 5), background=None)[..., 3] / 255
    radius = SIZE[1] / 2 / (np.sqrt(2) - 1) * 0.5 / np.sqrt(3**2 - 0.5**2)  # of its outline, pixels
    assert set(np.unique(4 * alpha.round(2))) == {0, 1, 2, 3, 4}
    assert alpha.sum() == pytest.approx(np.pi * radius**2, rel=0.01)


def test_a_surface_without_colours_is_clay_lit_from_beside_the_viewer():
    seen = drawn(sphere(0.5, 4), background=None)
    rows, columns = np.nonzero(seen[..., 3] == 255)
    light = seen[rows, columns, :3].astype(float)
    assert light[:, 0].max() > 200 > 90 > light[:, 0].min() and (light[:, 0] >= light[:, 2]).all()
    upper_right, lower_left = (rows < 24) & (columns > 54), (rows > 40) & (columns < 42)
    assert light[upper_right].mean() > 1.3 * light[lower_left].mean()


def test_both_sides_of_a_surface_are_lit_alike():
    assert np.array_equal(drawn(QUAD), drawn(replace(QUAD, faces=QUAD.faces[:, ::-1])))


def test_the_nearest_part_is_seen_and_a_background_behind_bodies():
    near, far = (replace(QUAD, colors=np.tile(np.uint8(c), (4, 1))) for c in (RED, GREEN))
    bodies = [Body.of_track(near.at(QUAD.vertices * 0.5 + [0, 0, 0.5])), Body.behind(far)]
    for order in (bodies, bodies[::-1]):
        seen = finished(draw_picture(order, Standing(far.box), BEFORE, SIZE), WHITE)
        assert pixel(seen, 0, 0) == RED and pixel(seen, 0.8, 0.8) == GREEN


def test_tracks_have_clay_of_their_own():
    seen = {tuple(Body.of_track(QUAD, track).clay.round().tolist()) for track in range(15)}
    assert len(seen) == 15


@pytest.mark.parametrize("up", UPS)
def test_a_view_of_the_whole_shows_all_of_it_upright(up: Up):
    box = np.array([[1.0, 2, 3], [1.5, 4, 3.5]])
    mesh = Mesh.of(
        [[x, y, z] for x in box[:, 0] for y in box[:, 1] for z in box[:, 2]], [[0, 3, 7], [0, 4, 7], [1, 2, 6]]
    )
    standing = Standing(mesh.box, up)
    camera = standing.fitted(*SIZE).camera(up, *SIZE)
    places = camera.project(camera.local(mesh.vertices))
    assert (places > 0).all() and (places < SIZE).all() and np.isfinite(places).all()
    assert np.abs(places / SIZE - 0.5).max() == pytest.approx(0.5 / MARGIN, abs=0.01)  # and as large as it can be
    assert places[:, 1].min() == pytest.approx(SIZE[1] - places[:, 1].max(), abs=2)  # about the middle
    above = camera.project(camera.local(np.array([standing.middle, standing.middle + np.eye(3)["xyz".index(up[-1])]])))
    assert (above[1, 1] < above[0, 1]) == (not up.startswith("-"))


def test_a_turned_view_goes_around_at_the_same_height_and_comes_back():
    view = Viewpoint((1.0, 2.0, 3.0), (0.5, 0.0, 0.0))
    places = np.array([view.turned(share, "z").position for share in (0, 0.25, 0.5, 1)])
    assert np.allclose(places, [[1, 2, 3], [2.5, -0.5, 3], [0, -2, 3], [1, 2, 3]], atol=1e-9)


def test_a_view_straight_from_above_has_a_picture():
    seen = drawn(replace(plane(2.0, 2)), Viewpoint((0.0, 3.0, 0.0), (0.0, 0.0, 0.0)), background=None)
    assert np.isfinite(seen).all()


def test_the_ground_has_a_shadow_below_a_body_and_fades_away():
    ball = sphere(0.5, 3)
    bare, grounded = (
        drawn(ball, Viewpoint((0.0, 1.0, 3.0), (0.0, -0.3, 0.0)), None, ground)[..., 3] for ground in (False, True)
    )
    more = grounded.astype(int) - bare
    assert (more >= 0).all() and more.max() > 120 and grounded[0].max() == 0
    assert np.abs(np.nonzero(more > 60)[1].mean() - (SIZE[0] - 1) / 2) < 1


def test_the_same_picture_comes_with_any_number_of_threads():
    ball = sphere(0.5, 4)
    with threads(3):
        several = drawn(ball, ground=True)
    assert np.array_equal(drawn(ball, ground=True), several)


def test_a_picture_of_nothing_is_the_background():
    empty = Mesh.empty()
    seen = finished(draw_picture([Body.behind(empty)], Standing((np.zeros(3), np.ones(3))), BEFORE, SIZE), RED)
    assert (seen == RED).all()


def test_a_files_view_whose_target_is_before_all_that_is_shown_stays_where_it_is():
    for low, high in (((-0.1, 0.8, -2.5), (0.1, 1.0, -2.3)), ((0, 0.9, 0), (0, 0.9, 0))):
        given = Viewpoint((0, 0.9, 2), (0, 0.9, 0))
        assert Standing((np.array(low, np.float64), np.array(high, np.float64))).framed(given, 1600, 900) == given


@pytest.mark.parametrize(
    ("box", "away", "aspect", "times"),
    [  # of somebody who walks from side to side, as the player's test of `timesAway` has it, and who stands
        ([[-2, 0, -0.3], [2, 1.8, 0.3]], [0, 0.5, 6.5], 16 / 9, 0.5935),
        ([[-2, 0, -0.3], [2, 1.8, 0.3]], [0, 0.5, 6.5], 0.5, 2),
        ([[-2, 0, -0.3], [2, 1.8, 0.3]], [0, 0, 1], 16 / 9, 1),
        ([[-0.4, 0, -0.3], [0.4, 1.8, 0.3]], [0, 0.4, 2.8], 16 / 9, 1),
    ],
)
def test_a_files_view_comes_nearer_where_the_sides_of_a_wide_picture_would_be_empty(box, away, aspect, times):
    low, high = np.array(box, np.float64)
    target = np.array([0, 0.9, 0])
    view = Standing((low, high)).framed(Viewpoint(tuple(target + away), tuple(target)), round(900 * aspect), 900)
    assert np.allclose(np.array(view.position) - target, times * np.array(away), rtol=1e-4)
