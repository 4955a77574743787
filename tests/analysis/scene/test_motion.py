"""Prompts of points: they lie on what moves, in a frame that shows it, and beside it."""

import numpy as np

from meshreel.analysis.scene.hypotheses import SIDE, motion_prompts, thinned

WALKER, BALL = 1.5, 2.0  # m, their depths


def depths(noise: float = 0.01) -> list[np.ndarray]:
    """Somebody stands in eight of twelve frames, then walks behind the border; a ball rolls; the rest is 4 m away."""
    frames = []
    for frame in range(12):
        depth = np.full((60, 80), 4.0) + np.random.default_rng(frame).normal(0, noise, (60, 80))
        depth[:4, :4] = np.inf if frame % 2 else 4.0
        depth[20:50, 10 + 12 * max(0, frame - 7) :][:, :12] = WALKER
        depth[50:56, 6 * frame : 6 * frame + 8] = BALL
        frames.append(depth.astype(np.float32))
    return frames


def test_each_thing_that_moves_has_points_on_it_and_beside_it():
    video = depths()
    prompts = motion_prompts(video)
    on: set[float] = set()
    for prompt in prompts:
        columns, rows = (prompt.points * [80, 60]).astype(int).T
        found = video[prompt.frame][rows, columns]
        assert prompt.inside.sum() == 3 and (found[~prompt.inside] > 3.5).all() and (found[prompt.inside] < 3).all()
        on |= set(found[prompt.inside].tolist())
    assert on == {WALKER, BALL} and len(prompts) <= 3


def test_noise_holes_and_a_still_room_have_no_prompts():
    still = [np.full((60, 80), 4.0, np.float32)] * 3
    assert motion_prompts(still) == [] and motion_prompts([np.full((60, 80), np.inf, np.float32)] * 3) == []
    noisy = [np.random.default_rng(k).normal(4, 0.03, (60, 80)).astype(np.float32) for k in range(12)]
    assert motion_prompts(noisy) == []


def test_a_large_picture_is_thinned():
    large = np.arange(480 * 640, dtype=np.float32).reshape(480, 640)
    assert thinned(large).shape == (120, SIDE) and thinned(large[:3, :5]).shape == (3, 5)
