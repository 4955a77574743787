import numpy as np
import pytest

from meshreel.metrics import render
from meshreel.metrics.render import look, ssim_map, ssim_normals
from meshreel.metrics.viewpoints import Box, ViewOptions, views_around
from meshreel.types import Mesh

from .shapes import moved, noisy, sphere

SMALL = ViewOptions(160, 120)


def _views(mesh: Mesh) -> list:
    return views_around(Box.of([mesh]), SMALL)


def test_the_whole_form_is_scikit_image_on_the_whole_picture():
    skimage = pytest.importorskip("skimage.metrics")
    a, b = moved(sphere(levels=3), (0.3, 0, 0)), noisy(sphere(levels=3), 0.02)
    cameras = views_around(Box(np.full(3, -2.0), np.full(3, 2.0)), SMALL)
    expected = [
        skimage.structural_similarity(
            *(look(m, camera).colors.astype(float) for m in (a, b)),
            win_size=7,
            channel_axis=-1,
            data_range=1.0,
        )
        for camera in cameras
    ]
    result = ssim_normals(a, b, cameras)
    assert result["ssim"] == pytest.approx(np.mean(expected), abs=1e-9)


def test_the_masked_form_is_the_mean_over_pixels_that_either_mesh_covers():
    a, b = moved(sphere(levels=3), (0.1, 0, 0)), noisy(sphere(levels=3), 0.02)
    cameras = _views(a)
    expected = []
    for camera in cameras:
        views = [look(m, camera) for m in (a, b)]
        covered = np.pad((views[0].covered | views[1].covered)[3:-3, 3:-3], 3)
        scores = ssim_map(*(v.colors.astype(float) for v in views))
        expected.append(scores[covered].mean())
    result = ssim_normals(a, b, cameras)
    assert result["ssim_masked"] == pytest.approx(np.mean(expected), abs=1e-9)
    assert result["ssim_masked"] < result["ssim"]  # the background flatters


def test_one_window_agrees_with_the_formula():
    rng = np.random.default_rng(0)
    a, b = rng.random((2, 7, 7, 3))
    scores = []
    for channel in range(3):
        x, y = a[..., channel].ravel(), b[..., channel].ravel()
        covariance = np.cov(x, y)  # the unbiased form
        top = (2 * x.mean() * y.mean() + 1e-4) * (2 * covariance[0, 1] + 9e-4)
        scores.append(top / ((x.mean() ** 2 + y.mean() ** 2 + 1e-4) * (covariance[0, 0] + covariance[1, 1] + 9e-4)))
    assert ssim_map(a, b)[3, 3] == pytest.approx(np.mean(scores))


def test_identical_meshes_score_one_and_more_noise_scores_less():
    body = sphere(levels=4)
    assert ssim_normals(body, body, _views(body))["ssim_masked"] == pytest.approx(1)
    views = views_around(Box.of([body]), ViewOptions(128, 128))
    scores = [ssim_normals(body, noisy(body, sigma), views)["ssim_masked"] for sigma in (0.0, 0.005, 0.02, 0.05)]
    assert scores[0] == pytest.approx(1) and scores == sorted(scores, reverse=True)


def test_a_larger_background_flatters_the_whole_form_and_not_the_masked_one():
    a, b = sphere(levels=4), noisy(sphere(levels=4), 0.01)
    tight = ssim_normals(a, b, views_around(Box.of([a]), ViewOptions(200, 200)))
    wide = ssim_normals(a, b, views_around(Box(np.full(3, -2.0), np.full(3, 2.0)), ViewOptions(400, 400)))
    assert wide["ssim"] > tight["ssim"] + 0.03
    assert wide["ssim_masked"] == pytest.approx(tight["ssim_masked"], abs=0.02)


def test_normals_are_computed_once_for_all_views(monkeypatch):
    own, found = render.welded_normals, []
    monkeypatch.setattr(render, "welded_normals", lambda mesh: found.append(mesh) or own(mesh))
    body = sphere(levels=2)
    ssim_normals(body, noisy(body, 0.01), _views(body))
    assert len(found) == 2 and len(_views(body)) == 4


def test_empty_frames_score_one_on_both_sides_and_less_on_one_side():
    body, nothing = sphere(), Mesh.empty()
    cameras = _views(body)
    assert (
        ssim_normals(nothing, nothing, cameras)["ssim_masked"] == ssim_normals(nothing, nothing, cameras)["ssim"] == 1
    )
    assert ssim_normals(body, nothing, cameras)["ssim_masked"] < 0.5


def test_views_that_see_neither_mesh_are_left_out_of_the_masked_mean():
    body = sphere()
    away = views_around(Box(np.full(3, 100.0), np.full(3, 101.0)), SMALL)
    there = _views(body)[:1]
    one, two = (ssim_normals(body, noisy(body, 0.05), cameras) for cameras in (there, [*there, away[0]]))
    assert two["ssim_masked"] == one["ssim_masked"] and two["ssim"] == (one["ssim"] + 1) / 2
