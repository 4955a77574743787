"""Stages that are broken on purpose: the encoder's judge catches each, and what is delivered covers the frames."""

import pytest
from meshreel_bench.codecs.broken import STAGES, Broken, BrokenOptions
from meshreel_bench.codecs.meshreel import MeshreelCodec

from meshreel.encoder.group.interval import Interval
from tests.encoder.run.test_judge import BODIES, frames_of, groups_of, recipe
from tests.small_bodies import body

# Each stage on two bodies, each body with two stages or more: all pairs take three minutes.
PAIRS = [([*BODIES][(k + more) % len(BODIES)], stage) for k, stage in enumerate(STAGES) for more in (0, 2)]


@pytest.mark.parametrize(("name", "stage"), PAIRS)
def test_what_a_stage_breaks_is_caught_and_encoded_again(name: str, stage: str):
    interval = Interval(frames_of(BODIES[name]()), first_frame=7)
    again = groups_of(interval, Broken(recipe().options, stage=stage))
    assert any(group.mended for group in again)
    assert all(group.fidelity.covered > 0.98 for group in again)
    assert all(7 <= group.fidelity.least < 13 for group in again)


def test_where_every_template_is_broken_each_frame_gets_a_mesh_of_its_own():
    interval = Interval(frames_of(body(1, 4)))
    groups = groups_of(interval, Broken(recipe().options, stage="freezes", times=99))
    assert {group.form.name for group in groups} == {"DRACO"} and all(group.mended for group in groups)


def test_each_stage_is_a_variant_of_the_encoder():
    for stage in STAGES:
        options = MeshreelCodec("best", variant=stage).encoder_options
        assert isinstance(options, BrokenOptions) and isinstance(options.recipe(), Broken)
