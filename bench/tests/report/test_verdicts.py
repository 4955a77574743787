"""Verdicts: what rows say of each kind of promise."""

from dataclasses import replace

import msgspec
import pytest
from meshreel_bench.experiments import study
from meshreel_bench.experiments.study import D2, MASKED, Always, Bound, Gains, Reaches, Rises, Study, Which
from meshreel_bench.report.verdicts import verdicts
from meshreel_bench.rows import Point

from bench.tests.made_up import floor, row

BEST = [row("ball", "best", rate, 60 + 5 * rate) for rate in (0.5, 1.0, 2.0)]
DRACO = [row("ball", "draco", rate, 50 + 4 * rate) for rate in (2.0, 4.0, 8.0)]
ROWS = [*BEST, *DRACO]


def judged(promise, rows=ROWS):
    return verdicts(Study("made up", (), (), promises=(promise,)), rows)


def test_of_the_points_that_keep_all_bounds_the_cheapest_is_shown_or_the_nearest_where_none_does():
    bounds = (Bound("mbps", 3.0, "Mbps", least=False), Bound("d2_psnr_paper", 64.0, "dB"))
    [found] = judged(Reaches("cheap and good", Which("ball", "best"), bounds))
    assert found.met and found.value == "1 Mbps, 65 dB at quality 1" and found.bound == "<= 3 Mbps, >= 64 dB"
    [found] = judged(Reaches("too good", Which("ball", "best"), (Bound("d2_psnr_paper", 80.0, "dB"),)))
    assert found.met is False and found.value == "70 dB (short) at quality 2" and found.word == "MISSED"


def test_a_bound_may_be_relative_to_the_noise_floor():
    promise = Reaches("beyond the input", Which("ball", "best"), (Bound("d2_psnr_paper", 1.0, "dB", over_floor=True),))
    assert judged(promise)[0].met is None
    assert judged(promise, [*ROWS, floor("ball", d2_psnr_paper=68.0)])[0].met is True
    assert judged(promise, [*ROWS, floor("ball", d2_psnr_paper=69.5)])[0].met is False


def test_every_point_has_to_keep_a_bound_and_the_worst_is_shown():
    [found] = judged(Always("good", Which("", "best"), Bound("d2_psnr_paper", 63.0, "dB")))
    assert found.met is False and found.value == "62.5 dB at quality 0.5, ball; 1 of 3 points miss it"
    assert judged(Always("good", Which("", "best"), Bound("d2_psnr_paper", 62.0, "dB")))[0].met is True


def test_a_gain_is_the_rate_against_the_hull_by_every_measure():
    end = Bound("d2_psnr_paper", 69.0, "dB")
    rate, past = judged(Gains("ball", "best", ("draco",), (D2, MASKED), -50.0, ends_past=end))
    assert rate.met and "D2, paper form -" in rate.value and past.met
    assert judged(Gains("ball", "best", ("draco",), (D2,), -99.9))[0].met is False
    assert judged(Gains("cube", "best", ("draco",), (D2,), -50.0))[0].word == "not measured"


def test_the_least_rate_is_needed_on_every_sequence():
    promise = study.LeastRate("best", (D2, MASKED))
    [found] = judged(promise)
    assert found.met and found.value.startswith("in 2 of 2 comparisons") and "past its best point" in found.value
    worse = [row("cube", "best", rate, 50 + rate) for rate in (1.0, 2.0)]
    better = [row("cube", "draco", rate, 55 + rate) for rate in (0.5, 1.0)]
    assert [each.met for each in judged(promise, [*ROWS, *worse, *better])] == [True, False]
    noise = [*worse, *better, floor("cube", ssim_masked=0.54)]
    [found] = judged(promise, noise)
    lost = "not draco (D2, paper form); not draco (masked SSIM, which is beyond that of the truth itself)"
    assert lost in found.value


def test_quality_rises_with_rate_or_the_fall_is_shown():
    assert judged(Rises("best", D2))[0].met
    [found] = judged(Rises("best", D2), [*BEST, row("ball", "best", 3.0, 61.0)])
    assert found.met is False and found.value == "ball: 70 dB and 61 dB"


@pytest.mark.parametrize(("peak", "met"), [(105.0, True), (130.0, False)])
def test_memory_is_flat_where_more_frames_need_no_more(peak, met):
    few, many = (msgspec.structs.replace(BEST[0], point=Point("ball", "best", frames=n), frames=n) for n in (20, 60))
    many = msgspec.structs.replace(many, encoding=msgspec.structs.replace(many.encoding, peak_rss_mb=peak))
    assert judged(study.Flat(Which("ball", "best")), [few, many])[0].met is met


def test_a_value_is_compared_with_the_sum_of_others():
    parts = (Which("ball", "best", {"quality": 0.5}), Which("ball", "best", {"quality": 1.0}))
    promise = study.NoMore("two in one", Which("ball", "best", {"quality": 2.0}), "mbps", 1.2, parts)
    [found] = judged(promise)
    assert found.met is False and found.value == "2 against 1.5: 1.33 times" and found.bound == "<= 1.2 times"
    assert judged(replace(promise, factor=1.4))[0].met is True
    assert judged(promise, BEST[1:])[0].word == "not measured"


def test_a_rate_for_a_quality_is_that_of_the_curve():
    low, high = (row("ball", "best", rate, db) for rate, db in ((1.0, 50.0), (4.0, 60.0)))
    promise = study.Needs("cheap", Which("ball", "best"), Bound("d2_psnr_paper", 55.0, "dB"), "mbps", 2.1, aim="1")
    [found] = judged(promise, [low, high])
    assert found.met is True and found.value == "2 Mbps" and found.bound == ">= 55 dB at <= 2.1 Mbps (aim 1)"
    assert judged(replace(promise, most=1.9), [low, high])[0].met is False
    assert judged(replace(promise, bound=Bound("d2_psnr_paper", 61.0)), [low, high])[0].met is False
    others = [row("ball", "other", 40.0, 55.0), row("ball", "other", 50.0, 70.0)]
    [share] = judged(replace(promise, most=0.06, than=Which("ball", "other")), [low, high, *others])
    assert share.met is True and share.value == "2 Mbps against 40: 5 %"
    assert judged(promise, others)[0].word == "not measured"


def test_what_no_row_decides_is_not_measured():
    promises = (
        Reaches("a", Which("ball", "best"), (Bound("mbps", 1.0),)),
        Always("b", Which("ball", "best"), Bound("mbps", 1.0)),
        Rises("best", D2),
        study.Flat(Which("ball", "best")),
    )
    assert [found.word for found in verdicts(Study("made up", (), (), promises=promises), [])] == ["not measured"] * 4
