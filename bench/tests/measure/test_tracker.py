"""Accuracy of tracking: the truth is right, and both trackers are near it."""

import numpy as np
import pytest
from meshreel_bench.measure.tracker import carried, published_track, tracker_values

from meshreel.analysis.reference.track import TrackOptions, track_centers
from meshreel.errors import InputError
from meshreel.types import Mesh, MeshList
from tests.spheres import sliding_sphere

BALL = sliding_sphere(1, levels=3)[0]

TURN, SHIFT = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([0.3, -0.1, 0.2])


def moved(points, step):
    return points + step * np.array([0.05, 0.0, 0.02])


def test_a_rigid_motion_carries_the_volume_exactly():
    centers = np.random.default_rng(0).uniform(-0.4, 0.4, (20, 3))
    other = Mesh.of(BALL.vertices @ TURN.T + SHIFT, BALL.faces)
    assert np.allclose(carried([BALL, other], centers, 8)[1], centers @ TURN.T + SHIFT)


def test_the_published_energy_follows_a_bar_that_moves(monkeypatch):
    bar, options = BALL.vertices * [1.5, 0.5, 0.2], TrackOptions(centers=40, samples=20_000)
    monkeypatch.setattr("meshreel.analysis.reference.track.REACH", 0.5)
    monkeypatch.setattr("meshreel.analysis.reference.track.AGREEMENT", 0.5)
    frames = [Mesh.of(moved(bar, t), BALL.faces) for t in range(4)]
    first = track_centers(frames[:1], options).positions[0]
    missed = np.linalg.norm(published_track(frames, first, options)[3] - moved(first, 3), axis=1)
    assert np.sqrt(np.mean(missed**2)) < 0.03  # of 0.16


def test_values_are_of_both_trackers_and_refused_where_no_motion_is_known():
    frames = MeshList(tuple(Mesh.of(moved(BALL.vertices, t), BALL.faces) for t in range(2)))
    found = {method: tracker_values(frames, method) for method in ("ours", "published")}
    assert all(0 < values["center_rms_mm"] < 100 and values["truth_rms_mm"] < 1e-6 for values in found.values())
    with pytest.raises(InputError, match="share their faces"):
        tracker_values(MeshList((frames[0], Mesh.of(frames[1].vertices, frames[1].faces[::-1]))), "ours")
    with pytest.raises(InputError, match="no tracker is called 'optical'"):
        tracker_values(frames, "optical")
