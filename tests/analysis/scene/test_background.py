"""Background from meshes: noise averages out, borders stay open, and surface hidden in one frame is recovered."""

import math

import numpy as np

from meshreel.analysis.scene.background import FRAGMENT, fuse_background
from meshreel.geometry.topology import concatenate, face_normals
from meshreel.types import Mesh
from tests.metrics.shapes import moved, noisy, plane, sphere

VOXEL = 0.05
SIGMA = 0.01  # m
FLOOR = moved(plane(1.6, 32), (0.0, 0.0, 0.013))


def height_error(mesh: Mesh) -> float:
    """RMS of the heights over the floor, m, away from its border."""
    inside = (np.abs(mesh.vertices[:, :2] - 0.8) < 0.61).all(axis=1)
    assert inside.sum() > 100
    return float(np.sqrt(((mesh.vertices[inside, 2] - 0.013) ** 2).mean()))


def floors(count: int) -> list[Mesh]:
    return [noisy(FLOOR, SIGMA, seed) for seed in range(count)]


def test_a_plane_comes_back_as_it_is_and_faces_the_same_way():
    mesh = fuse_background([FLOOR], VOXEL)
    assert height_error(mesh) < 1e-5 and (face_normals(mesh)[0][:, 2] > 0.99).all()


def test_the_error_falls_with_the_frames():
    errors = [height_error(fuse_background(floors(count), VOXEL)) for count in (1, 4, 16)]
    assert errors[1] < 0.65 * errors[0] and errors[2] < 0.65 * errors[1] and errors[2] < 0.4 * SIGMA


def test_nothing_is_beyond_a_border():
    for frames in ([FLOOR], floors(6)):
        mesh = fuse_background(frames, VOXEL)
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        assert (low[:2] > -3 * SIGMA).all() and (high[:2] < 1.6 + 3 * SIGMA).all()
        assert (low[:2] < VOXEL + 3 * SIGMA).all() and (high[:2] > 1.6 - VOXEL - 3 * SIGMA).all()  # and it goes so far


def test_a_hole_stays_a_hole():
    middle = FLOOR.vertices[FLOOR.faces].mean(axis=1)[:, :2] - 0.8
    holed = Mesh(FLOOR.vertices, FLOOR.faces[np.linalg.norm(middle, axis=1) > 0.4])
    mesh = fuse_background([holed, holed], VOXEL)
    assert np.linalg.norm(mesh.vertices[:, :2] - 0.8, axis=1).min() > 0.33


def test_surface_hidden_in_one_frame_comes_from_others():
    halves = [Mesh(FLOOR.vertices, FLOOR.faces[FLOOR.vertices[FLOOR.faces[:, 0], 0] < 1.0]) for _ in range(1)]
    mesh = fuse_background([*halves, FLOOR], VOXEL)
    assert mesh.vertices[:, 0].max() > 1.5


def test_surface_that_few_frames_have_is_left_out():
    table = moved(plane(0.8, 16), (0.4, 0.4, 0.7))
    with_table = concatenate([FLOOR, table])
    assert fuse_background([*[with_table] * 2, *[FLOOR] * 8], VOXEL).vertices[:, 2].max() > 0.6
    least = fuse_background([with_table, *[FLOOR] * 9], VOXEL)
    assert least.vertices[:, 2].max() < 0.1 and not least.is_empty


def test_small_pieces_are_dropped():
    def top(radius: float) -> float:
        ball = moved(sphere(radius, 3), (0.8, 0.8, 0.6))
        return fuse_background([concatenate([FLOOR, ball])], VOXEL / 4).vertices[:, 2].max()

    assert 4 * math.pi * 0.035**2 < FRAGMENT < 4 * math.pi * 0.1**2
    assert top(0.035) < 0.1
    assert top(0.1) > 0.6
    assert fuse_background([moved(plane(0.1, 4), (0.4, 0.4, 0.7))], VOXEL / 4).is_empty


def test_the_order_of_frames_does_not_matter_and_the_same_frames_give_the_same_mesh():
    frames = floors(4)
    one, same, other = (fuse_background(some, VOXEL) for some in (frames, list(frames), frames[::-1]))
    assert np.array_equal(one.vertices, same.vertices) and np.array_equal(one.faces, same.faces)
    assert abs(height_error(one) - height_error(other)) < 1e-4 and abs(len(one.faces) - len(other.faces)) < 20


def test_of_nothing_there_is_nothing():
    assert fuse_background([], VOXEL).is_empty and fuse_background([Mesh.empty()] * 3, VOXEL).is_empty
    assert not fuse_background([Mesh.empty(), FLOOR, Mesh.empty()], VOXEL).is_empty
    assert fuse_background([Mesh.of(np.ones((3, 3)), [[0, 1, 2]])], VOXEL).is_empty


def test_surface_that_moves_from_frame_to_frame_is_left_out(monkeypatch):
    ribbons = [moved(plane(0.8, 16), (0.4, 0.4, 0.7 + 0.06 * math.sin(2.4 * k))) for k in range(10)]
    frames = [concatenate([floor, ribbon]) for floor, ribbon in zip(floors(10), ribbons, strict=True)]
    mesh = fuse_background(frames, VOXEL)
    assert mesh.vertices[:, 2].max() < 0.1 and height_error(mesh) < SIGMA
    monkeypatch.setattr("meshreel.analysis.scene.background.STEADY", 9.0)
    assert fuse_background(frames, VOXEL).vertices[:, 2].max() > 0.6
