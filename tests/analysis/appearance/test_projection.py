"""A room's faces in pictures: large ones are cut until a picture has them entirely, and seams are few."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.analysis.appearance.projection import _with_few_seams, projected, shown_whole, steady_normals
from meshreel.geometry.cameras import Camera, CameraPose
from meshreel.geometry.color_views import ColorPicture, ColorViews
from meshreel.geometry.topology import concatenate, face_normals, subdivide_midpoint, unique_edges
from meshreel.types import Mesh

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
    back = Mesh(WALL.vertices, np.ascontiguousarray(WALL.faces[:, ::-1]))
    assert shown_whole(back, ColorViews(looking(-0.2, 0.2), back)) is back


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
    monkeypatch.setattr("meshreel.analysis.appearance.projection.SEAM", 0.0)
    assert few < 0.08 and few < seams() / 3


def test_a_thin_face_has_the_normal_of_the_faces_beside_it() -> None:
    bent = Mesh.of(
        [[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, -1e-6, 1e-3], [0.5, -1, 0]],
        [[0, 1, 2], [0, 3, 1], [0, 4, 3], [3, 4, 1]],
    )
    normals = steady_normals(bent)
    assert face_normals(bent)[0][1, 2] < 0.1 and normals[1, 2] > 0.99
    np.testing.assert_array_equal(normals[[0, 2, 3]], face_normals(bent)[0][[0, 2, 3]])


def test_faces_that_no_picture_has_count_for_none() -> None:
    mesh = subdivide_midpoint(WALL, 3)
    weights = np.zeros((3, len(mesh.faces)))
    weights[1:, 40] = 0.6, 1.0
    assert _with_few_seams(mesh, weights)[40] == 1
    assert _with_few_seams(mesh, weights[[0, 2, 1]])[40] == 0
    assert (np.delete(_with_few_seams(mesh, weights), 40) == -1).all()
