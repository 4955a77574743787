"""Rigid fits and unit dual quaternions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.geometry import rigid

SEEDS = st.integers(0, 2**32 - 1)


def random_motions(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    q, _ = np.linalg.qr(rng.standard_normal((count, 3, 3)))
    return q * np.sign(np.linalg.det(q))[:, None, None], rng.standard_normal((count, 3))


@settings(max_examples=30)
@given(SEEDS)
def test_a_fit_recovers_the_motion_of_any_solid_neighbourhood(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rotations, translations = random_motions(rng, 20)
    source = rng.standard_normal((20, 6, 3))
    target = np.einsum("nij,nkj->nki", rotations, source) + translations[:, None]
    found, shift = rigid.fit_rigid(source, target, rng.uniform(0.1, 1, (20, 6)))
    np.testing.assert_allclose(found, rotations, atol=1e-9)
    np.testing.assert_allclose(shift, translations, atol=1e-9)


def test_a_fit_to_a_mirror_image_is_still_a_rotation() -> None:
    source = np.random.default_rng(0).standard_normal((5, 8, 3))
    rotations, _ = rigid.fit_rigid(source, source * np.array([1.0, 1, -1]), np.ones((5, 8)))
    np.testing.assert_allclose(np.linalg.det(rotations), 1, atol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_points_on_a_line_or_a_single_point_give_the_smallest_rotation(count: int) -> None:
    line = np.arange(count)[None, :, None] * np.array([1.0, 2, 3])
    rotations, translations = rigid.fit_rigid(line, line + 0.5, np.ones((1, count)))
    np.testing.assert_allclose(rotations[0], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(translations[0], 0.5, atol=1e-9)


def test_weights_of_zero_do_not_divide_by_zero() -> None:
    rotations, translations = rigid.fit_rigid(np.ones((1, 3, 3)), np.zeros((1, 3, 3)), np.zeros((1, 3)))
    assert np.isfinite(rotations).all()
    assert np.isfinite(translations).all()


@settings(max_examples=30)
@given(SEEDS)
def test_a_dual_quaternion_moves_as_its_matrix_does_and_its_inverse_undoes_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rotations, translations = random_motions(rng, 50)
    points = rng.standard_normal((50, 3))
    motions = rigid.from_rigid(rotations, translations)
    moved = rigid.apply(motions, points)
    turned = np.einsum("nij,nj->ni", rotations, points)
    np.testing.assert_allclose(moved, turned + translations, atol=1e-12)
    np.testing.assert_allclose(rigid.rotate(motions, points), turned, atol=1e-12)
    np.testing.assert_allclose(rigid.apply(motions * [1.0, -1, -1, -1, 1, -1, -1, -1], moved), points, atol=1e-12)


@settings(max_examples=30)
@given(SEEDS)
def test_a_blend_of_one_motion_in_both_signs_is_that_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = rigid.from_rigid(*random_motions(rng, 1))
    signs = rng.choice([-1.0, 1.0], (1, 7, 1))
    blended = rigid.blend(motion[:, None] * signs, rng.uniform(0.1, 1, (1, 7)))
    points = rng.standard_normal((1, 3))
    np.testing.assert_allclose(rigid.apply(blended, points), rigid.apply(motion, points), atol=1e-12)


def test_a_blend_of_half_turns_about_one_axis_is_the_turn_between_them() -> None:
    angles = np.array([0.0, 0.4])
    rotations = np.stack([[[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]] for a in angles])
    motions = rigid.from_rigid(rotations, np.zeros((2, 3)))
    blended = rigid.blend(motions[None], np.full((1, 2), 0.5))
    expected = np.array([[np.cos(0.2), np.sin(0.2), 0]])
    np.testing.assert_allclose(rigid.rotate(blended, np.array([[1.0, 0, 0]])), expected, atol=1e-12)


def test_half_turns_have_quaternions_too() -> None:
    turns = np.stack([np.diag(d) for d in ([1.0, 1, 1], [1.0, -1, -1], [-1.0, 1, -1], [-1.0, -1, 1])])
    points = np.tile([[1.0, 2, 3]], (4, 1))
    motions = rigid.from_rigid(turns, np.zeros((4, 3)))
    np.testing.assert_allclose(rigid.rotate(motions, points), np.einsum("nij,nj->ni", turns, points), atol=1e-12)
