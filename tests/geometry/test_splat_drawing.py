"""Splats in pictures: one has its profile and colour, nearer ones are on top, and surface before them hides them."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.analysis.appearance.splat_raster import draw
from meshreel.geometry import picture, splat_drawing
from meshreel.geometry.picture import Body, Standing, draw_picture, finished
from meshreel.geometry.splat_drawing import BLUR, LEAST
from meshreel.geometry.splats import Bound, Carrier, bind
from meshreel.types import Mesh
from tests.geometry.test_picture import BEFORE, GREEN, QUAD, RED, SIZE, WHITE, pixel
from tests.metrics.shapes import sphere
from tests.splats import some_splats

FOCAL = SIZE[1] / 2 / (np.sqrt(2) - 1)  # pixels
BALL = sphere(0.5, levels=1)
MANY = bind(some_splats(300, len(BALL.faces)), Carrier(BALL.vertices, BALL.faces, 0))


def round_splats(depths: list[float], colors: list[tuple[int, ...]], opacity: float = 1.0, scale: float = 0.2) -> Bound:
    """Round splats on the axis of `BEFORE`, so far from the camera."""
    count = len(depths)
    means = np.array([[0.0, 0.0, 3.0 - depth] for depth in depths])
    shape = np.tile(np.eye(3), (count, 1, 1)), np.full((count, 3), scale), np.full(count, opacity)
    return Bound(means, *shape, np.array(colors) / 255.0)


def drawn(splats: Bound, *others: Body, patches: Mesh | None = None) -> np.ndarray:
    body = replace(Body.of_track(QUAD), splats=splats, patches=patches)
    return draw_picture([body, *others], Standing(QUAD.box), BEFORE, SIZE)


def test_a_round_splat_has_a_gaussian_profile_and_its_colour() -> None:
    seen = drawn(round_splats([3.0], [(255, 102, 0)], 0.8))
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    squared = (rows - SIZE[1] / 2) ** 2 + (columns - SIZE[0] / 2) ** 2
    alpha = 0.8 * np.exp(-squared / (2 * ((0.2 * FOCAL / 3) ** 2 + BLUR)))
    alpha[alpha < LEAST] = 0
    np.testing.assert_allclose(seen[..., 3], alpha, atol=1e-12)
    np.testing.assert_allclose(seen[..., :3], alpha[..., None] * [1, 0.4, 0], atol=1e-12)


@pytest.mark.parametrize("depths", [[2.0, 2.5], [2.5, 2.0]])
def test_the_nearer_of_two_splats_is_on_top(depths: list[float]) -> None:
    seen = finished(drawn(round_splats(depths, [RED, GREEN])), WHITE)
    np.testing.assert_allclose(pixel(seen, 0, 0), RED if depths[0] < depths[1] else GREEN, atol=2)


def test_splats_behind_the_camera_are_not_seen() -> None:
    assert not drawn(round_splats([-1.0, 0.0], [RED, GREEN])).any()


def test_splats_are_drawn_in_place_of_the_surface_but_for_patches() -> None:
    nothing = round_splats([3.0], [RED], 0.0)
    assert not drawn(nothing).any()
    assert drawn(nothing, patches=QUAD.at(QUAD.vertices / 2))[..., 3].any()


@pytest.mark.parametrize("depth", [2.5, 3.5])
def test_a_background_hides_what_is_behind_it(depth: float) -> None:
    wall = Body.behind(replace(QUAD, colors=np.tile(np.uint8(GREEN), (4, 1))))
    seen = finished(drawn(round_splats([depth], [RED]), wall), WHITE)
    np.testing.assert_allclose(pixel(seen, 0, 0), RED if depth < 3 else GREEN, atol=2)


def test_they_look_as_those_of_the_fit_do() -> None:
    seen, fitted = drawn(MANY), draw(MANY, BEFORE.camera("y", *SIZE))
    np.testing.assert_allclose(seen[..., :3] + 1 - seen[..., 3:], fitted, atol=1e-3)


def test_a_picture_does_not_depend_on_the_bands_or_sets_in_which_it_is_drawn(monkeypatch) -> None:
    whole = drawn(MANY)
    monkeypatch.setattr(picture, "BAND", 8)
    monkeypatch.setattr(splat_drawing, "TOGETHER", 64)
    np.testing.assert_array_equal(drawn(MANY), whole)
