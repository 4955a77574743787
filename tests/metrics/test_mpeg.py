"""MPEG's measures against values that are known: planes, spheres, equal meshes and missing halves."""

import math
from dataclasses import replace

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.metrics.mpeg import CEILING, DEPTH_PEAK, Cloud, MpegOptions, directions, mpeg_errors
from meshreel.metrics.viewpoints import Box
from meshreel.types import Mesh

from .shapes import moved, plane, sphere

FEW = MpegOptions(pixels=100, grid=128)


def measured(original: Mesh, decoded: Mesh):
    return mpeg_errors(original, decoded, Box.of([original]), FEW)


def test_parallel_planes_are_their_distance_apart():
    found = measured(plane(), plane(height=0.01))
    expected = 10 * math.log10(3 / 0.01**2)  # the longest edge is 1
    assert found["mpeg_d1_psnr"] == pytest.approx(expected, abs=1e-3)
    assert found["mpeg_d2_psnr"] == pytest.approx(expected, abs=1e-3)


def test_frames_of_a_larger_sequence_are_measured_by_its_edge():
    found = mpeg_errors(plane(), plane(height=0.01), Box.of([plane()]), replace(FEW, edge=2.5))
    expected = 10 * math.log10(3 * (2.5 / 0.01) ** 2)
    assert (found["mpeg_d1_psnr"], found["mpeg_d2_psnr"]) == pytest.approx((expected, expected), abs=1e-3)


def test_motion_in_a_plane_costs_points_but_not_planes():
    found = measured(plane(), moved(plane(), (0.003, 0, 0)))  # less than half a cell of the grid
    assert found["mpeg_d2_psnr"] == CEILING
    assert 10 * math.log10(3 / 0.003**2) - 0.5 < found["mpeg_d1_psnr"] < CEILING


def test_spheres_differ_by_their_radii():
    found = measured(sphere(1.0, 5), sphere(1.1, 5))
    expected = 10 * math.log10(3 * 2**2 / 0.1**2)
    assert found["mpeg_d1_psnr"] == pytest.approx(expected, abs=0.03)  # points are nearly opposite
    assert found["mpeg_d2_psnr"] == pytest.approx(expected, abs=0.03)


def test_depth_of_parallel_planes_is_in_three_radii_of_the_picture():
    found = measured(plane(), plane(height=0.001))
    radius = 1.01 * math.hypot(1, 1, 0.001) / 2
    slant = np.array([abs(way[2]) for way in directions()])  # their picture's area; depth differs by 0.001 / slant
    slant = slant[slant > 1e-6]
    square = 0.001**2 * (1 / slant).sum() / slant.sum()
    assert found["ibsm_geometry_psnr"] == pytest.approx(10 * math.log10((DEPTH_PEAK * radius) ** 2 / square), abs=0.2)
    assert "ibsm_luma_psnr" not in found


def test_equal_meshes_have_the_most_decibels():
    found = measured(sphere(levels=3), sphere(levels=3))
    assert (found["mpeg_d1_psnr"], found["mpeg_d2_psnr"], found["ibsm_geometry_psnr"]) == (CEILING, CEILING, CEILING)


def test_a_missing_half_counts_whichever_side_lacks_it():
    whole = sphere(levels=4)
    half = Mesh.of(whole.vertices, whole.faces[whole.vertices[whole.faces].mean(axis=1)[:, 1] > 0])
    box = Box.of([whole])
    lost, invented = mpeg_errors(whole, half, box, FEW), mpeg_errors(half, whole, box, FEW)
    assert lost["mpeg_d1_psnr"] == pytest.approx(invented["mpeg_d1_psnr"]) and lost["mpeg_d2_psnr"] == pytest.approx(
        invented["mpeg_d2_psnr"]
    )
    points = np.random.default_rng(0).normal(size=(200_000, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    rim = points[:, [0, 2]] / np.linalg.norm(points[:, [0, 2]], axis=1)[:, None]
    apart = np.where(points[:, 1] < 0, ((points[:, [0, 2]] - rim) ** 2).sum(axis=1) + points[:, 1] ** 2, 0.0)
    assert lost["mpeg_d1_psnr"] == pytest.approx(10 * math.log10(12 / apart.mean()), abs=0.15)


def test_a_frame_without_surface_is_as_bad_as_can_be_unless_both_lack_it():
    empty = Mesh.empty()
    assert mpeg_errors(sphere(levels=2), empty, Box.of([sphere()]), FEW)["mpeg_d1_psnr"] == 0
    assert mpeg_errors(empty, empty, Box.of([]), FEW)["ibsm_geometry_psnr"] == CEILING


def test_luma_of_two_greys_is_their_difference():
    def painted(grey: int) -> Mesh:
        mesh = sphere(levels=3)
        return replace(mesh, colors=np.full((len(mesh.vertices), 3), grey, np.uint8))

    assert measured(painted(100), painted(110))["ibsm_luma_psnr"] == pytest.approx(20 * math.log10(25.5))


def test_points_lie_on_lines_along_the_axis_of_the_normal():
    cloud = Cloud.of(moved(plane(cells=3), (0, 0, 0.3)), np.zeros(3), 1 / 64)
    assert len(cloud.points) == 65**2
    assert np.abs(cloud.points[:, :2] * 64 - np.rint(cloud.points[:, :2] * 64)).max() < 1e-3
    np.testing.assert_allclose(cloud.normals, [[0, 0, 1]] * len(cloud.normals))


def test_cameras_go_from_top_to_bottom_around_the_sphere():
    found = np.array(list(directions()))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1)
    assert found[0, 1] == 1 and found[-1, 1] == -1 and len(found) == 16


def test_pictures_without_pixels_and_boxes_without_edges_are_refused():
    with pytest.raises(InputError, match="give at least 8"):
        MpegOptions(pixels=4)
    for edge in (0.0, -1.0, math.nan):
        with pytest.raises(InputError, match="give a length above 0"):
            MpegOptions(edge=edge)
