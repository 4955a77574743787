import numpy as np
import pytest

from meshreel.geometry.cameras import Camera
from meshreel.metrics.render import crop_of, look
from meshreel.metrics.viewpoints import Box, ViewOptions, views_around
from meshreel.types import Mesh

from .shapes import moved, noisy, plane, sphere

SMALL = ViewOptions(160, 120)
FAR = ViewOptions(64, 64, fov=1.0)  # rays are nearly parallel


def render_normals(mesh: Mesh, camera: Camera) -> np.ndarray:
    return look(mesh, camera).colors


def test_a_sphere_seen_from_the_front_shows_its_analytic_normals():
    body = sphere(levels=5)
    camera = views_around(Box.of([body]), SMALL)[0]
    view = look(body, camera)
    assert np.degrees(np.arccos(np.clip((view.normals * view.points).sum(axis=1), -1, 1))).max() < 3
    assert np.allclose(np.linalg.norm(view.points, axis=1), 1, atol=5e-3)
    eye = -camera.extrinsic[:3, :3].T @ camera.extrinsic[:3, 3]
    radius = 60 / np.tan(np.radians(30)) / np.sqrt(eye @ eye - 1)  # pixels: the tangent cone's
    assert view.covered.sum() == pytest.approx(np.pi * radius**2, rel=0.03)


def test_colors_are_normals_in_world_axes_and_the_background_is_white():
    wall = moved(plane(2), (-1, -1, 0))  # faces +z, the front
    camera = views_around(Box(np.full(3, -1.0), np.full(3, 1.0)), FAR)[0]
    image = render_normals(wall, camera)
    assert image.shape == (64, 64, 3)
    assert np.allclose(image[32, 32], [0.5, 0.5, 1])
    assert np.allclose(image[0, 0], 1)
    covered = (image != 1).any(axis=2)
    assert covered.sum() == pytest.approx(64**2 / 1.05**2, rel=0.05)


def test_the_nearest_surface_is_seen_and_the_picture_is_not_mirrored():
    red = Mesh.of([[-1, -1, 1], [0, -1, 1], [0, 1, 1], [-1, 1, 1]], [[0, 1, 2], [0, 2, 3]])  # in front, on the left
    image = render_normals(
        Mesh.of(
            np.concatenate([red.vertices, red.vertices * [2, 1, 1] + [1, 0, -2]]),
            np.concatenate([red.faces, red.faces[:, ::-1] + 4]),
        ),
        views_around(Box(np.full(3, -1.0), np.full(3, 1.0)), FAR)[0],
    )
    assert np.allclose(image[32, 16], [0.5, 0.5, 1])
    assert np.allclose(image[32, 48], [0.5, 0.5, 0])


def test_a_crop_shows_the_same_pixels_as_the_whole_picture():
    body = noisy(moved(sphere(levels=3), (0.4, 0.1, 0)), 0.02)
    for camera in views_around(Box(np.full(3, -2.0), np.full(3, 2.0)), SMALL):
        full = look(body, camera)
        crop = crop_of([body], camera)
        part = look(body, camera, crop)
        assert part.covered.sum() == full.covered.sum() > 100
        assert np.array_equal(full.colors[crop.top : crop.bottom, crop.left : crop.right], part.colors)


def test_a_camera_inside_the_mesh_sees_it_on_every_pixel():
    camera = views_around(Box(np.full(3, -1.0), np.full(3, 1.0)), SMALL)[0]
    room = sphere(radius=50)
    assert look(room, camera, crop_of([room], camera)).covered.all()


@pytest.mark.parametrize("mesh", [Mesh.empty(), Mesh.of([[0, 0, 0], [1, 1, 1]], [[0, 1, 1]])])
def test_no_surface_gives_an_empty_picture(mesh: Mesh):
    camera = views_around(Box(np.full(3, -1.0), np.full(3, 1.0)), SMALL)[0]
    assert (render_normals(mesh, camera) == 1).all()
