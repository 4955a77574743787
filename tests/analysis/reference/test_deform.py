"""Center-affinity deformation: eq. 7."""

import numpy as np
import pytest

from meshreel.analysis.reference.centers import (
    Neighbours,
    affinity,
    bind,
    center_motions,
    largest_distances,
    move,
    neighbours,
)
from meshreel.geometry.rigid import blend, rotate
from meshreel.geometry.topology import concatenate, vertex_normals
from meshreel.types import Centers, Mesh
from tests.metrics import shapes


def deform(mesh: Mesh, source: np.ndarray, target: np.ndarray, near: Neighbours) -> np.ndarray:
    binding = bind(mesh, source, near)
    return move(mesh.vertices, binding, center_motions(source, target, near), near)


def rotation(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def ball(middle: tuple[float, float, float], radius: float = 0.1) -> Mesh:
    return shapes.moved(shapes.sphere(radius), middle)


def inside(middle: tuple[float, float, float], count: int = 150, radius: float = 0.1, seed: int = 0) -> np.ndarray:
    points = np.random.default_rng(seed).uniform(-radius, radius, (20 * count, 3))
    points = points[np.linalg.norm(points, axis=1) < radius * 0.9]
    chosen, gap = [0], np.full(len(points), np.inf)
    while len(chosen) < count:  # evenly spread, as tracked centers are: always the farthest point next
        gap = np.minimum(gap, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(gap)))
    return points[chosen] + np.array(middle)


def kin(*poses: np.ndarray):  # type: ignore[no-untyped-def]
    distances = largest_distances(Centers(np.stack(poses), np.zeros(len(poses[0]), np.int32)))
    return neighbours(affinity(distances))


@pytest.mark.parametrize("angle", [0.0, 0.3, 2.0, np.pi, 4.5])
def test_a_rigid_motion_deforms_exactly(angle: float) -> None:
    mesh, source = ball((0.1, 0, 0)), inside((0.1, 0, 0))
    target = source @ rotation(angle).T + np.array([0.2, -0.1, 0.05])
    near = kin(source, target)
    expected = mesh.vertices @ rotation(angle).T + np.array([0.2, -0.1, 0.05])
    moved = deform(mesh, source, target, near)
    np.testing.assert_allclose(moved, expected, atol=1e-9)
    back = deform(Mesh(moved, mesh.faces), target, source, near)
    np.testing.assert_allclose(back, mesh.vertices, atol=1e-9)


def test_normals_turn_with_their_points() -> None:
    mesh, source = ball((0, 0, 0)), inside((0, 0, 0))
    near = kin(source)
    motions = center_motions(source, source @ rotation(1.0).T, near)
    bound = bind(mesh, source, near)
    turned = rotate(blend(motions[near.indices[bound.nearest]], bound.weights), vertex_normals(mesh))
    np.testing.assert_allclose(turned, vertex_normals(mesh) @ rotation(1.0).T, atol=1e-9)


def test_two_balls_that_touch_separate_without_damage() -> None:
    left, right = (-0.1, 0, 0), (0.1, 0, 0)  # radius .1: they touch at the origin
    mesh = concatenate([ball(left), ball(right)])
    touching = np.concatenate([inside(left), inside(right, seed=1)])
    shift = np.array([0.3, 0, 0])
    parted = touching + shift * (np.arange(300) >= 150)[:, None]
    moved = deform(mesh, touching, parted, kin(touching, parted))
    half = len(mesh.vertices) // 2
    np.testing.assert_allclose(moved[:half], mesh.vertices[:half], atol=1e-9)
    np.testing.assert_allclose(moved[half:], mesh.vertices[half:] + shift, atol=1e-9)


def test_a_vertex_nearest_to_a_center_of_the_other_body_stays_with_its_body(monkeypatch: pytest.MonkeyPatch) -> None:
    left, right = (-0.1, 0, 0), (0.1, 0, 0)
    mesh = concatenate([ball(left), ball(right)])
    own = inside(left)
    own = own[own[:, 0] < -0.03]  # the left body has no center near the contact, the right one pokes into it
    touching = np.concatenate([own, inside(right, seed=1), [[0.002, 0.0, 0.0]]])
    parted = touching + np.array([0.3, 0, 0]) * (np.arange(len(touching)) >= len(own))[:, None]
    near = kin(touching, parted)
    half = len(mesh.vertices) // 2
    guarded = deform(mesh, touching, parted, near)
    monkeypatch.setattr("meshreel.analysis.reference.centers.GUARD_CHOICES", 1)
    alone = deform(mesh, touching, parted, near)
    lost = [int((np.abs(v[:half] - mesh.vertices[:half]).max(axis=1) > 1e-3).sum()) for v in (guarded, alone)]
    assert lost[1] > 0
    assert lost[0] < lost[1]


def test_a_center_is_its_own_first_neighbour_even_beside_its_twin() -> None:
    pose = np.zeros((40, 3))
    assert (kin(pose).indices[:, 0] == np.arange(40)).all()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_handful_of_centers_still_shifts_a_mesh(count: int) -> None:
    mesh, source = ball((0, 0, 0)), inside((0, 0, 0), count)
    moved = deform(mesh, source, source + 0.25, kin(source))
    np.testing.assert_allclose(moved, mesh.vertices + 0.25, atol=1e-9)


def test_a_mesh_without_faces_or_vertices_deforms_to_itself() -> None:
    source = inside((0, 0, 0))
    assert deform(Mesh.empty(), source, source, kin(source)).shape == (0, 3)
    points = Mesh.of(source + 0.01, np.zeros((0, 3)))
    np.testing.assert_allclose(deform(points, source, source, kin(source)), points.vertices, atol=1e-12)
