"""Network traces: the files are what the program draws, say the truth of themselves, and look like their lines."""

import re
from itertools import pairwise
from pathlib import Path
from statistics import mean

import meshreel_bench.networks
import pytest
from meshreel_bench.networks.traces import DURATION, SLOW, TRACES, as_csv, rates

FOLDER = Path(meshreel_bench.networks.__file__).parent
NAMES = sorted(TRACES)


def rows_of(text: str) -> list[tuple[float, float]]:
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert lines.pop(0) == "seconds,mbps"
    return [(float(time), float(rate)) for time, rate in (line.split(",") for line in lines)]


def longest_below(values: list[float], limit: float) -> int:
    runs = "".join("x" if value < limit else " " for value in values).split()
    return max(map(len, runs), default=0)


def test_the_folder_has_the_traces_that_are_drawn_and_no_others() -> None:
    drawn = {f"{name}.network.csv": as_csv(trace) for name, trace in TRACES.items()}
    assert {path.name: path.read_text(encoding="utf-8") for path in FOLDER.glob("*.csv")} == drawn


@pytest.mark.parametrize("name", NAMES)
def test_a_trace_has_its_mean_and_the_statistics_that_its_file_says(name: str) -> None:
    trace, text = TRACES[name], as_csv(TRACES[name])
    rows = rows_of(text)
    values = [rate for _, rate in rows]
    assert [time for time, _ in rows] == pytest.approx([step * trace.step for step in range(len(rows))])
    assert len(rows) * trace.step == pytest.approx(DURATION)
    assert mean(values) == pytest.approx(trace.mbps, rel=1e-3) == mean(rates(trace))
    said = re.search(r"mean (\S+) Mbit/s, least (\S+), most (\S+), below 1 for (\S+) %", text)
    assert said is not None
    slow = 100 * mean(value < SLOW for value in values)
    assert [float(number) for number in said.groups()] == pytest.approx(
        [mean(values), min(values), max(values), slow], rel=5e-3, abs=0.06
    )


def test_broadband_varies_from_second_to_second_and_is_never_cut_off() -> None:
    for name in ("fixed_3", "fixed_12"):
        values, mbps = rates(TRACES[name]), TRACES[name].mbps
        assert min(values) > 0.1 * mbps and max(values) < 3 * mbps
        assert 0.02 * mbps < mean(abs(after - before) for before, after in pairwise(values)) < 0.3 * mbps


def test_5g_gives_hundreds_of_megabits_and_is_cut_off_for_seconds() -> None:
    for name in ("5g_walk", "5g_drive"):
        trace, values = TRACES[name], rates(TRACES[name])
        assert max(values) > 300
        assert longest_below(values, SLOW) * trace.step >= 2
        assert 0.03 < mean(value < SLOW for value in values) < 0.25
