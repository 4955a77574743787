"""Noisy, open, incomplete frames through the layered encoder."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.analysis.follow.embedded import LOST, Tracker
from meshreel.analysis.follow.template import LEVELS, base_mesh
from meshreel.encoder.group.forms import target_of
from meshreel.encoder.group.interval import Interval
from meshreel.encoder.layers import recipe as layered
from meshreel.encoder.layers.candidates import Candidate
from meshreel.encoder.layers.options import LayersOptions
from meshreel.encoder.layers.recipe import LayersRecipe
from meshreel.format.layout import Form
from meshreel.types import Mesh
from tests.coding.decoded_layers import decode_layers

from ...analysis.follow.test_fused_template import SIDE, gaps, noisy, sheet, with_hole

NOISE = 0.003
BEST = LayersOptions()
SHEET = noisy(sheet(), NOISE, 0)


def test_without_noise_limits_rounds_and_steps_are_those_of_the_options() -> None:
    assert Tracker(SHEET, 0, BEST.embedded).lost == LOST
    first, second = BEST.fit.rounds(0.0)
    assert (first.gates, first.smoothing, second.anchor) == (BEST.fit.gates, BEST.fit.smoothing, BEST.fit.pull)
    assert BEST.layers.step_above(0.0) == BEST.layers.step


def test_noise_makes_nothing_finer() -> None:
    assert BEST.layers.step_above(NOISE) > BEST.layers.step
    assert Tracker(SHEET, 0, BEST.embedded, NOISE).lost > LOST
    first, second = BEST.fit.rounds(NOISE)
    assert second.anchor > BEST.fit.pull and min(first.gates) > min(BEST.fit.gates)
    assert len(base_mesh(SHEET, BEST.template_error, NOISE).vertices) < len(
        base_mesh(SHEET, BEST.template_error).vertices
    )


def test_a_target_is_no_nearer_to_noisy_frames_than_the_truth_is() -> None:
    frames = [sheet()]
    assert target_of(frames, BEST.target, NOISE).distance >= NOISE
    assert target_of(frames, BEST.target, 0.0).distance < NOISE


def test_a_noisy_sheet_with_moving_holes_is_one_group_and_nearer_to_the_truth_than_the_frames() -> None:
    truth = [sheet(0.004 * t) for t in range(6)]
    holes = np.linspace(-0.15, 0.15, 6)
    frames = [with_hole(noisy(mesh, NOISE, t), holes[t], 0.05, 0.04) for t, mesh in enumerate(truth)]
    (group,) = LayersRecipe(BEST).encode(Interval(frames, NOISE))
    assert group.form == Form.LAYERS
    faces, positions, _ = decode_layers(group.payload[: group.layers[LEVELS]])
    before, after = [], []
    for clean_mesh, frame, places in zip(truth, frames, positions, strict=True):
        inner = clean_mesh.vertices[np.abs(clean_mesh.vertices[:, :2]).max(axis=1) < 0.4 * SIDE]
        shown = Mesh(places, faces)
        before.append(np.sqrt(np.mean(gaps(frame, inner) ** 2)))
        after.append(np.sqrt(np.mean(gaps(shown, inner) ** 2)))
    assert max(after) < 0.6 * min(before)


@pytest.mark.parametrize(("share", "keys"), [(1.0, [1]), (0.0, [1, 4])])
def test_a_template_of_its_own_is_tried_where_patches_are_most_of_a_predicted_group(
    share: float, keys: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    tried, of_key = list[int](), Candidate.of_key
    monkeypatch.setattr(layered, "PATCHED", share)
    monkeypatch.setattr(Candidate, "of_key", lambda *a: tried.append(a[1]) or of_key(*a))
    frames = [noisy(sheet(0.004 * t), NOISE, t) for t in range(6)]
    shown = [with_hole(mesh, 0.0, 0.05, 0.04) if t < 3 else mesh for t, mesh in enumerate(frames)]  # then it is closed
    groups = list(LayersRecipe(replace(BEST, group_size=3)).encode(Interval(shown, NOISE)))
    assert [group.frame_count for group in groups] == [3, 3]
    assert tried == keys
    assert groups[1].predicted  # what was tried is no cheaper
