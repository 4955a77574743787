"""Progress counts each frame once and forward, moves while a group is worked on, and tells a time left that holds."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.encoder.group.progress import COSTS, GROWTH, MOST, VIEWS, IntervalStages, Progress, Stages
from meshreel.encoder.sequence import Encoder
from meshreel.geometry import work
from tests.small_options import quick
from tests.spheres import sliding_sphere

PARTS = ("look", "survey", "segment", "background", "room", "color", "best")
GROUP = 16


@pytest.fixture
def told():
    """An interval of 30 frames in groups of four, and what it told."""
    told = list[tuple[str, int]]()
    return IntervalStages(lambda *now: told.append(now), 30, 4), told


def test_work_on_a_group_counts_up_to_the_longest_group_and_again_from_the_next(told):
    interval, told = told
    for _ in range(9):  # some frames twice: the group was cut
        interval.passed("frames tracked", 1)
    assert told == 4 * [("track", 1)]
    interval.passed("code", 3)
    interval.passed("frames tracked", 1)  # the fourth frame again
    interval.passed("frames tracked", 1)
    assert told[-1] == ("track", 1) and interval.reached["track"] == 5
    interval.passed("closest points", 100)
    assert set(interval.reached.values()) == {3, 5}


def test_what_is_fitted_is_tracked_though_a_key_is_not(told):
    interval, told = told
    interval.passed("frames tracked", 3)
    interval.passed("frames fitted", 4)
    assert [each for each in told if each[0] != "reference"] == [("track", 3), ("track", 1), ("fit", 4)]


def test_an_interval_that_ends_has_passed_all_stages_and_no_stage_goes_back(told):
    interval, told = told
    interval.reach("track", 8)
    interval.reach("track", 5)
    interval.end()
    interval.reach("code", 99)
    assert set(interval.reached.values()) == {30} and min(count for _, count in told) > 0


def test_bodies_share_the_frames_of_their_scene():
    told = list[Progress]()
    stages = Stages(told.append, 7)
    stages.expect("best")
    for _ in range(3):
        body = IntervalStages(stages.passed, 7, GROUP, Fraction(1, 3))
        for _ in range(7):
            body.passed("code", 1)
    assert [now.done for now in told if now.stage == "code"] == [n // 3 for n in range(1, 22)]


class Simulated:
    """An encode whose stages cost what is usual times a factor each, by a simulated clock."""

    def __init__(self, frames: int, factors: dict[str, float], more: float = 0.0):
        self.now, self.frames, self.told = 0.0, frames, list[tuple[float, Progress]]()
        usual = {stage: seconds for part in PARTS for stage, seconds in COSTS[part].items()}
        self._costs = {stage: seconds * factors[stage] for stage, seconds in usual.items()}
        self.stages = Stages(lambda progress: self.told.append((self.now, progress)), frames, more, lambda: self.now)
        self.stages.expect(*PARTS)
        self.stages.bodies = 1.0

    def encode(self, start: int = 0):
        if start:
            self.stages.skip(Fraction(start))
        for stage in [stage for part in PARTS[4 * bool(start) : 5] for stage in COSTS[part]]:
            for _ in range(VIEWS if stage == "views" else min(MOST.get(stage, self.frames), self.frames)):
                self.step(stage, self.stages.passed)
        interval = IntervalStages(self.stages.passed, self.frames, GROUP)
        interval.reached |= dict.fromkeys((*COSTS["best"], *COSTS["color"], "reference"), start)
        for first in range(start, self.frames, GROUP):
            count = min(GROUP, self.frames - first)
            for stage in ("track", "fit", "slide", "refine", "patch", "measure", "code", "judge", "color"):
                for _ in range(count):
                    self.step(stage, interval.passed)
        return self

    def step(self, stage, passed):
        self.now += self._costs[stage]
        passed(stage, 1)

    def left_at(self, share: float) -> float:
        """The time left as told when this share of the real time is over, in units of what is left."""
        before = [progress for at, progress in self.told if at <= share * self.now]
        return before[-1].left / ((1 - share) * self.now)


STAGES = [stage for part in PARTS for stage in COSTS[part]]


@settings(max_examples=30, deadline=None)
@given(st.fixed_dictionaries({stage: st.floats(1 / 3, 3) for stage in STAGES}), st.integers(1, 150), st.integers(0, 2))
def test_the_share_never_falls_and_the_time_left_grows_by_no_more_than_a_tenth(factors, frames, trials):
    job = Simulated(frames, factors, trials / 2).encode()
    for _ in range(trials):
        job.stages.again()
        job.stages.expect(*PARTS)
        job.encode()
    assert all(before.share <= after.share <= 1 for (_, before), (_, after) in pairwise(job.told))
    least = float("inf")
    for left in [progress.left for _, progress in job.told if progress.left is not None]:
        assert left <= GROWTH * least + 1e-9
        least = min(least, left)
    if not trials:
        assert job.told[-1][1].share == pytest.approx(1) and least == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("speed", [1 / 3, 1, 3])
def test_at_half_of_the_time_another_machine_is_known(speed):
    job = Simulated(200, dict.fromkeys(STAGES, speed)).encode()
    assert job.left_at(0.5) == pytest.approx(1, abs=0.25) and job.left_at(0.9) == pytest.approx(1, abs=0.25)


def test_frames_of_an_earlier_run_count_at_once_and_take_no_time():
    job = Simulated(200, dict.fromkeys(STAGES, 1.0)).encode(start=160)
    assert job.told[0][1].share > 0.5 and job.left_at(0.5) == pytest.approx(1, abs=0.25)


def test_an_encode_tells_of_each_frame_that_it_tracks(tmp_path):
    told = dict[str, list[int]]()
    options, shares = replace(quick(), scene=None), list[float]()

    def look(now: Progress) -> None:
        told.setdefault(now.stage, []).append(now.done)
        shares.append(now.share)

    Encoder(sliding_sphere(6, levels=2), progress=look).encode(tmp_path / "a.reel", options)
    assert told["survey"] == [1, 2, 3, 4, 5, 6] and told["measure"][-1] == 6
    assert all(counts == sorted(counts) and counts[-1] == 6 for counts in told.values())
    assert told["track"][:5] == [1, 2, 3, 4, 5]
    assert shares == sorted(shares) and len(set(shares)) > 20 and shares[-1] == 1


def test_a_callback_may_read_frames_and_encode(tmp_path):
    """Neither waits for the encode that it hears of."""
    balls, inner, outer = sliding_sphere(4, levels=2), tmp_path / "inner.reel", tmp_path / "outer.reel"

    def look(now: Progress) -> None:
        work.count("frames read")
        if now.stage == "fit" and not inner.exists():
            Encoder(balls, jobs=2).encode(inner, replace(quick(), scene=None))

    Encoder(balls, progress=look, jobs=2).encode(outer, replace(quick(), scene=None))
    assert inner.read_bytes() == outer.read_bytes()


def test_a_survey_alone_ends_with_all_of_it_done(tmp_path):
    told = list[Progress]()
    Encoder(sliding_sphere(4, levels=1), progress=told.append).survey(tmp_path / "a.survey")
    assert (told[-1].share, told[-1].left) == (1, 0) and told[-2].share == pytest.approx(1)
