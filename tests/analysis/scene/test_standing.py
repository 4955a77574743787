"""Rest and motion: noise is new in every frame, motion goes on; and the noise of places."""

import numpy as np
import pytest

from meshreel.analysis.scene.standing import LocalNoise, standing
from meshreel.geometry.cameras import Camera, CameraPose
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh
from tests.metrics.shapes import moved, plane
from tests.scenes import is_scene
from tests.small_scene import scene

SHEET = plane(1.0, 60)  # edges of 1.7 cm, z = 0


def waving(amplitude: float, period: float, frames: int = 16, noise: float = 0.0) -> list[Mesh]:
    random, found = np.random.default_rng(0), []
    x, y, _ = SHEET.vertices.T
    for t in range(frames):
        z = amplitude * np.sin(7 * x + 4 * y + 2 * np.pi * t / period)
        z = z + noise * random.normal(size=len(z))
        found.append(Mesh(np.stack([x, y, z], axis=1), SHEET.faces))
    return found


@pytest.mark.parametrize("amplitude", [0.002, 0.01, 0.04])
@pytest.mark.parametrize("period", [3.7, 8.0, 30.0, 200.0])
def test_slow_and_small_motion_of_open_surface_is_motion(amplitude: float, period: float):
    assert not is_scene(waving(amplitude, period))


@pytest.mark.parametrize("noise", [0.0, 0.0005, 0.004])
def test_noise_alone_is_rest_and_is_measured(noise: float):
    found = standing(waving(0.0, 1.0, noise=noise))
    assert found.rests.mean() > 0.95 and is_scene(waving(0.0, 1.0, noise=noise))
    # The closest point of a rough surface is nearer than the one along the normal.
    assert noise == 0 or 0.4 * noise < np.median(found.noise) < 1.1 * noise


def test_motion_beneath_noise_of_its_size_is_motion_where_it_is_larger_than_the_noise():
    assert not is_scene(waving(0.02, 30.0, noise=0.002))


def test_where_a_part_moves_that_part_is_told():
    frames = waving(0.0, 1.0)
    bump = 0.02 * np.exp(-((SHEET.vertices[:, :2] - SHEET.vertices[:, :2].mean(axis=0)) ** 2).sum(axis=1) / 0.01)
    way = np.outer(bump, [0, 0, 1])
    moved = [Mesh(mesh.vertices + way * np.sin(0.7 * t), mesh.faces) for t, mesh in enumerate(frames)]
    faces = standing(moved).moves(moved[0])
    high = bump[SHEET.faces].min(axis=1)
    assert faces[high > 0.015].all() and not faces[high < 1e-9].any()


def test_a_small_room_with_noise_is_a_scene():
    assert is_scene(scene(8))


def test_frames_without_noise_have_places_that_are_the_same():
    assert standing(scene(6, noise=0.0)).same > 0 == standing(scene(6)).same
    assert standing(waving(0.01, 8.0)).same == 0  # nothing rests


def test_tiles_that_bob_are_each_as_stiff_as_a_wall():
    """Each with a phase of its own, some in a region: in regions this looks like noise."""
    tile, random = plane(0.2, 4), np.random.default_rng(0)
    places, phases = np.mgrid[0:12, 0:12].reshape(2, -1).T * 0.25, random.uniform(0, 2 * np.pi, 144)
    frames = [
        concatenate([moved(tile, (*at, 0.02 * np.sin(p + 1.3 * t))) for at, p in zip(places, phases, strict=True)])
        for t in range(10)
    ]
    assert not is_scene(frames)


def noisy(points: np.ndarray, sigma: np.ndarray, seed: int, off: float = 0.0) -> np.ndarray:
    return off + sigma * np.random.default_rng(seed).normal(size=len(points))


def test_noise_has_a_place():
    points = np.random.default_rng(1).uniform(0, 4, (60_000, 3)) * [1, 1, 0]
    sigma = np.where(points[:, 0] < 2, 0.001, 0.01)
    noise = LocalNoise.of([points] * 2, [noisy(points, sigma, seed) for seed in (2, 3)], 0.2, 1.0)
    for found in noise.at(np.array([[0.5, 2, 0], [3.5, 2, 0], [3.5, 2, 5]])):  # RMS, and with what frames are off
        assert found == pytest.approx([0.001, 0.01, 0.01], rel=0.25)


def test_few_places_have_one_noise_and_none_has_no_noise():
    points, sigma = np.random.default_rng(1).uniform(0, 4, (50, 3)), np.full(50, 0.003)
    assert LocalNoise.of([points], [noisy(points, sigma, 2)], 0.1, 1.0).at(points[:2])[1] == pytest.approx(
        0.003, rel=0.5
    )
    assert not LocalNoise.of([], [], 0.1, 1.0).at(points).any()


def test_frames_whose_neighbours_are_empty_tell_nothing_of_rest():
    frames = [plane(1.0, 30) if number % 2 else Mesh.empty() for number in range(16)]
    assert not len(standing(frames).keys) and not is_scene(frames)


def test_what_a_frame_is_off_as_a_whole_is_no_noise_of_a_shape():
    points = np.random.default_rng(1).uniform(0, 2, (30_000, 3)) * [1, 1, 0]
    gaps = [noisy(points, np.full(len(points), 0.001), seed, off) for seed, off in enumerate([0.02, -0.02, 0.05])]
    rms, off = LocalNoise.of([points] * 3, gaps, 0.2, 1.0).at(np.array([[1.0, 1, 0]]))
    assert rms[0] == pytest.approx(0.001, rel=0.1) and off[0] > 0.015


def test_a_body_has_the_noise_of_its_place_in_the_picture_and_not_of_what_is_beside_it():
    """What stands before the noisy rim of a picture is noisy, and what stands before its middle is not."""
    camera = Camera(100, 100, (50.0, 50.0), (50.0, 50.0), CameraPose.of_world(np.eye(4)))
    floor = np.random.default_rng(1).uniform(-3, 3, (60_000, 3)) * [1, 1, 0] + [0, 0, 3]
    sigma = np.where(np.hypot(floor[:, 0], floor[:, 1]) < 1.5, 0.001, 0.02)
    noise = LocalNoise.of([floor], [noisy(floor, sigma, 2)], 0.2, 6.0, (camera,))
    middle, rim = np.array([[0.2, 0.1, 1.5]]), np.array([[1.3, 0, 1.5]])
    assert noise.at(middle)[0, 0] == pytest.approx(0.001, rel=0.3)
    assert noise.at(rim)[0, 0] == pytest.approx(0.02, rel=0.3)


@pytest.mark.parametrize("power", [0.0, 1.0, 2.0])
def test_a_body_has_the_noise_of_its_depth_and_not_of_what_it_hides(power: float):
    """A wall that goes back, whose noise grows with its depth, behind a body that is nearer."""
    camera = Camera(100, 100, (50.0, 50.0), (50.0, 50.0), CameraPose.of_world(np.eye(4)))
    wall = np.random.default_rng(1).uniform(-1, 1, (60_000, 3))
    wall = np.stack([3 * wall[:, 0], 2 * wall[:, 1], 4 + 1.5 * wall[:, 0]], axis=1)
    noise = LocalNoise.of([wall], [noisy(wall, 0.002 * wall[:, 2] ** power, 2)], 0.2, 9.0, (camera,))
    body = np.array([[0.1, 0.1, 1.5], [-0.2, 0.2, 2.0]])
    assert noise.at(body)[0] == pytest.approx(0.002 * body[:, 2] ** power, rel=0.3)
    assert noise.at(wall[:50])[0] == pytest.approx(0.002 * wall[:50, 2] ** power, rel=0.3)
