"""Encoding to a target: the search as arithmetic, and files that meet what was asked for."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import meshreel
from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.encoder.file.summary import GroupSummary, SceneSummary, Summary
from meshreel.encoder.group.forms import Fidelity
from meshreel.encoder.rate_control import TRIALS, Goal, Search, encode_to
from meshreel.encoder.sequence import Encoder
from meshreel.errors import InputError
from meshreel.format.layout import Form
from meshreel.metrics.comparison import ComparisonOptions, compare_sequences
from meshreel.types import MeshList
from tests.small_options import quick, with_method


def searched(goal: Goal, curve: Callable[[float], float]) -> tuple[float | None, int]:
    """The quality at which a curve meets the goal, None where there is none, and how often it was asked."""
    search = Search(goal)
    for trial in range(TRIALS):
        quality = search.next()
        if quality is None:
            return None, trial
        assert 0 <= quality <= 100
        assert quality == float(f"{quality:.4g}")  # so that what the file records is what was tried
        if abs(curve(quality) - goal.wanted) <= goal.tolerance:
            return quality, trial + 1
        search.learn(quality, curve(quality))
    return None, TRIALS


@given(st.floats(40, 60), st.floats(0.05, 0.5), st.floats(-0.001, 0.001), st.floats(0, 100))
def test_a_psnr_on_a_rising_curve_is_found(least: float, slope: float, bend: float, at: float) -> None:
    def curve(quality: float) -> float:
        return least + slope * quality + bend * slope * quality * (100 - quality)

    found, trials = searched(Goal(psnr=curve(at)), curve)
    assert found is not None and abs(curve(found) - curve(at)) <= 0.3
    assert trials <= TRIALS


@given(st.floats(0.01, 1), st.floats(10, 60), st.floats(0, 100))
def test_a_rate_on_an_exponential_curve_is_found(least: float, doubling: float, at: float) -> None:
    def rate(quality: float) -> float:
        return least * 2 ** (quality / doubling)

    found, _ = searched(Goal(mbps=rate(at)), lambda quality: math.log(rate(quality)))
    assert found is not None and abs(rate(found) / rate(at) - 1) <= 0.05


@given(st.floats(40, 60), st.floats(0.05, 0.5), st.sampled_from([-1.0, 1.0]))
def test_what_no_quality_gives_is_known_after_few_trials(least: float, slope: float, side: float) -> None:
    out = least - 1 if side < 0 else least + 100 * slope + 1
    found, trials = searched(Goal(psnr=out), lambda quality: least + slope * quality)
    assert found is None and trials <= 4


def test_a_step_over_the_goal_ends_the_search() -> None:
    assert searched(Goal(psnr=50), lambda quality: 40.0 if quality < 33 else 60.0)[0] is None


@pytest.mark.parametrize(
    ("wanted", "said"),
    [({}, "give one of them"), ({"psnr": 60.0, "mbps": 1.0}, "give one of them"), ({"psnr": -1.0}, "-1 dB"),
     ({"mbps": 0.0}, "0 Mbps"), ({"mbps": math.inf}, "inf Mbps"), ({"psnr": math.nan}, "nan dB")],
)  # fmt: skip
def test_targets_that_mean_nothing_are_refused(wanted: dict[str, float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Goal(**wanted)


def test_a_file_is_measured_in_the_unit_of_the_goal() -> None:
    groups = tuple(GroupSummary(Form.DRACO, n, 10, Fidelity(0, 0, 0, psnr)) for n, psnr in ((1, 50.0), (3, 70.0)))
    summary = Summary(1000, groups)
    assert Goal(psnr=60).measured(summary, 25.0) == 65.0
    assert math.exp(Goal(mbps=1).measured(summary, 25.0)) == pytest.approx(1000 * 8 * 25 / 4 / 1e6)


def test_a_background_alone_can_exceed_a_target_rate_but_no_target_psnr() -> None:
    groups = (GroupSummary(Form.EMPTY, 10, 4, Fidelity(0, 0, 0)),)
    summary = Summary(6000, groups, scene=SceneSummary(5000, 100, 0.001, 60.0, (0, 1), 1, 0.0))
    assert "5000 bytes, 0.1 Mbps over 0.4 s" in Goal(mbps=0.09).exceeded_by_background(summary, 25.0)
    assert Goal(mbps=0.1).exceeded_by_background(summary, 25.0) == ""
    assert Goal(psnr=90.0).exceeded_by_background(summary, 25.0) == ""
    assert Goal(mbps=0.01).exceeded_by_background(replace(summary, scene=None), 25.0) == ""


BODY = MeshList(tuple(soft_bodies(SoftBodiesOptions(frames=2, people=1, spacing=0.06))))


def options_at(quality: float) -> meshreel.EncoderOptions:
    """No per-frame form: quick, and a smooth curve."""
    options = quick(quality=quality)
    return with_method(options, intra=replace(options.method.intra, fractions=()))


def test_a_file_meets_the_psnr_that_was_asked_for(tmp_path) -> None:
    summary, quality = encode_to(Encoder(BODY), tmp_path / "a.reel", Goal(psnr=58.5), options_at)
    row = compare_sequences(BODY, meshreel.open(tmp_path / "a.reel"), ComparisonOptions(ssim=False)).to_row()
    assert abs(row["d2_psnr_paper"] - 58.5) <= 0.3
    with meshreel.open(tmp_path / "a.reel") as video:
        assert video.reader.metadata["quality"] == quality
    assert [path.name for path in tmp_path.iterdir()] == ["a.reel"]
    assert summary.size == (tmp_path / "a.reel").stat().st_size


def test_a_path_that_cannot_be_written_is_refused_before_anything_is_coded(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("meshreel.encoder.rate_control.Encoder.encode", lambda *_: pytest.fail("coded"))
    for path in (tmp_path, tmp_path / "none" / "a.reel"):
        with pytest.raises(InputError, match=f"{path}: "):
            encode_to(Encoder(BODY), path, Goal(psnr=58.5), options_at)
