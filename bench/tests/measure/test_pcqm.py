"""PCQM where the answer is known."""

from dataclasses import replace

import numpy as np
import pytest
from meshreel_bench.measure import pcqm as module
from meshreel_bench.measure.pcqm import WEIGHTS, WORST, Cloud, lightness, pcqm

from meshreel.types import Mesh
from tests.spheres import sliding_sphere

BALL = sliding_sphere(1, levels=4)[0]


@pytest.fixture(autouse=True)
def few_points(monkeypatch):
    monkeypatch.setattr(module, "RADIUS", 0.04)  # 10,000 points on a ball in place of 250,000


def painted(colors, mesh=BALL):
    return replace(mesh, colors=np.broadcast_to(np.uint8(colors), mesh.vertices.shape).copy())


def moved(mesh, lengths):
    return mesh.at(mesh.vertices * (1 + lengths[:, None]))


def test_equal_surfaces_have_none_and_a_missing_one_is_the_worst():
    noise = np.random.default_rng(1).integers(0, 255, BALL.vertices.shape)
    assert pcqm(painted(noise), painted(noise)) == 0 == pcqm(Mesh.empty(), Mesh.empty())
    assert pcqm(BALL, Mesh.empty()) == WORST == pcqm(Mesh.empty(), BALL) == WEIGHTS.sum()


def test_a_step_of_lightness_everywhere_is_that_of_the_formula():
    one, two = lightness(np.array([[90.0, 120, 150], [100, 130, 160]]))
    wanted = WEIGHTS[1] * (1 - 1 / (0.002 * (one - two) ** 2 + 1))
    assert pcqm(painted((90, 120, 150)), painted((100, 130, 160))) == pytest.approx(wanted, rel=1e-6)


def test_lightness_is_that_of_ciede2000():
    greys = np.repeat([[0.0], [118.92], [255.0]], 3, axis=1)  # L* of 0, 50 and 100
    black, middle, white = lightness(greys)
    assert (black, middle / white) == pytest.approx((0, 0.5), abs=1e-3)
    # Lightness differs by Delta L / S_L: here, close to white, S_L is that of L* = 100.
    near = lightness(np.array([[255.0] * 3, [254.9] * 3]))
    star = 116 * (1 - np.cbrt(((254.9 / 255 + 0.055) / 1.055) ** 2.4))
    assert near[0] - near[1] == pytest.approx(star / (1 + 0.015 * 2500 / np.sqrt(2520)), rel=0.01)


@pytest.mark.parametrize("size", [1.0, 7.0])
def test_curvature_is_one_over_the_radius_of_a_ball(size):
    cloud = Cloud.of(BALL.at(size * BALL.vertices), 0.15 * size)
    assert np.median(cloud.curvature(cloud.points)) == pytest.approx(1 / size, rel=0.1)


def test_colours_that_are_turned_round_have_another_structure_though_their_lightness_is_the_same(monkeypatch):
    monkeypatch.setattr(module, "RADIUS", 0.1)  # of many vertices
    signs = np.random.default_rng(2).choice([-1, 1], (len(BALL.vertices), 1))
    score = pcqm(painted(120 + 8 * signs), painted(120 - 8 * signs))  # covariance is minus the variance
    assert 2 * WEIGHTS[2] * 0.8 < score < 2 * WEIGHTS[2] * 1.1


def test_faces_in_another_order_are_nearly_the_same_surface():
    """Points then lie elsewhere; colours are those of the nearest ones, which a smooth surface nearly shares."""
    smooth = replace(BALL, colors=(128 + 60 * np.sin(2 * BALL.vertices)).astype(np.uint8))
    order = np.random.default_rng(5).permutation(len(BALL.faces))
    other = Mesh(smooth.vertices, smooth.faces[order], smooth.colors)
    shifted = replace(smooth, colors=smooth.colors + np.uint8(10))
    assert 0 < pcqm(smooth, other) < 0.2 * pcqm(smooth, shifted)


def test_rough_surface_is_worse_the_rougher_it_is():
    lengths = np.random.default_rng(3).normal(size=len(BALL.vertices))
    scores = [pcqm(BALL, moved(BALL, by * lengths)) for by in (0.002, 0.01)]
    assert 0 < scores[0] < scores[1] <= WEIGHTS[0]


def test_it_does_not_depend_on_the_unit():
    rng = np.random.default_rng(4)
    colors = rng.integers(60, 180, (2, *BALL.vertices.shape))
    pair = [painted(each) for each in colors]
    assert pcqm(*(mesh.at(1024 * mesh.vertices) for mesh in pair)) == pytest.approx(pcqm(*pair), rel=1e-6)
