"""Planes go on through holes that nobody saw into; openings, borders and what is not flat stay as they are."""

import numpy as np
import pytest

from meshreel.geometry.planes import close_planes
from meshreel.geometry.reconstruct import border_loops
from meshreel.geometry.topology import concatenate, edge_lengths, face_means, face_normals, part_of, unique_edges, weld
from meshreel.types import Mesh
from tests.metrics.shapes import plane, sphere

SIDE, SPACING, NOISE = 2.0, 0.04, 0.002  # m
HOLE, DOOR = np.array([0.3, -0.2]), np.array([-0.4, 0.1])  # middles, on the floor and on the wall
RADIUS = 0.3


def sheet(*holes: np.ndarray, seed: int = 0) -> Mesh:
    """A noisy square about the origin that faces z, with round holes."""
    flat = plane(SIDE, round(SIDE / SPACING))
    flat = flat.at(flat.vertices - flat.vertices.mean(axis=0))
    middles = face_means(flat.vertices, flat.faces)[:, :2]
    whole = [np.linalg.norm(middles - hole, axis=1) > RADIUS for hole in holes]
    cut = part_of(flat, np.logical_and.reduce([np.ones(len(flat.faces), bool), *whole]))
    noise = np.random.default_rng(seed).normal(0, NOISE, (len(cut.vertices), 3))
    return cut.at(cut.vertices + noise)


def room(*holes: np.ndarray) -> Mesh:
    """A floor at z = 0, and a wall at y = SIDE / 2, both with holes; they do not touch."""
    wall = sheet(*holes, seed=1)
    wall = wall.at(wall.vertices[:, [0, 2, 1]] * [1, -1, 1] + [0, SIDE / 2 + SPACING, SIDE / 2 + SPACING])
    return concatenate([sheet(*holes), wall])


def closed(mesh: Mesh, noise: float = NOISE, opened=lambda points, _: np.zeros(len(points), bool)) -> Mesh:
    return close_planes(mesh, lambda points: np.full(len(points), 1.5 * noise), opened)


def added(before: Mesh, after: Mesh) -> Mesh:
    np.testing.assert_array_equal(after.faces[: len(before.faces)], before.faces)
    np.testing.assert_array_equal(after.vertices[: len(before.vertices)], before.vertices)
    return Mesh(after.vertices, after.faces[len(before.faces) :])


def test_a_hole_in_the_floor_closes_flat_and_whole_at_the_spacing_of_the_floor() -> None:
    floor = sheet(HOLE)
    found = closed(floor)
    new = added(floor, found)
    normals, areas = face_normals(new)
    assert areas.sum() == pytest.approx(np.pi * RADIUS**2, rel=0.1)
    assert np.abs(found.vertices[len(floor.vertices) :, 2]).max() < NOISE and normals[:, 2].min() > 0.9
    assert len([*border_loops(found)]) == 1  # its outer border
    uses = np.bincount(unique_edges(found.faces)[1].reshape(-1))
    assert uses.max() == 2
    lengths = edge_lengths(part_of(new, np.ones(len(new.faces), bool)))
    assert 0.8 * SPACING < np.median(lengths) < 1.4 * SPACING and lengths.max() < 2.5 * SPACING


def test_what_was_seen_through_stays_open() -> None:
    both = room(HOLE)
    new = added(both, closed(both, opened=lambda _, normals: normals[:, 2] < 0.5))
    assert face_normals(new)[1].sum() == pytest.approx(np.pi * RADIUS**2, rel=0.1)
    assert np.abs(new.vertices[np.unique(new.faces)][:, 2]).max() < 4 * NOISE  # none of it is on the wall


def test_an_opening_that_is_partly_hidden_is_one() -> None:
    floor = sheet(HOLE)
    new = added(floor, closed(floor, opened=lambda points, _: points[:, 0] < HOLE[0] - RADIUS / 2))
    assert not len(new.faces)


def test_a_hole_across_an_edge_stays_open() -> None:
    bent = sheet(np.zeros(2))
    heights = np.abs(bent.vertices[:, :1]) * [0, 0, 1]
    assert not len(added(bent.at(bent.vertices + heights), closed(bent.at(bent.vertices + heights))).faces)


def test_a_hole_in_a_ball_stays_open() -> None:
    ball = weld(sphere(1.0, 5))
    cut = part_of(ball, face_means(ball.vertices, ball.faces)[:, 2] < 0.9)
    assert not len(added(cut, closed(cut)).faces)


def test_several_holes_of_a_plane_are_closed() -> None:
    floor = sheet(HOLE, DOOR)
    assert len([*border_loops(floor)]) == 3 and len([*border_loops(closed(floor))]) == 1


@pytest.mark.parametrize("seed", range(12))
def test_a_ragged_hole_is_filled_once_or_stays_open(seed: int) -> None:
    random = np.random.default_rng(seed)
    flat = plane(SIDE, round(SIDE / SPACING))
    flat = flat.at(flat.vertices - flat.vertices.mean(axis=0))
    flat = flat.at(flat.vertices + random.normal(0, 1, flat.vertices.shape) * [0.2 * SPACING, 0.2 * SPACING, NOISE])
    away = face_means(flat.vertices, flat.faces)[:, None, :2] - random.uniform(-0.4, 0.4, (6, 2))
    gone = (np.linalg.norm(away, axis=2) < random.uniform(0.05, 0.25, 6)).any(axis=1)
    floor = part_of(flat, ~gone)
    found = closed(floor)
    new = added(floor, found)
    assert np.bincount(unique_edges(found.faces)[1].reshape(-1)).max() == 2
    assert not len(new.faces) or face_normals(new)[0][:, 2].min() > 0  # none is turned over
    area = face_normals(flat)[1][gone].sum()
    assert face_normals(new)[1].sum() <= 1.05 * area
    if len([*border_loops(floor)]) == 2:
        assert len([*border_loops(found)]) == 1 and face_normals(new)[1].sum() > 0.9 * area


def test_an_island_in_a_hole_is_not_covered_again() -> None:
    flat = sheet()
    middles = face_means(flat.vertices, flat.faces)[:, :2]
    away = np.linalg.norm(middles - HOLE, axis=1)
    floor = part_of(flat, (away > RADIUS) | (away < RADIUS / 2))
    area = face_normals(closed(floor))[1].sum()
    assert face_normals(floor)[1].sum() + 0.5 * np.pi * RADIUS**2 < area < SIDE**2 * 1.02


def test_surface_without_area_around_a_hole_closes_nothing() -> None:
    flat = Mesh.of(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]), np.array([[0, 1, 2], [1, 2, 3]]))
    assert not len(added(flat, closed(flat)).faces)
