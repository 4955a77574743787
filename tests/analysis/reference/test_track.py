"""Centers are even, rigid where the body is, distributed over bodies, separate again after contact, repeatable."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial import cKDTree

from meshreel import _core
from meshreel.analysis.reference.track import TrackOptions, track_centers
from meshreel.geometry.inside import interior_samples
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh
from tests.geometry.test_inside import sheet, sphere

OPTIONS = TrackOptions(centers=150, samples=8000)


def rotation(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def bean() -> Mesh:
    """A body without symmetry, about 0.6 long."""
    ball = sphere(0.3)
    x, y, z = ball.vertices.T
    return Mesh.of(np.stack([x, 0.5 * y + 1.5 * x * x, 0.4 * z * (1 + x)], axis=1), ball.faces)


def moved(mesh: Mesh, turn: np.ndarray, shift: np.ndarray) -> Mesh:
    return Mesh.of(mesh.vertices @ turn.T + shift, mesh.faces)


def test_a_rigid_motion_moves_the_centers_rigidly() -> None:
    steps = [(rotation(0.06 * t), np.array([0.02, 0.01, 0]) * t) for t in range(5)]
    options = dataclasses.replace(OPTIONS, samples=30_000)
    positions = track_centers([moved(bean(), r, s) for r, s in steps], options).positions
    for (turn, shift), now in zip(steps, positions, strict=True):
        error = np.linalg.norm(positions[0] @ turn.T + shift - now, axis=1)
        assert error.mean() < 0.01 and error.max() < 0.03  # a cell is 0.05 wide


def test_a_body_at_rest_rests() -> None:
    options = dataclasses.replace(OPTIONS, samples=30_000)
    positions = track_centers([bean()] * 4, options).positions
    assert np.linalg.norm(positions[-1] - positions[0], axis=1).mean() < 0.005  # a tenth of a cell


def test_cells_of_a_sphere_are_of_even_size() -> None:
    centers = track_centers([sphere()], OPTIONS).positions[0]
    points = interior_samples(sphere(), 30_000, np.random.default_rng(9)).points
    sizes = np.bincount(cKDTree(centers).query(points)[1], minlength=len(centers))
    assert sizes.std() / sizes.mean() < 0.3
    assert sizes.min() > 0.4 * sizes.mean()


def test_centers_keep_covering_a_body_that_bends() -> None:
    def bent(t: int) -> Mesh:
        rest = bean()
        x, y, z = rest.vertices.T
        return Mesh.of(np.stack([x, y + 0.15 * t * x * x, z], axis=1), rest.faces)

    frames = [bent(t) for t in range(5)]
    track = track_centers(frames, OPTIONS)
    first, last = (cKDTree(track.positions[t]).query(frames[t].vertices)[0].max() for t in (0, 4))
    assert last < 1.3 * first


def test_an_open_mesh_is_tracked() -> None:
    kept = np.random.default_rng(0).random(len(bean().faces)) > 0.05
    frames = [Mesh.of(bean().vertices + [0.02 * t, 0, 0], bean().faces[kept]) for t in range(3)]
    shift = np.diff(track_centers(frames, OPTIONS).positions, axis=0).mean(axis=1)
    np.testing.assert_allclose(shift, [[0.02, 0, 0]] * 2, atol=0.007)  # an eighth of a cell


def test_a_flat_sheet_is_tracked() -> None:
    positions = track_centers([sheet(), moved(sheet(), np.eye(3), np.array([0, 0, 0.02]))], OPTIONS).positions
    np.testing.assert_allclose(positions[1, :, 2], 0.02, atol=1e-3)


def test_two_bodies_share_the_centers_by_volume() -> None:
    track = track_centers([concatenate([sphere(0.1, (0.4, 0, 0)), sphere(0.2, (-0.2, 0, 0))])], OPTIONS)
    assert track.positions.shape == (1, 150, 3)
    small = track.bodies == 1
    assert small.sum() == pytest.approx(150 / 9, abs=2)
    assert (track.positions[0, small, 0] > 0.3).all() and (track.positions[0, ~small, 0] < 0.1).all()


def test_a_small_body_gets_centers_too() -> None:
    track = track_centers([concatenate([sphere(0.3), sphere(0.06, (0.45, 0, 0))])], OPTIONS)
    assert (track.bodies == 1).sum() == 4


def test_bodies_that_touch_keep_their_centers_when_they_separate() -> None:
    gaps = [0.06, 0.02, -0.01, -0.01, 0.02, 0.06]
    frames = [concatenate([sphere(0.2, (-0.2 - g / 2, 0, 0)), sphere(0.2, (0.2 + g / 2, 0, 0))]) for g in gaps]
    track = track_centers(frames, OPTIONS)
    left = track.positions[0, :, 0] < 0
    assert np.array_equal(track.positions[-1, :, 0] < 0, left)


def test_frames_of_other_connectivity_are_followed() -> None:
    fine, coarse = sphere(0.3, levels=4), sphere(0.3, levels=3)
    positions = track_centers([fine, coarse, fine], OPTIONS).positions
    assert np.linalg.norm(positions[2] - positions[0], axis=1).mean() < 0.01


def test_fewer_samples_than_centers_reduce_the_centers() -> None:
    track = track_centers([Mesh.of(bean().vertices, [[0, 0, 1]])], OPTIONS)
    assert track.positions.shape == (1, 2, 3)


def test_core_refuses_indices_out_of_range_and_values_that_are_not_finite() -> None:
    points, owners = np.random.default_rng(0).random((20, 3)), np.zeros(20, np.int32)
    lists = np.array([0, 1, 2], np.int32), np.array([1, 9], np.int32), np.ones(2)
    with pytest.raises(ValueError, match="out of range"):
        _core.follow_centers(
            points, points[:2], *lists, points[:2].copy(), np.zeros((2, 9)), owners, 1.0, 1.0, 1e-4, 10
        )
    with pytest.raises(ValueError, match="finite"):
        _core.spread_centers(points * np.nan, points[:2].copy(), owners, 1e-4, 10)


def test_motions_that_agree_differ_by_nothing_and_a_shift_by_its_square() -> None:
    offsets, indices, out = np.array([0, 1, 2], np.int32), np.array([1, 0], np.int32), np.empty(2)
    turns = np.tile(rotation(0.3).reshape(1, 9), (2, 1))
    means, spreads = np.ones((2, 3)), np.tile(np.eye(3).reshape(1, 9), (2, 1))
    _core.motion_differences(offsets, indices, turns, np.array([[0, 0, 0], [3.0, 4, 0]]), means, spreads, out)
    np.testing.assert_allclose(out, 25)


def test_motion_differences_equal_their_mean_over_the_points() -> None:
    generator = np.random.default_rng(4)
    points = generator.normal(size=(500, 3)) * [0.1, 0.2, 0.3] + 1
    turns, shifts = np.stack([rotation(0.2), rotation(-0.5)]), generator.normal(size=(2, 3))
    sent = np.einsum("kij,nj->kni", turns, points) + shifts[:, None]
    mean, covariance = points.mean(axis=0), np.cov(points.T, bias=True)
    out = np.empty(2)
    _core.motion_differences(
        np.array([0, 1, 2], np.int32), np.array([1, 0], np.int32), turns.reshape(2, 9), shifts,
        np.tile(mean, (2, 1)), np.tile(covariance.reshape(1, 9), (2, 1)), out,
    )  # fmt: skip
    np.testing.assert_allclose(out, np.mean(np.sum((sent[0] - sent[1]) ** 2, axis=1)), rtol=1e-12)
