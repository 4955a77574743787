"""Studies: points follow from a declaration, and promises from rows."""

from __future__ import annotations

from pathlib import Path

import pytest
from meshreel_bench import experiments
from meshreel_bench.experiments import EXPERIMENTS
from meshreel_bench.experiments.figure6_goals import goals
from meshreel_bench.published import DANCER_DRACO
from meshreel_bench.rd_rows import FLOOR, RATED, SAMPLED
from meshreel_bench.rows import Point
from meshreel_bench.study import SMALL_SEQUENCE, Study, Sweep

STUDIES = {name: study for name, study in EXPERIMENTS.items() if isinstance(study, Study)}
STUDY = Study(
    sequences=("room", "body"),
    sweeps=(
        Sweep("meshreel", {"quality": (1.0, 2.0, 3.0)}, {"preset": "best"}, {"room": {"quality": (5.0,)}}),
        Sweep("draco", {"qp": (7, 8)}, sampled=("room",), small={"qp": 4}),
        Sweep("background_once_draco", {"fraction": (0.1,), "qp": (9,)}, only=("room",)),
    ),
    best="best",
    truths=("room",),
    frames={"room": 20},
)


def row(codec, mbps, db, sequence="body", kind=RATED, **changed):
    base = {"sequence": sequence, "codec": codec, "kind": kind, "mbps": mbps, "d2_psnr_paper": db, "options": {}}
    return base | {"ssim_masked": db / 100} | changed


def test_points_follow_from_the_declaration():
    found = list(STUDY.points(False))
    assert found[0] == Point("room", "captured", {}, 20, FLOOR)
    assert found[1] == Point("room", "meshreel", {"preset": "best", "quality": 5.0}, 20, RATED)
    assert [p.options for p in found if p.codec == "draco"] == [{"qp": 7}, {"qp": 8}] * 2
    assert {p.kind for p in found if p.codec == "draco" and p.sequence == "room"} == {SAMPLED}
    assert [p.sequence for p in found if p.codec == "background_once_draco"] == ["room"]
    assert sum(p.codec == "meshreel" for p in found) == 4 and all(p.frames is None for p in found[5:])


def test_the_small_form_has_one_point_of_every_sweep_on_procedural_frames():
    assert [p.options for p in STUDY.points(True)] == [
        {"preset": "best", "quality": 2.0},
        {"qp": 4},
        {"fraction": 0.1, "qp": 9},
    ]
    assert {p.sequence for p in STUDY.points(True)} == {SMALL_SEQUENCE}


@pytest.mark.parametrize("name", STUDIES)
def test_declarations_are_short_and_every_codec_of_the_paper_is_in_the_small_form(name):
    assert STUDIES[name].COMPARISON.ssim
    path = Path(experiments.__file__).with_name(f"{name}.py")
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 60
    if name in ("figure6", "table1", "table2"):
        small = {point.codec for point in STUDIES[name].points(True)}
        assert small >= {"meshreel", "draco", "tvmc", "klt_tsdf", "necgs", "decimated_draco", "background_once_draco"}


def test_the_tables_have_no_points_but_those_of_the_figure():
    figure = {point.key for point in STUDIES["figure6"].points(False)}
    for name in ("table1", "table2"):
        assert {point.key for point in STUDIES[name].points(False)} <= figure


def test_the_promise_is_kept_only_where_the_best_is_left_of_all():
    best = [row("best", 0.5, 60), row("best", 1.0, 65)]
    other = [row("other", 1.0, 60), row("other", 2.0, 65)]
    [promise] = STUDY.promises([*best, *other])
    assert (
        promise.met and promise.value == "in 2 of 2 comparisons, 0 undecided (2 over a common range, 0 point by point)"
    )
    crossing = [row("third", 0.4, 60), row("third", 2.0, 65)]
    [promise] = STUDY.promises([*best, *other, *crossing])
    assert promise.met is False and promise.value.startswith("in 2 of 4 comparisons, 0 undecided (4 over")
    assert "; not third: D2" in promise.value and "past" not in promise.value
    flat, high = [row("best", 0.5, 60), row("best", 1.0, 60.01)], [row("high", 1.0, 59), row("high", 2.0, 70)]
    [promise] = STUDY.promises([*flat, *high])
    told = "in 2 of 2 comparisons, 0 undecided (0 over a common range, 2 point by point)"
    assert (
        promise.value
        == f"{told}; past its best point in D2, paper form: high; past its best point in masked SSIM: high"
    )
    [promise] = STUDY.promises(best)
    assert promise.met is None
    [promise] = STUDY.promises([best[0], other[1]])  # a point each is no range
    assert promise.met is None
    table = "\n".join(STUDY.comparisons([*best, *other]))
    assert "| best against | rate at equal D2, paper form ↓" in table
    assert "| other | -50.0 % (60 dB to 65 dB) | -50.0 % (0.6 to 0.65) |" in table


def test_an_anchor_is_what_others_are_compared_with():
    study = Study(sequences=("body",), sweeps=(), anchor="whole", notes=("A note.",))
    rows = [row("whole", 0.5, 60), row("whole", 1.0, 65), row("part", 1.0, 60), row("part", 2.0, 65)]
    assert study.promises(rows) == []
    table = "\n".join(study.comparisons(rows))
    assert "| against whole | rate at equal D2" in table and "| part | +100.0 % (60 dB to 65 dB) |" in table
    assert "A note." in list(study.sections(rows))


def test_what_is_declared_and_not_measured_is_told():
    points = list(STUDY.points(False))
    found = "\n".join(STUDY.sections([{"point": points[0].key, "sequence": points[0].sequence}]))
    left = sum(point.sequence == points[0].sequence for point in points) - 1
    assert f"Declared and not measured: {points[0].sequence} ({left} points), body (" in found
    assert "Declared" not in "\n".join(STUDY.sections([{"point": "?", "sequence": "mine"}]))


def test_the_floor_is_what_the_truth_reaches():
    floor = row("noise floor", 0.0, 57.5, "room", FLOOR)
    assert STUDY.floors([floor, row("best", 1.0, 60, "room")]) == {"d2_psnr_paper": 57.5, "ssim_masked": 0.575}
    assert STUDY.floors([row("best", 1.0, 60, "room")]) == {}


def test_the_goals_of_figure_6_say_what_falls_short():
    draco = [row("draco", mbps, 60, "dancer", options={"qp": qp}) for qp, mbps in DANCER_DRACO.items()]
    tvmc = [row("tvmc", 10.0, 66, "synthetic4"), row("tvmc", 20.0, 69, "synthetic4")]
    kept = goals([*draco, *tvmc])
    assert [p.met for p in kept] == [True, True, True, None, None]
    assert kept[1].value == "20.00 Mbps at 69.00 dB"
    draco[0] = draco[0] | {"mbps": 1.03 * draco[0]["mbps"]}
    missed = goals([*draco, *[r | {"mbps": 26.0 + r["mbps"]} for r in tvmc]])
    assert [p.met for p in missed] == [False, False, True, None, None] and "qp 7: +3.0 %" in missed[0].value
    falling = goals([row("klt_tsdf", 1.0, 60), row("klt_tsdf", 2.0, 59)])[3]
    assert falling.met is False and falling.value == "body: 60.00 and 59.00 dB"
    assert all(p.met is None for p in goals([]))
    near, far = (row("necgs", 1.0, 50) | {"hausdorff95_backward_percent": percent} for percent in (1.5, 20.5))
    assert goals([near])[4].met and goals([near, far])[4].value == "body at 1 Mbps: 20 %"


def test_a_table_has_each_codec_near_the_common_point():
    rows = [row("best", 1.0, 63), row("best", 2.0, 66), row("draco", 9.0, 64), row("other", 0.5, 40)]
    by_rate, by_quality = (
        "\n".join(Study(sequences=("body",), sweeps=(), common=common).sections(rows))
        for common in (("mbps", 1.0), ("d2_psnr_paper", 63.5))
    )
    assert "## Near 1 Mbps" in by_rate and "| draco † | 9 |" in by_rate
    assert "## Near 63.5 dB" in by_quality and "| best | **1** |" in by_quality and "| draco | *9* |" in by_quality
    assert "| other † | 0.5 |" in by_quality and "within 1 dB" in by_quality
