"""The promises of `layers` and what `ablation_stages` tells, on rows made up: kept by good ones, missed by bad ones."""

from __future__ import annotations

import json
from dataclasses import asdict

import pytest
from meshreel_bench.codecs import make_codec
from meshreel_bench.codecs.variants import VARIANTS
from meshreel_bench.experiments import EXPERIMENTS, ablation_stages, layers
from meshreel_bench.rd_rows import FLOOR as RATED_FLOOR
from meshreel_bench.rd_rows import RATED
from meshreel_bench.report import write_report
from meshreel_bench.rows import Point, join_rows
from meshreel_bench.scene_rows import FLOOR, SEGMENTATION

from meshreel.encoder.presets import PRESETS, preset_options
from meshreel.errors import InputError

BEST, A2S = f"meshreel {layers.PRESET}", "decimated_draco_subdivided"
TEN = ((10, 1000, None),)
SIXTY = tuple((10, size, None) for size in (500, 500, 500, 400, 400, 400))


def row(sequence, codec, mbps, db, groups=TEN, **changed):
    """A measured point whose every metric follows from its dB."""
    angle, ssim = (86 - db) / 5, 0.5 + (db - 30) / 90
    metrics = {"d2_psnr_paper": db, "symmetric_psnr": db, "normal_error_deg": angle, "ssim_masked": ssim}
    first = [10 * i for i in range(len(groups))]
    records = [
        {"first_frame": start, "frames": n, "form": "layers", "bytes": size}
        | ({"draco_bytes": d} if changed.get("kind") == "floor" else {})
        for start, (n, size, d) in zip(first, groups, strict=True)
    ]
    frames = sum(n for n, _, _ in groups)
    base = {
        "point": f"{sequence} {codec} {mbps} {db}",
        "kind": "quality",
        "experiment": "layers",
        "sequence": sequence,
        "codec": codec,
        "options": {"quality": db},
        "frames": frames,
        "mbps": mbps,
        "d2_psnr_paper_worst": db - 1,
        "encode_s": 3.0,
        "bridges": [0] * frames,
        "per_frame": [metrics] * frames,
        "groups": records,
    }
    return base | metrics | changed


def memory(frames, peak):
    base = {"point": f"memory {frames}", "kind": "memory", "experiment": "layers", "sequence": "collision"}
    return base | {"codec": "meshreel", "options": {}, "frames": frames, "peak_rss_mb": peak}


def decoded(**changed):
    base = {"point": "decode", "kind": "decode", "experiment": "layers", "sequence": "dancer", "codec": BEST}
    base |= {"options": {"quality": 50.0}, "frames": 10, "vertices": 16002.0, "frame_ms": 0.9, "draco_ms": 1.0}
    anchor = {"options": {}, "mbps": 0.8, "d2_psnr_paper": 64.1}
    return base | {"subdivided_ms": 3.0, "anchor": anchor} | changed


CURVE = ((0.1, 60.0), (0.19, 66.0), (0.26, 70.0), (0.6, 76.0))


def body(sequence, groups=TEN):
    """A sequence whose anchors cost five times as much as `best`."""
    own = [row(sequence, BEST, mbps, db, groups) for mbps, db in CURVE]
    return own + [row(sequence, A2S, 5 * mbps, db, kind="curve") for mbps, db in CURVE]


BACK = tuple((10, size, None) for size in (480, 480, 480, 420, 420, 420))


def backwards(sequence, groups=BACK):
    return row(sequence, BEST, 0.26, 70.0, groups, kind="backwards", point=f"{sequence} backwards")


GOOD = [
    *body("dancer"),
    *body("basketball_player"),
    *body("mitch"),
    *body("crane60", SIXTY),
    *body("samba60", SIXTY),
    backwards("crane60"),
    backwards("samba60"),
    row("collision", BEST, 0.4, 66.0, ((10, 500, None), (10, 400, 400), *SIXTY[2:]), kind="floor"),
    memory(20, 400.0),
    memory(60, 410.0),
    decoded(),
    decoded(vertices=5000.0, frame_ms=9.0, options={"quality": 5.0}),
]


def judged(rows):
    return layers.promises(rows)


def test_good_rows_keep_every_promise():
    found = judged(GOOD)
    assert [p for p in found if not p.met] == [] and len(found) == 20


def test_without_rows_nothing_is_claimed():
    assert {promise.verdict for promise in judged([])} == {"not measured"}


def changed_rows(sequence, change):
    """The good rows, but for those of `best` on one sequence."""
    kinds = (sequence, BEST, "quality")
    return [change(r) if (r["sequence"], r["codec"], r["kind"]) == kinds else r for r in GOOD]


@pytest.mark.parametrize(
    ("name", "sequence", "change"),
    [
        ("dancer: rate", "dancer", lambda r: r | {"normal_error_deg": r["normal_error_deg"] + 2.2}),
        ("basketball_player: rate", "basketball_player", lambda r: r | {"d2_psnr_paper_worst": 61.9}),
        ("mitch: rate", "mitch", lambda r: r | {"mbps": r["mbps"] + 0.02}),
        ("samba60: BD-rate", "samba60", lambda r: r | {"mbps": 1.6 * r["mbps"]}),
        ("encode", "dancer", lambda r: r | {"encode_s": 4.1}),
    ],
)
def test_one_part_that_falls_short_is_missed_alone(name, sequence, change):
    missed = [promise for promise in judged(changed_rows(sequence, change)) if promise.met is False]
    assert any(promise.text.startswith(name) for promise in missed), missed
    assert all(promise.text.startswith((name, f"{sequence}: ", f"{sequence}, ")) for promise in missed), missed


def test_a_long_sequence_must_not_cost_more_later():
    later = tuple((10, size, None) for size in (400, 400, 400, 400, 400, 401))
    rows = body("crane60", later)
    [found] = [p for p in judged(rows) if p.text.startswith("crane60: bytes of frames")]
    assert found.met is False and "1.001 at quality 60" in found.value


def test_a_half_that_moves_more_may_cost_more_but_not_for_its_place():
    moving = tuple((10, size, None) for size in (300, 300, 300, 480, 480, 480))  # 1.6 forth; back for less, or for more
    for back, value, met in ((330, "0.989", True), (340, "1.004", False)):
        groups = tuple((10, size, None) for size in (540, 540, 540, back, back, back))
        rows = [*body("crane60", moving), backwards("crane60", groups)]
        missed, found = [p for p in judged(rows) if p.text.startswith("crane60: bytes")]
        assert missed.met is False and (found.met, found.value) == (met, f"{value} at quality 70"), found


def test_a_group_that_draco_would_make_smaller_is_a_loser():
    losing = row("collision", BEST, 0.4, 66.0, ((10, 500, 499), *((10, 400, None),) * 5), kind="floor")
    [found] = [p for p in judged([losing]) if "draco` form" in p.text]
    assert (found.met, found.value) == (False, "1 of 6")


def test_decoding_is_judged_on_the_row_nearest_to_sixteen_thousand_vertices():
    for changed, verdicts in (
        ({}, ["met", "met"]),
        ({"frame_ms": 1.2}, ["met", "MISSED"]),
        ({"frame_ms": 2}, ["MISSED"] * 2),
    ):
        found = judged([decoded(**changed), decoded(vertices=5000.0)])[-2:]
        assert [promise.verdict for promise in found] == verdicts
    assert (
        "Draco, decimated, subdivided at 0.800 Mbps, 64.10 dB" in found[1].value
        and "with free subdivision 0.67" in found[1].value
    )


def test_the_page_has_every_experiment_with_its_tables(tmp_path):
    whole = [
        row("dancer", BEST, mbps, db, kind=RATED, experiment="ablation_stages", point=f"whole {db}")
        for mbps, db in CURVE
    ]
    part = [
        row("dancer", f"{BEST}, {ablation_stages.PARTS[0]}", 1.5 * mbps, db, kind=RATED, experiment="ablation_stages")
        for mbps, db in CURVE[1:3]
    ]
    written = write_report([*GOOD, *whole, *part], EXPERIMENTS, tmp_path)
    names = {path.name for path in written}
    assert {"results.md", "layers-dancer.png", "layers-crane60.png", "ablation_stages-dancer.png"} <= names
    page = (tmp_path / "results.md").read_text()
    assert page.index("# Results of `ablation_stages`") < page.index("# Results of `layers`") and "nan" not in page
    assert "symmetric D2 -80.0 % (60 dB to 76 dB, gain up to 76 dB" in page
    assert "| dancer | 60 | 10 | 0: 0.833, " in page
    assert f"| {BEST}, {ablation_stages.PARTS[0]} | +50.4 % (66 dB to 70 dB) |" in page
    assert ablation_stages.PARTS[1] not in page


def test_a_point_that_several_files_have_counts_once():
    a, b = row("dancer", BEST, 1.0, 60.0), row("dancer", BEST, 2.0, 60.0, point="other")
    assert join_rows([[a], [a | {"mbps": 9.0}, b]]) in ([a, b], [b, a])
    assert len(join_rows([[a], [a | {"experiment": "ablation_stages"}]])) == 2


@pytest.mark.parametrize("chosen", EXPERIMENTS.values(), ids=EXPERIMENTS)
def test_every_experiment_has_all_that_a_run_and_a_report_need(chosen):
    for name in ("points", "references", "promises", "comparisons", "shown", "sections"):
        assert callable(getattr(chosen, name))
    for small in (True, False):
        points = list(chosen.points(small))
        assert points and len({point.key for point in points}) == len(points)
        for point in points:
            assert point == Point(**json.loads(point.key))
            if point.kind not in (FLOOR, RATED_FLOOR, SEGMENTATION):  # of what is given, and of labels
                make_codec(point.codec, point.options)


@pytest.mark.parametrize("name", VARIANTS)
@pytest.mark.parametrize("preset", PRESETS)
def test_a_variant_changes_the_preset_and_its_curve_has_its_own_name(name, preset):
    codec, plain = (make_codec("meshreel", {"preset": preset, "variant": v}) for v in (name, None))
    assert asdict(codec.encoder_options) != asdict(plain.encoder_options) == asdict(preset_options(preset))
    assert codec.name == f"meshreel {preset}, {name}" and plain.name == f"meshreel {preset}"


def test_an_unknown_variant_is_told():
    with pytest.raises(InputError, match="known: background"):
        make_codec("meshreel", {"variant": "everything"})


def test_the_parts_of_the_ablation_are_variants():
    assert {*ablation_stages.PARTS, ablation_stages.ALONE} <= set(VARIANTS)
