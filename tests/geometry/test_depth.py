"""Depth pictures made finer along surfaces, and the space that cameras saw through."""

import numpy as np
import pytest

from meshreel.geometry.cameras import Camera
from meshreel.geometry.depth import DepthPicture, FreeSpace, rise
from meshreel.types import Placement

WIDTH, HEIGHT, FOCAL = 64, 128, 60.0
CAMERA = Camera.of(WIDTH, HEIGHT, np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1.0]]), np.eye(4))


def rays(camera: Camera) -> np.ndarray:
    """Directions of all pixels, a metre along the optical axis."""
    columns, rows = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    homogeneous = np.stack([columns, rows, np.ones_like(rows)], axis=-1)
    return homogeneous @ np.linalg.inv(camera.intrinsic).T


def floor(camera: Camera, below: float = 1.2) -> np.ndarray:
    """Depth of a floor below the camera, m; 0 above the horizon and beyond 5 m."""
    down = rays(camera)[..., 1]
    with np.errstate(divide="ignore"):
        depth = below / np.where(down > 0, down, 1e-9)
    return np.where(depth < 5, depth, 0)


def picture(depth: np.ndarray) -> DepthPicture:
    return DepthPicture(CAMERA, (depth * 1000).astype(np.float32), 0.001, 8.0)


@pytest.mark.parametrize("factor", [2, 3])
def test_a_floor_stays_a_plane_where_rows_are_far_apart(factor):
    fine = picture(floor(CAMERA)).finer(factor)
    assert fine.depth.shape == (factor * HEIGHT, factor * WIDTH)
    true = floor(fine.camera)
    inside = (fine.depth > 0) & (true > 0)
    inside[: factor * (HEIGHT // 2 + 36)] = False  # nearer to the horizon rows are two surfaces
    inside[-factor:] = False  # the last half pixel has one neighbour only
    assert inside.any() and np.abs(fine.depth * 0.001 - true)[inside].max() < 1e-4


def test_no_depth_between_two_surfaces_comes_up_and_holes_stay():
    depth = np.full((HEIGHT, WIDTH), 3.0)
    depth[:, : WIDTH // 2] = 1.5
    depth[10:14, 10:14] = 0
    fine = picture(depth).finer(3)
    assert set(np.unique(fine.depth.round())) == {0.0, 1500.0, 3000.0}
    assert (fine.depth == 0).sum() == 9 * 16


def test_a_place_is_free_where_a_camera_saw_past_it():
    depth = np.full((HEIGHT, WIDTH), 2.0)
    depth[:, :10] = 0  # nothing measured
    points = np.array([[0, 0, 1.0], [0, 0, 1.99], [0, 0, 2.5], [-0.9, 0, 1.9], [0, 0, -1.0], [9.0, 0, 1.0]])
    found = FreeSpace.of([None, picture(depth)]).at(points)
    assert found.tolist() == [True, False, False, False, False, False]
    place = Placement(2.0, (0.0, 0.0, 0.5))
    moved = FreeSpace.of([picture(depth)], place).at((points - place.origin) / 2.0)
    assert np.array_equal(moved, found)
    assert not FreeSpace.of([]).at(points).any()


def test_the_rise_of_a_pixel_is_the_largest_to_a_neighbour_and_steps_are_none() -> None:
    depth = np.array([[1, 1, 1, 1.02, 1.02, 2.0], [1, 1, 1, 1.02, 1.02, 2.0]], np.float32)
    for axis in (0, 1):
        found = rise(np.moveaxis(depth, axis, 0).copy())
        np.testing.assert_allclose(np.moveaxis(found, 0, axis)[0], [0, 0, 0.02, 0.02, 0, 0], atol=1e-6)
