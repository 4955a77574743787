"""Noisy, open, incomplete frames through the layered encoder."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from meshreel.coding.layers.coder import decode_layers
from meshreel.encoder.layers import encode_interval
from meshreel.encoder.noise import above_noise
from meshreel.encoder.presets import preset_options
from meshreel.encoder.tails import TailOptions
from meshreel.encoder.target import target_of
from meshreel.errors import InputError
from meshreel.format.layout import Form
from meshreel.types import Mesh

from ..analysis.follow.test_fused_template import SIDE, gaps, noisy, sheet, with_hole

NOISE = 0.003
BEST = preset_options("best")


def test_without_noise_the_options_are_the_same_object() -> None:
    assert above_noise(BEST) is BEST


def test_noise_makes_nothing_finer() -> None:
    plain, known = BEST, above_noise(replace(BEST, noise=NOISE))
    assert known.layers.step > plain.layers.step
    assert known.template.error > plain.template.error
    assert known.embedded.lost > plain.embedded.lost
    assert known.fit.pull > plain.fit.pull
    assert known.tails is not None
    assert known.tails.noise == NOISE
    assert above_noise(replace(BEST, noise=NOISE, tails=None)).tails is None


def test_a_target_is_no_nearer_to_noisy_frames_than_the_truth_is() -> None:
    frames = [sheet()]
    assert target_of(frames, BEST.target, NOISE).distance >= NOISE
    assert target_of(frames, BEST.target, 0.0).distance < NOISE


@pytest.mark.parametrize("noise", [-0.001, 0.06, float("nan")])
def test_a_noise_out_of_range_is_refused(noise: float) -> None:
    with pytest.raises(InputError, match="noise"):
        replace(BEST, noise=noise)
    with pytest.raises(InputError, match="noise"):
        TailOptions(noise=noise if noise < 0 else float("inf"))


def test_a_noisy_sheet_with_moving_holes_is_one_group_and_nearer_to_the_truth_than_the_frames() -> None:
    truth = [sheet(0.004 * t) for t in range(6)]
    holes = np.linspace(-0.15, 0.15, 6)
    frames = [with_hole(noisy(mesh, NOISE, t), holes[t], 0.05, 0.04) for t, mesh in enumerate(truth)]
    (group,) = encode_interval(frames, replace(BEST, noise=NOISE))
    assert group.form == Form.LAYERS
    faces, positions, _ = decode_layers(group.payload[: group.layers[BEST.template.levels]])
    before, after = [], []
    for clean_mesh, frame, places in zip(truth, frames, positions, strict=True):
        inner = clean_mesh.vertices[np.abs(clean_mesh.vertices[:, :2]).max(axis=1) < 0.4 * SIDE]
        shown = Mesh(places, faces)
        before.append(np.sqrt(np.mean(gaps(frame, inner) ** 2)))
        after.append(np.sqrt(np.mean(gaps(shown, inner) ** 2)))
    assert max(after) < 0.6 * min(before)
