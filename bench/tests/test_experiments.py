"""Experiments: what their declarations mean."""

from pathlib import Path

import pytest
from meshreel_bench.codecs import make_codec
from meshreel_bench.experiments import EXPERIMENTS, layers
from meshreel_bench.experiments.study import INSTEAD, Gains
from meshreel_bench.rows import read_rows

RESULTS = Path(__file__).resolve().parents[2] / "docs" / "results"


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_point_is_declared_once_and_its_codec_takes_its_options(name):
    for small in (False, True):
        points = list(EXPERIMENTS[name].points(small))
        assert (points or name in ("tracker", "headset")) and len({point.key for point in points}) == len(points)
        for point in points:
            if point.codec not in INSTEAD:
                make_codec(point.codec, dict(point.options))


def test_every_row_that_is_shown_is_of_a_point_that_an_experiment_declares():
    for file in sorted(RESULTS.glob("*.jsonl")):
        declared = {point.key for point in EXPERIMENTS[file.stem].points()}
        assert [row.point.key for row in read_rows(file) if row.point.key not in declared] == []


def test_tables_share_the_points_of_figure_6():
    points = {name: {point.key for point in EXPERIMENTS[name].points()} for name in ("figure6", "table1", "table2")}
    assert points["table1"] < points["figure6"] and points["table2"] < points["figure6"]


def test_promises_of_speed_are_about_points_that_are_declared():
    declared = list(layers.SPEED.points())
    for promise in [each for each in layers.SPEED.promises if not isinstance(each, Gains)]:
        for which in (promise.which, *getattr(promise, "than", ())):
            fits = [p for p in declared if p.sequence == which.sequence and p.options.items() >= which.options.items()]
            assert any(make_codec(p.codec, dict(p.options)).name == which.curve for p in fits), which
