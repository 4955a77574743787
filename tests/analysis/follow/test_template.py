"""The base mesh meets its error, and detail that all frames share survives where that of one frame does not."""

import math

import numpy as np
import pytest

from meshreel.analysis.follow import template
from meshreel.analysis.follow.template import CURVATURE, FEWEST, NOISY_ERROR, base_mesh, shared_detail
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.topology import heights, levels_of, refine
from meshreel.types import Mesh
from tests.spheres import sliding_sphere

BALL = Mesh.of(sliding_sphere(1, levels=4)[0].vertices / 12**0.5, sliding_sphere(1, levels=4)[0].faces)  # diagonal 1
ROUGH = Mesh.of(BALL.vertices * (1 + 0.03 * np.sin(14 * BALL.vertices[:, :1])), BALL.faces)


def rms(mesh: Mesh, base: Mesh) -> float:
    gaps = Surface(base).closest(mesh.vertices).points - mesh.vertices
    return float(np.sqrt((gaps**2).sum(axis=1).mean()))


@pytest.mark.parametrize("body", [BALL, ROUGH], ids=["ball", "rough"])
@pytest.mark.parametrize("error", [2e-3, 1e-3, 5e-4])
def test_the_base_mesh_has_about_the_requested_error(body: Mesh, error: float) -> None:
    assert error / 1.4 < rms(body, base_mesh(body, error)) < 1.4 * error


def test_a_smaller_error_takes_more_vertices() -> None:
    counts = [len(base_mesh(ROUGH, error).vertices) for error in (2e-3, 1e-3, 5e-4, 2e-4)]
    assert counts == sorted(counts) and len(set(counts)) == 4


def test_a_limb_that_coarse_meshes_lose_breaks_no_search() -> None:
    limbs = [Mesh.of(BALL.vertices * [0.5, 0.02, 0.02] + [0, y, 0], BALL.faces) for y in np.linspace(-0.4, 0.4, 6)]
    parts = [BALL, *limbs]
    first = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = np.concatenate([part.faces + at for part, at in zip(parts, first, strict=True)])
    body = Mesh.of(np.concatenate([part.vertices for part in parts]), faces)
    for error, noise in ((7e-4, 0.0), (4e-4, 6e-4)):
        aim = math.hypot(error, NOISY_ERROR * noise)
        assert aim / 1.4 < rms(body, base_mesh(body, error, noise)) < 1.4 * aim


def test_a_base_mesh_has_neither_fewer_vertices_than_a_body_needs_nor_more_than_the_frame_has() -> None:
    assert len(base_mesh(BALL, 1.0).vertices) >= 0.8 * FEWEST
    assert len(base_mesh(ROUGH, 1e-12).vertices) <= len(ROUGH.vertices)


@pytest.mark.parametrize("error", [1e-6, 1.0])
def test_a_mesh_of_one_face_is_its_own_base(error: float) -> None:
    triangle = Mesh.of([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    base = base_mesh(triangle, error)
    np.testing.assert_allclose(np.sort(base.vertices, axis=0), np.sort(triangle.vertices, axis=0), atol=1e-9)


BASE = Mesh.of(sliding_sphere(1, levels=1)[0].vertices / 12**0.5, sliding_sphere(1, levels=1)[0].faces)
COUNT = len(BASE.vertices)
LEVELS = levels_of(BASE.faces, COUNT, 2)


def detailed(frames: int, *bumps: tuple[int, float]) -> np.ndarray:
    """A ball whose base slides and whose detail is the same in all frames but for the bumps (frame, height)."""
    time = np.arange(frames)[:, None, None]
    known = BASE.vertices + 0.02 * time * np.array([1.0, 0.5, 0.0])
    generator = np.random.default_rng(0)
    for level in LEVELS:
        scalars = np.tile(0.01 * generator.normal(size=len(level.edges)), (frames, 1))
        for frame, height in bumps:
            scalars[frame] += height
        known = refine(np.ascontiguousarray(known), level, scalars, CURVATURE)
    return known


def details(positions: np.ndarray) -> np.ndarray:
    level = LEVELS[0]
    return heights(positions[:, : level.count], positions[:, :COUNT], level, CURVATURE)


def test_detail_that_does_not_change_stays() -> None:
    positions = detailed(5)
    coherent = shared_detail(BASE.faces, COUNT, 2)(positions)
    np.testing.assert_array_equal(coherent[:, :COUNT], positions[:, :COUNT])
    away = np.linalg.norm(coherent - positions, axis=2)  # heights are told from planes: not to the last digit
    assert np.sqrt((away**2).mean()) < 0.004  # of detail that is .01


def test_a_frame_with_different_detail_is_pulled_to_the_others() -> None:
    positions = detailed(5, (2, 0.02))
    coherent = shared_detail(BASE.faces, COUNT, 2)(positions)
    plain = shared_detail(BASE.faces, COUNT, 2)(detailed(5))
    np.testing.assert_allclose(coherent, plain, atol=1e-9)
    assert np.median(np.abs(details(positions)[2] - details(positions)[0])) > 0.01
    np.testing.assert_array_equal(coherent[:, :COUNT], positions[:, :COUNT])


def test_shared_detail_moves_with_the_body() -> None:
    coherent = shared_detail(BASE.faces, COUNT, 2)(detailed(4))
    shapes = coherent - coherent[:, :1]
    np.testing.assert_allclose(shapes, np.broadcast_to(shapes[:1], shapes.shape), atol=1e-9)


def test_without_levels_nothing_is_drawn_anywhere() -> None:
    positions = np.repeat(BASE.vertices[None], 3, axis=0) + np.arange(3)[:, None, None]
    found = shared_detail(BASE.faces, COUNT, 0)(positions)
    np.testing.assert_array_equal(found, positions)


def test_the_search_for_the_number_of_vertices_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    real = template.decimate
    monkeypatch.setattr(
        template, "decimate", lambda mesh, count, border: (asked.append(count), real(mesh, count, border))[1]
    )
    base_mesh(ROUGH, 1e-5)
    assert len(asked) <= template.MOST_ROUNDS
