"""Fusion of exact depths gives the true surface, once, reproducibly and without fragments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshreel.capture.rig.fusion import FusionOptions, fuse_depths
from meshreel.errors import InputError
from meshreel.geometry.topology import components, face_normals, without_fragments
from meshreel.types import Mesh
from tests.capture.depth_scenes import RADIUS, WALL, camera, measured
from tests.spheres import sliding_sphere

AROUND = [camera(f"at{side}", side) for side in (0, 90, 180, 270)]
FINE = FusionOptions(voxel=0.02)


def views(cameras, **scene):
    return [(one, measured(one, **scene)) for one in cameras]


def test_a_ball_seen_from_all_sides_is_a_closed_ball_of_its_size():
    mesh = fuse_depths(views(AROUND, wall=False), FINE)
    radii = np.linalg.norm(mesh.vertices, axis=1)
    assert abs(np.median(radii) - RADIUS) < 0.002 and np.abs(radii - RADIUS).max() < 1.5 * FINE.voxel
    assert len(np.unique(components(mesh.faces, len(mesh.vertices)))) == 1
    outward = (face_normals(mesh)[0] * mesh.vertices[mesh.faces[:, 0]]).sum(axis=1)
    assert (outward > 0).mean() > 0.99  # counter-clockwise from outside


def test_the_wall_is_at_its_place_with_the_shadow_of_the_ball():
    mesh = fuse_depths(views(AROUND[:1]), FINE)
    wall = mesh.vertices[mesh.vertices[:, 2] > 1]
    assert len(wall) and np.abs(wall[:, 2] - WALL).max() < 0.005
    assert np.linalg.norm(wall[:, :2], axis=1).min() > RADIUS  # nothing was seen behind the ball


def test_another_camera_carves_away_flying_pixels():
    depth = measured(AROUND[0])
    depth[44:52, 8:16] = 1500  # a piece that is not there, beside the ball
    beside, everything = camera("beside", 20), replace(FINE, fragment=0.0)
    flying = [(AROUND[0], depth)]
    alone = fuse_depths(flying, everything)
    both = fuse_depths([*flying, (beside, measured(beside))], everything)  # who sees the wall through it

    def piece(mesh):
        away = mesh.vertices[np.linalg.norm(mesh.vertices, axis=1) > RADIUS + 0.1]
        return int((away[:, 2] < 0).sum())

    assert piece(alone) > 100 and piece(both) == 0


def test_neither_the_order_of_cameras_nor_a_second_run_changes_the_mesh():
    first, again = fuse_depths(views(AROUND), FINE), fuse_depths(views(AROUND), FINE)
    assert np.array_equal(first.vertices, again.vertices) and np.array_equal(first.faces, again.faces)
    turned = fuse_depths(views(AROUND[::-1]), FINE)
    assert np.abs(turned.vertices - first.vertices).max() < 1e-4 and np.array_equal(turned.faces, first.faces)


def test_depths_out_of_range_or_missing_are_no_surface():
    near = camera(depth_range=(0.2, 2.5))
    mesh = fuse_depths([(near, measured(near))], FINE)
    assert mesh.vertices[:, 2].max() < 0.6  # the wall is 3.2 m away
    assert fuse_depths([(near, np.zeros((96, 96), np.uint16))], FINE).is_empty and fuse_depths([], FINE).is_empty


def test_fragments_are_dropped_by_their_area():
    [ball] = sliding_sphere(1, levels=2)
    crumb = Mesh(ball.vertices * 0.01 + 3, ball.faces)
    both = Mesh(
        np.concatenate([ball.vertices, crumb.vertices]), np.concatenate([ball.faces, ball.faces + len(ball.vertices)])
    )
    area = face_normals(crumb)[1].sum()
    assert len(without_fragments(both, 0.99 * area).faces) == 2 * len(ball.faces)
    kept = without_fragments(both, 1.01 * area)
    assert np.array_equal(kept.vertices, ball.vertices) and np.array_equal(kept.faces, ball.faces)
    assert without_fragments(Mesh.empty(), 1.0).is_empty


@pytest.mark.parametrize("wrong", [{"voxel": 0.0}, {"voxel": 2.0}, {"truncation": 0.5}, {"fragment": -1.0}])
def test_options_out_of_range_are_refused(wrong):
    with pytest.raises(InputError, match="give"):
        FusionOptions(**wrong)


@pytest.mark.parametrize("side", [-50.0, 50.0])
def test_a_slanted_wall_is_fused_at_its_place(side):
    slanted = camera(side=side, size=192)
    mesh = fuse_depths([(slanted, measured(slanted, ball=(0.0, 50.0, 0.0)))], FusionOptions(voxel=0.02))
    seen = mesh.vertices[np.abs(mesh.vertices[:, :2]).max(axis=1) < 0.5]
    assert len(seen) > 500 and abs(np.median(seen[:, 2]) - WALL) < 1e-3  # half a pixel would be several mm
