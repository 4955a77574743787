"""Progress counts each frame once and forward, and moves while a group is worked on."""

from dataclasses import replace
from fractions import Fraction

import pytest

from meshreel.encoder.group.progress import IntervalStages, Stages
from meshreel.encoder.sequence import Encoder
from tests.small_options import quick
from tests.spheres import sliding_sphere


@pytest.fixture
def told():
    """Stages of 40 frames, and what they told."""
    told = list[tuple[str, int, int]]()
    return Stages(lambda *now: told.append(now), 40), told


def test_work_on_a_group_counts_up_to_the_longest_group_and_again_from_the_next(told):
    stages, told = told
    interval = IntervalStages(stages, 30, 4)
    for _ in range(9):  # some frames twice: the group was cut
        interval.add_work("frames tracked", 1)
    assert told == [("track", n, 40) for n in (1, 2, 3, 4)]
    interval.add("code", 3)
    interval.add_work("frames tracked", 1)  # the fourth frame again
    interval.add_work("frames tracked", 1)
    assert told[-1] == ("track", 5, 40)
    interval.add_work("closest points", 100)
    assert {stage for stage, *_ in told} == {"track", "code", "fit"}


def test_what_is_fitted_is_tracked_though_a_key_is_not(told):
    stages, told = told
    interval = IntervalStages(stages, 4, 4)
    interval.add_work("frames tracked", 3)
    interval.add_work("frames fitted", 4)
    assert told == [("track", 3, 40), ("track", 4, 40), ("fit", 4, 40)]


def test_what_is_coded_has_passed_all_stages_and_no_stage_goes_back(told):
    stages, told = told
    interval = IntervalStages(stages, 10, 4)
    interval.reach_frame("track", 8)
    interval.reach_frame("track", 5)
    interval.reach("code", 1.0)
    interval.reach_frame("code", 99)
    assert told == [("track", 8, 40), ("code", 10, 40), ("track", 10, 40), ("fit", 10, 40)]


def test_bodies_share_the_frames_of_their_scene(told):
    stages, told = told
    for _ in range(3):
        body = IntervalStages(stages, 7, 16, Fraction(1, 3))
        for _ in range(7):
            body.add("code", 1)
    assert [done for stage, done, _ in told if stage == "code"] == [n // 3 for n in range(1, 22)]


def test_an_encode_tells_of_each_frame_that_it_tracks(tmp_path):
    told = dict[str, list[int]]()
    options = replace(quick(), scene=None)
    Encoder(
        sliding_sphere(6, levels=2), progress=lambda stage, done, _: told.setdefault(stage, []).append(done)
    ).encode(tmp_path / "a.reel", options)
    assert told["survey"] == [1, 2, 3, 4, 5, 6] and told["code"][0] == 0
    assert all(counts == sorted(counts) and counts[-1] == 6 for counts in told.values())
    assert told["track"][:5] == [1, 2, 3, 4, 5]
