"""Clocks: stages, work, and a fixed loop whose own time is not charged."""

import builtins
import time

import pytest
from meshreel_bench.measure import worker as clock
from meshreel_bench.measure.worker import StageTimer, cost_of, reference_s

from meshreel.geometry import work


def spin(seconds):
    """Use the processor for some time."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def test_time_goes_to_the_stage_that_reports_and_work_is_that_of_the_block():
    work.count("decimations", 5)
    with StageTimer() as timer:
        spin(0.05)
        timer("track", 1, 2)
        spin(0.02)
        timer("fit", 1, 2)
        work.count("frames fitted", 4)
    cost = cost_of([timer, timer], 2)
    assert list(cost.stages_s) == ["track", "fit"] and cost.stages_s["track"] > cost.stages_s["fit"] >= 0.02
    assert cost.s == pytest.approx(timer.seconds) and cost.s >= sum(cost.stages_s.values())
    assert cost.work == {"frames fitted": 4.0} and cost.peak_rss_mb > 10


@pytest.mark.skipif(not clock.ON_TIME, reason="this system has no timers")
def test_the_loop_runs_meanwhile_and_is_not_charged(monkeypatch):
    monkeypatch.setattr(clock, "PAUSE", 0.02)
    monkeypatch.setattr(clock, "reference_s", lambda: spin(0.1) or 0.1)
    with StageTimer() as timer:
        start = time.process_time()
        while len(timer.references) < clock.SAMPLES + 3:
            spin(0.01)
        whole = time.process_time() - start
    assert whole > 0.3 and timer.seconds < whole - 0.25
    assert cost_of([timer], 1).reference_s == pytest.approx(0.1)


def test_what_is_imported_where_it_is_needed_is_not_charged(tmp_path, monkeypatch):
    text = "import time\nend = time.process_time() + 0.2\nwhile time.process_time() < end:\n    pass\n"
    (tmp_path / "slow_to_import.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(clock, "LATE", ("slow_to_import",))
    before = builtins.__import__
    with StageTimer() as timer:
        start = time.process_time()
        __import__("slow_to_import")
        whole = time.process_time() - start
    assert whole >= 0.2 and timer.seconds < whole - 0.15 and builtins.__import__ is before


def test_the_loop_takes_a_time_that_can_be_measured():
    assert 0.002 < reference_s() < 2
