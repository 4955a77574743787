"""Presets: one name and one quality set every option."""

from __future__ import annotations

import pytest

from meshreel.errors import InputError
from meshreel.presets import displacement_step, preset_options, reference_vertices
from meshreel.windows import EncoderOptions


def test_the_default_options_are_the_default_preset():
    assert preset_options() == EncoderOptions()


def test_more_quality_means_finer_steps_and_more_vertices():
    qualities = range(0, 101, 10)
    steps = [displacement_step(q) for q in qualities]
    vertices = [reference_vertices(q) for q in qualities]
    assert steps == sorted(steps, reverse=True) and vertices == sorted(vertices)
    assert len(set(steps)) == len(set(vertices)) == len(qualities)


@pytest.mark.parametrize("quality", [-1, 100.5, float("nan")])
def test_a_quality_out_of_range_is_refused_with_its_value(quality):
    with pytest.raises(InputError, match="0 to 100"):
        preset_options(quality=quality)


def test_an_unknown_preset_is_refused_by_name():
    with pytest.raises(InputError, match="'best'"):
        preset_options("best")


def test_many_centers_bring_the_samples_they_need():
    assert preset_options(centers=20_000).track.samples >= 80_000
