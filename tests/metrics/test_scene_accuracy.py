"""Accuracy and coverage on scenes with known answers: a ball that moves in front of a still wall."""

import math

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.geometry.cameras import Camera
from meshreel.metrics.distance import PSNR_CEILING
from meshreel.metrics.scene_accuracy import (
    Scene,
    Sight,
    SightOptions,
    compare_with_truth,
    scene_means,
    scene_row,
    visible,
)
from meshreel.types import Mesh
from tests.metrics.shapes import moved, noisy, plane, sphere

WALL, BALL = 1.0, 0.4  # m: the wall is at z = -1, the ball around 0; the camera looks from z = 3 along -z
OPTIONS = SightOptions(people=4000, background=8000)
FAR = (1e6, -2e6, 5e5)


def sight(offset=(0, 0, 0), size=160, **limits):
    """A camera at z = 3 that looks at the ball, and sees 3 m of the wall."""
    pose = np.eye(4)
    pose[:3, :3] = np.diag([1.0, -1.0, -1.0])
    pose[:3, 3] = np.array([0, 0, 3.0]) + offset
    focal = size * 4 / 3
    intrinsic = np.array([[focal, 0, size / 2], [0, focal, size / 2], [0, 0, 1]])
    return Sight(Camera.of(size, size, intrinsic, np.linalg.inv(pose)), **limits)


def parts(ball=None, wall=None):
    """A mesh of both, and which faces are the ball's."""
    ball = sphere(BALL) if ball is None else ball
    wall = moved(plane(4.0, 40), (-2, -2, -WALL)) if wall is None else wall
    vertices = np.concatenate([wall.vertices, ball.vertices])
    mesh = Mesh.of(vertices, np.concatenate([wall.faces, ball.faces + len(wall.vertices)]))
    return mesh, np.arange(len(mesh.faces)) >= len(wall.faces)


def truth(offset=(0, 0, 0), options=OPTIONS, **changed):
    mesh, dynamic = parts(**changed)
    return Scene(moved(mesh, offset), dynamic, [sight(offset)], options, complete=True)


def row(clean, **changed):
    return scene_row(clean, clean.labelled(moved(parts(**changed)[0], clean.mesh.middle - truth().mesh.middle)))


def test_the_truth_itself_has_no_error():
    found = row(truth())
    for part in ("", "people_", "background_"):
        assert found[f"{part}median_m"] < 1e-6 and found[f"{part}coverage_rms_m"] < 1e-6
        assert found[f"{part}normal_error_deg"] < 0.1 and found[f"{part}covered"] == 1.0
        assert found[f"{part}ssim_masked"] > 0.999


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), FAR])
def test_the_error_of_a_ball_that_is_too_large_is_the_difference_of_radii(offset):
    clean = truth(offset)
    found = row(clean, ball=sphere(BALL + 0.01))
    assert found["people_median_m"] == pytest.approx(0.01, rel=0.03)
    assert found["people_rms_backward_m"] == pytest.approx(0.01, rel=0.03)
    assert found["people_coverage_rms_m"] == pytest.approx(0.01, rel=0.03)
    assert found["people_covered"] == 1.0 and found["background_median_m"] < 1e-5
    assert found["people_d2_psnr_backward"] == pytest.approx(20 * math.log10(clean.mesh.diagonal / 0.01), abs=0.3)
    assert found["people_normal_error_deg"] < 0.5


def test_the_mean_square_of_all_is_that_of_the_parts_weighted_by_area():
    found = row(truth(), ball=sphere(BALL + 0.01))
    ball, wall = 4 * math.pi * (BALL + 0.01) ** 2, 16.0
    expected = math.sqrt(0.01**2 * ball / (ball + wall))
    assert found["rms_backward_m"] == pytest.approx(expected, rel=0.03)
    assert found["median_m"] < 1e-5  # more than half of it is wall


def test_noise_shows_in_distances_normals_and_pictures():
    clean = truth()
    little, much = (row(clean, wall=noisy(moved(plane(4.0, 40), (-2, -2, -WALL)), sigma)) for sigma in (0.002, 0.01))
    for name, sign in (("background_median_m", 1), ("background_normal_error_deg", 1), ("background_ssim_masked", -1)):
        assert sign * little[name] < sign * much[name]
        assert sign * row(clean)[name] < sign * little[name]
    assert much["people_median_m"] < 1e-5


def test_only_what_the_camera_can_see_must_be_covered():
    clean = truth()
    front = moved(sphere(BALL))
    half = Mesh.of(front.vertices, front.faces[front.vertices[front.faces][:, :, 2].max(axis=1) > 0.05])
    found = row(clean, ball=half)
    assert found["people_covered"] == 1.0 and found["people_coverage_rms_m"] < 1e-5
    back = Mesh.of(front.vertices, front.faces[front.vertices[front.faces][:, :, 2].max(axis=1) < -0.05])
    assert row(clean, ball=back)["people_covered"] < 0.05


def test_visible_surface_is_in_the_picture_in_range_not_hidden_and_not_edge_on():
    clean = truth()
    points = Scene(clean.mesh, clean.dynamic, (), OPTIONS).points  # of all that is there
    ball, wall = points["people"], points["background"]
    towards = np.array([0, 0, 3.0]) - ball.points
    lengths = BALL * np.linalg.norm(towards, axis=1)
    over = (ball.points * towards).sum(axis=1) / lengths - math.cos(math.radians(OPTIONS.grazing))
    sure = np.abs(over) > 0.08  # the ball has flat faces
    assert sure.mean() > 0.9 and np.array_equal(visible(clean, ball)[sure], over[sure] > 0)
    away = np.abs(wall.points[:, :2])
    seen = visible(clean, wall)
    radius = np.linalg.norm(away, axis=1)
    shadow = 4 * BALL / math.sqrt(9 - BALL**2)  # of the ball on the wall
    assert not seen[radius < shadow - 0.03].any() and not seen[away.max(axis=1) > 1.5].any()
    assert seen[(radius > shadow + 0.03) & (away.max(axis=1) < 1.49)].all()
    near = Scene(*parts(), [sight(near=0.1, far=3.5)], OPTIONS, complete=True)
    assert len(near.points["background"]) == 0 and len(near.points["people"]) > 0


def test_people_are_the_faces_whose_nearest_clean_face_moves():
    clean = truth()
    mesh, dynamic = parts(ball=noisy(sphere(BALL), 0.01))
    assert np.array_equal(clean.labelled(mesh).dynamic, dynamic)


def test_a_part_missing_only_in_the_decoded_mesh_is_infinitely_wrong_and_one_missing_in_both_is_none():
    clean = truth()
    found = row(clean, ball=Mesh.empty())
    assert found["people_median_m"] == math.inf and found["people_normal_error_deg"] == 180
    assert found["people_covered"] == 0 and found["people_ssim_masked"] < 0.5
    still = row(truth(ball=Mesh.empty()), ball=Mesh.empty())
    assert [value for name, value in still.items() if name.startswith("people_")] == [None] * 8
    nothing = scene_row(clean, clean.labelled(Mesh.empty()))
    assert nothing["median_m"] == nothing["coverage_rms_m"] == math.inf and nothing["d2_psnr_backward"] == 0


def test_means_leave_out_none_and_cap_infinite_psnrs():
    rows = [{"a_m": 1.0, "d2_psnr_forward": math.inf, "b": None}, {"a_m": None, "d2_psnr_forward": 60.0, "b": None}]
    assert scene_means(rows) == {"a_m": 1.0, "d2_psnr_forward": (PSNR_CEILING + 60) / 2, "b": None}
    assert scene_means([]) == {}


def test_a_clean_frame_without_faces_cannot_label_others():
    nothing = Scene(Mesh.empty(), np.zeros(0, bool), [sight()], complete=True)
    with pytest.raises(InputError, match="frame 3 of the truth has no faces"):
        compare_with_truth([], [], lambda _: nothing, [3])


def test_a_ball_that_moves_as_the_truth_does_not_flicker_and_one_that_is_noisy_does():
    """The ball moves by 4 cm; its noise is new in each frame."""
    balls = [moved(sphere(BALL), (0.04 * k, 0, 0)) for k in range(3)]
    meshes = [parts(ball=ball)[0] for ball in balls]
    noised = [parts(ball=noisy(ball, 0.002, seed=k))[0] for k, ball in enumerate(balls)]
    found = compare_with_truth(meshes, noised, lambda k: truth(ball=balls[k]), range(3))
    assert found["per_frame"][0]["decoded"]["people_flicker_deg"] is None
    assert found["noise_floor"]["people_flicker_deg"] < 0.01 and found["decoded"]["people_flicker_deg"] > 1
    assert (
        compare_with_truth(meshes, meshes, lambda k: truth(ball=balls[k]), (0, 2))["decoded"]["people_flicker_deg"]
        is None
    )
