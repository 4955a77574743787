"""Small holes are closed, large ones stay open, and closed meshes are unchanged."""

from __future__ import annotations

import numpy as np
import pytest

from meshreel.geometry.holes import close_holes
from meshreel.geometry.topology import face_normals, unique_edges
from meshreel.types import Mesh
from tests.spheres import deforming_sphere

BALL = deforming_sphere(1, levels=3)[0]


def open_edges(mesh):
    edges, of_faces = unique_edges(mesh.faces)
    return int((np.bincount(of_faces.reshape(-1), minlength=len(edges)) == 1).sum())


def without_ring(mesh, vertex):
    """The mesh without the faces at one vertex: a hole of one ring."""
    return Mesh.of(mesh.vertices, mesh.faces[(mesh.faces != vertex).all(axis=1)])


def test_a_closed_mesh_stays_as_it_is():
    assert np.array_equal(close_holes(BALL, 1e9).faces, BALL.faces)


def test_small_holes_are_closed_with_faces_that_look_outwards():
    holed = without_ring(without_ring(BALL, 5), 200)
    closed = close_holes(holed, 0.5 * np.pi)
    assert open_edges(holed) > 0 and open_edges(closed) == 0
    assert len(closed.vertices) == len(BALL.vertices)
    new = Mesh.of(closed.vertices, closed.faces[len(holed.faces) :])
    outwards = new.vertices[new.faces].mean(axis=1) - BALL.vertices.mean(axis=0)
    assert (np.einsum("fd,fd->f", face_normals(new)[0], outwards) > 0).all()


def test_large_holes_stay_open():
    above = BALL.vertices[:, 1] > BALL.vertices[:, 1].mean()
    half = Mesh.of(BALL.vertices, BALL.faces[above[BALL.faces].all(axis=1)])
    assert open_edges(close_holes(half, 0.1)) == open_edges(half) > 0


def test_an_empty_mesh_has_no_holes():
    assert close_holes(Mesh.empty(), 1.0).is_empty


def test_holes_that_meet_at_a_vertex_are_closed_each_for_itself():
    a, b = BALL.faces[0][0], BALL.faces[0][1]
    ring = set(BALL.faces[(BALL.faces == a).any(axis=1)].reshape(-1))
    beyond = next(v for v in BALL.faces[(BALL.faces == b).any(axis=1)].reshape(-1) if v not in ring)
    far = [v for v in BALL.faces[(BALL.faces == beyond).any(axis=1)].reshape(-1) if v not in ring]
    across = next(v for v in far if len(ring & set(BALL.faces[(BALL.faces == v).any(axis=1)].reshape(-1))) == 1)
    holed = without_ring(without_ring(BALL, a), across)
    closed = close_holes(holed, 0.5 * np.pi)
    assert open_edges(closed) == 0 and len(closed.vertices) == len(BALL.vertices)


def test_a_hole_that_a_camera_saw_through_stays_open():
    holed = without_ring(without_ring(BALL, 5), 200)
    near = BALL.vertices[5]
    closed = close_holes(holed, 0.5 * np.pi, lambda points: np.linalg.norm(points - near, axis=1) < 0.3)
    assert 0 < open_edges(closed) < open_edges(holed)
    assert len(closed.vertices) == len(BALL.vertices)


def test_the_faces_of_a_flat_hole_have_its_area_and_no_vertex_is_added():
    grid = np.stack(np.meshgrid(np.arange(9.0), np.arange(7.0), [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    corner = np.array([7 * i + j for i in range(8) for j in range(6)])[:, None]
    faces = np.concatenate([corner + [0, 7, 8], corner + [0, 8, 1]])
    middles = grid[faces].mean(axis=1)
    crack = (np.abs(middles[:, 1] - 3) < 1) & (middles[:, 0] > 2) & (middles[:, 0] < 6)
    bend = (np.abs(middles[:, 0] - 5) < 1) & (middles[:, 1] > 2) & (middles[:, 1] < 5)  # a concave loop
    closed = close_holes(Mesh.of(grid, faces[~(crack | bend)]), 20.0)
    normals, areas = face_normals(closed)
    assert open_edges(closed) == 2 * (8 + 6)  # its rim
    assert areas.sum() == pytest.approx(48) and (normals[areas > 0, 2] > 0).all() and len(closed.vertices) == len(grid)
