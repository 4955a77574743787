"""Flat pieces lie on planes, straight edges where two meet; what is rough, curved, small or beyond noise stays."""

import numpy as np
import pytest

from meshreel.geometry import flat
from meshreel.geometry.closest_points import distances
from meshreel.geometry.decimate import decimate_faces
from meshreel.geometry.flat import OFF, flattened
from meshreel.geometry.topology import weld
from meshreel.types import Mesh
from tests.metrics.shapes import plane, sphere

CELLS, NOISE = 40, 0.002  # a side of 1 m
FLOOR = plane(1.0, CELLS)  # from the origin, up along z


def noisy(mesh: Mesh, sigma: float = NOISE, seed: int = 0) -> Mesh:
    return mesh.at(mesh.vertices + np.random.default_rng(seed).normal(0, sigma, mesh.vertices.shape))


def corner() -> Mesh:
    """A floor and two walls that meet in a corner at the origin."""
    sides = [FLOOR.vertices @ np.roll(np.eye(3), k, axis=1) for k in range(3)]
    faces = [FLOOR.faces + k * len(FLOOR.vertices) for k in range(3)]
    return weld(Mesh.of(np.round(np.concatenate(sides), 9), np.concatenate(faces)))


def laid(mesh: Mesh, most: float = NOISE) -> tuple[Mesh, np.ndarray]:
    return flattened(mesh, np.full(len(mesh.vertices), most))


def test_a_noisy_sheet_lies_on_one_plane_and_keeps_its_faces():
    mesh = noisy(FLOOR)
    found, on_planes = laid(mesh)
    np.testing.assert_array_equal(found.faces, mesh.faces)
    assert on_planes.mean() > 0.99
    heights = found.vertices[on_planes, 2]
    assert np.ptp(heights) < 0.3 * NOISE and abs(heights.mean()) < 0.1 * NOISE  # one normal, of 1681 places
    assert len(decimate_faces(found, 300).faces) < 301
    inner = np.abs(FLOOR.vertices[:, :2] - 0.5).max(axis=1) < 0.45  # beside the noisy border
    assert distances(found.vertices[inner], decimate_faces(found, 300)).max() < 0.1 * NOISE


@pytest.mark.parametrize("turn", [0.0, 0.4])
@pytest.mark.parametrize("shift", [0.0, 300.0])
def test_three_planes_meet_in_straight_edges_and_a_corner_wherever_they_are(turn: float, shift: float):
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    true = corner()
    mesh = noisy(true)
    mesh = mesh.at(mesh.vertices @ rotation.T + shift)
    found, on_planes = laid(mesh)
    back = (found.vertices - shift) @ rotation
    edge = np.isclose(true.vertices, 0).sum(axis=1) >= 2
    assert on_planes.mean() > 0.98 and on_planes[edge].mean() > 0.9
    off = np.where(np.isclose(true.vertices, 0), back, 0.0)[on_planes]
    assert np.percentile(np.abs(off), 99.5) < 0.5 * NOISE and np.abs(off).max() < 3 * NOISE


def test_what_is_curved_rough_or_small_stays_as_it_is():
    for mesh in (sphere(), noisy(FLOOR, 6 * NOISE), noisy(plane(0.1, 4))):
        found, on_planes = laid(mesh)
        assert not on_planes.any() and found is mesh
    nothing = Mesh.empty()
    assert laid(nothing)[0] is nothing


def test_a_step_of_more_than_noise_stays_and_one_within_it_goes():
    for height, stays in ((6 * NOISE, True), (3.5 * NOISE, True), (0.5 * NOISE, False)):
        plate = np.linalg.norm(FLOOR.vertices[:, :2] - 0.5, axis=1) < 0.15  # too small to be a piece of its own
        mesh = noisy(FLOOR.at(FLOOR.vertices + np.outer(plate, [0, 0, height])))
        found, _ = laid(mesh)
        rise = found.vertices[plate, 2].mean() - np.median(found.vertices[~plate, 2])
        assert (rise > 0.6 * height) == stays and (rise < 0.1 * NOISE) != stays


def test_what_is_beside_a_plane_goes_with_it_and_what_is_apart_stays():
    away = np.linalg.norm(FLOOR.vertices[:, :2] - 0.5, axis=1)
    bump = FLOOR.at(FLOOR.vertices + np.outer(np.maximum(0.25 - away, 0), [0, 0, 1]))  # a cone of 25 cm
    ball = sphere(0.15, 4)
    faces = np.concatenate([bump.faces, ball.faces + len(bump.vertices)])
    mesh = noisy(Mesh(np.concatenate([bump.vertices, ball.vertices + [0.5, 0.5, 0.6]]), faces))
    found, on_planes = laid(mesh)
    ways = np.linalg.norm(found.vertices - mesh.vertices, axis=1)
    foot = np.flatnonzero(~on_planes[: len(away)] & (away < 0.22) & (away > 0.18))
    assert ways.max() <= 2 * OFF * NOISE and ways[len(away) :].max() < 1e-12
    assert 0.05 * NOISE < ways[foot].mean() < ways[on_planes].mean() and not on_planes[away.argmin()]


def test_planes_at_a_shallow_angle_meet_in_a_straight_edge():
    slope = np.tan(np.radians(30))
    true = FLOOR.at(FLOOR.vertices + np.outer(np.maximum(FLOOR.vertices[:, 0] - 0.5, 0), [0, 0, slope]))
    found, on_planes = laid(noisy(true))
    edge = on_planes & np.isclose(FLOOR.vertices[:, 0], 0.5)
    assert on_planes.mean() > 0.9 and edge.sum() > 20
    x, _, z = found.vertices[on_planes].T
    assert np.abs(z - slope * np.maximum(x - 0.5, 0)).max() < NOISE


def test_clutter_takes_no_more_rounds_than_it_has_directions(monkeypatch: pytest.MonkeyPatch):
    random = np.random.default_rng(0)
    balls = [sphere(0.03, 2) for _ in range(150)]
    count = len(balls[0].vertices)
    places = np.concatenate([ball.vertices + random.uniform(-1, 1, 3) for ball in balls])
    clutter = Mesh(places, np.concatenate([ball.faces + k * count for k, ball in enumerate(balls)]))
    asked, fitted = [], flat._plane
    monkeypatch.setattr(flat, "_plane", lambda *given: asked.append(1) or fitted(*given))
    laid(clutter, 4e-4)
    assert len(asked) < 9**3
