"""Pictures of the views: normals as colors, and folders from which other tools make masks."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from meshreel.analysis.scene.masks import CAMERAS, normal_picture, read_view_file, write_views
from meshreel.errors import InputError
from meshreel.geometry.drawing import draw
from meshreel.metrics.viewpoints import Box, ViewOptions, views_around
from meshreel.types import Mesh, MeshList
from tests.metrics.shapes import moved, plane, sphere

VIEWS = views_around(Box(np.full(3, -1.0), np.full(3, 1.0)), ViewOptions(80, 60))


def test_a_wall_has_the_color_of_its_normal_from_either_side_of_its_faces():
    wall = moved(plane(2), (-1, -1, 0))
    for mesh in (wall, Mesh.of(wall.vertices, wall.faces[:, ::-1])):
        for view, blue in ((VIEWS[0], 255), (VIEWS[2], 0)):  # the picture's normals face the camera
            picture = normal_picture(draw(mesh, view), view)
            assert picture.shape == (60, 80, 3) and np.abs(picture[30, 40].astype(int) - [128, 128, blue]).max() <= 1
            assert (picture[0, 0] == 255).all()


def test_a_ball_has_the_colors_of_its_normals():
    seen = draw(sphere(levels=6), VIEWS[1])
    picture = normal_picture(seen, VIEWS[1])
    rows, columns = np.nonzero(seen.faces >= 0)
    local = VIEWS[1].ahead[rows, columns] * seen.depth[rows, columns][:, None]
    world = (local - VIEWS[1].extrinsic[:3, 3]) @ VIEWS[1].extrinsic[:3, :3]
    away = np.abs(picture[rows, columns] / 255 * 2 - 1 - world).max(axis=1)
    assert np.percentile(away, 90) < 0.1


def test_an_edge_between_near_and_far_is_not_blurred():
    both = Mesh.of(
        np.concatenate([moved(plane(2), (-1, -1, 0)).vertices, moved(plane(1), (-1, -1, 0.5)).vertices]),
        np.concatenate([plane(2).faces, plane(1).faces + len(plane(2).vertices)]),
    )
    picture = normal_picture(draw(both, VIEWS[0]), VIEWS[0]).astype(int)
    covered = picture[(picture != 255).any(axis=2)]
    assert len(covered) > 500 and np.abs(covered - [128, 128, 255]).max() <= 1


def test_a_folder_of_views_has_a_picture_a_view_and_frame_and_its_cameras(tmp_path: Path):
    told: list[int] = []
    write_views(tmp_path / "views", MeshList((sphere(), Mesh.empty())), VIEWS, told.append)
    assert told == [1, 2] and len(read_view_file(tmp_path / "views" / CAMERAS)) == 4
    names = sorted(path.relative_to(tmp_path / "views").as_posix() for path in (tmp_path / "views").rglob("*.png"))
    assert names == [f"view{view:02}/frame_{frame:05}.png" for view in range(4) for frame in range(2)]
    with Image.open(tmp_path / "views" / "view03" / "frame_00001.png") as empty:
        assert empty.size == (80, 60) and (np.array(empty) == 255).all()
    assert (tmp_path / "views" / CAMERAS).exists()


def test_views_of_two_sizes_are_refused(tmp_path: Path):
    other = views_around(Box(np.zeros(3), np.ones(3)), ViewOptions(100, 60))
    with pytest.raises(InputError, match="one size"):
        write_views(tmp_path, MeshList((sphere(),)), [VIEWS[0], other[0]])
