"""Reference centers: eqs. 5 and 6."""

from itertools import pairwise

import numpy as np
import pytest

from meshreel.analysis.reference.centers import affinity, center_spacing, largest_distances, reference_centers
from meshreel.types import Centers


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + angle


def cloud(count: int = 300, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.3, 0.3, (count, 3)) * np.array([1, 0.5, 0.25])


def centers(*poses: np.ndarray) -> Centers:
    return Centers(np.stack(poses), np.zeros(len(poses[0]), np.int32))


def stress(distances: np.ndarray, pose: np.ndarray) -> float:
    """Kruskal's stress of a pose (eq. 5); 0 is perfect. Both of its sums count every pair twice, which cancels."""
    current = np.linalg.norm(pose[:, None] - pose[None], axis=2)
    return float(np.linalg.norm(distances - current) / (np.linalg.norm(distances) or 1.0))


def test_the_largest_distance_is_the_largest_of_all_frames() -> None:
    poses = [cloud(seed=s) for s in range(3)]
    expected = np.max([np.linalg.norm(p[:, None] - p[None], axis=2) for p in poses], axis=0)
    np.testing.assert_allclose(largest_distances(centers(*poses)), expected, atol=1e-5)


def test_rigid_frames_give_back_the_pose_itself_with_no_stress() -> None:
    pose = cloud()
    found = reference_centers(largest_distances(centers(pose, turned(pose, 1.0))), pose)
    assert stress(largest_distances(centers(pose)), found) < 1e-4
    np.testing.assert_allclose(found, pose, atol=1e-4)


def test_the_mirror_image_that_distances_allow_is_not_taken() -> None:
    for seed in range(5):  # the eigenvectors' signs are arbitrary: some of these start mirrored
        pose = cloud(seed=seed)
        found = reference_centers(largest_distances(centers(pose)), pose)
        np.testing.assert_allclose(found, pose, atol=1e-4)


def test_two_bodies_that_touch_in_one_frame_are_separate_in_the_reference() -> None:
    one = cloud() / 2
    apart = np.array([0.5, 0, 0])
    touching = np.concatenate([one, one + np.array([0.3, 0, 0])])
    parted = np.concatenate([one, one + apart])
    found = reference_centers(largest_distances(centers(touching, parted)), touching)
    gap = found[300:].mean(axis=0) - found[:300].mean(axis=0)
    assert np.linalg.norm(gap) == pytest.approx(0.5, abs=0.02)
    assert stress(largest_distances(centers(touching, parted)), found) < 0.02


def test_more_rounds_never_raise_the_stress(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    distances = largest_distances(centers(cloud(), cloud() + rng.normal(0, 0.05, (300, 3))))
    monkeypatch.setattr("meshreel.analysis.reference.centers.TOLERANCE", 0.0)
    found = []
    for rounds in (0, 2, 5, 20):
        monkeypatch.setattr("meshreel.analysis.reference.centers.MAX_ROUNDS", rounds)
        found.append(stress(distances, reference_centers(distances, cloud())))
    assert all(b <= a * (1 + 1e-5) for a, b in pairwise(found))


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 9])
def test_a_handful_of_centers_is_enough(count: int) -> None:
    pose = cloud(count)
    found = reference_centers(largest_distances(centers(pose)), pose)
    assert stress(largest_distances(centers(pose)), found) < 1e-3


def test_centers_at_one_place_stay_finite() -> None:
    pose = np.zeros((20, 3))
    found = reference_centers(largest_distances(centers(pose)), pose)
    assert np.isfinite(found).all()
    assert np.isfinite(affinity(largest_distances(centers(pose)))).all()


def test_affinity_is_one_for_a_center_itself_half_at_its_reach_and_knows_no_unit() -> None:
    pose = np.arange(10.0)[:, None] * np.array([1.0, 0, 0])
    distances = largest_distances(centers(pose))
    a = affinity(distances)
    np.testing.assert_array_equal(np.diag(a), 1)
    assert center_spacing(distances) == 1
    assert a[0, 2] == pytest.approx(0.5)
    np.testing.assert_allclose(affinity(1000 * distances), a, rtol=1e-5)
