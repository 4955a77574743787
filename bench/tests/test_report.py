"""Reports and promises: made of rows, and of nothing else."""

from __future__ import annotations

import json

import pytest
from meshreel_bench.experiments import experiment
from meshreel_bench.experiments.targets import LARGEST, RELEASED
from meshreel_bench.report import write_report
from meshreel_bench.rows import Point

from meshreel.errors import InputError

TARGETS = experiment("targets")


def row(sequence, codec, mbps, db, **changed):
    """A measured point; what is not given is harmless."""
    base = {
        "point": Point(sequence, codec).key,
        "kind": "quality",
        "sequence": sequence,
        "codec": codec,
        "options": {"quality": 50.0, "basis_size": None},
        "frames": 10,
        "mbps": mbps,
        "d2_psnr_paper": db,
        "d2_psnr_paper_worst": db - 1,
        "symmetric_psnr": db - 2,
        "normal_error_deg": 5.0,
        "encode_s": 7.0,
        "encode_stages_s": {"track": 2.0, "fit": 5.0},
        "decode": {"frame_ms": 20.0, "vertices": 20000.0, "peak_rss_mb": 90.0},
        "peer": {"frame_ms": 4.0, "qp": 9},
        "decode_over_peer": 5.0,
        "bridges": [0] * 10,
        "degenerate_faces": [0] * 10,
        "per_frame": [{"d2_psnr_paper": db}] * 10,
    }
    return base | changed


def memory(frames, peak):
    return {
        "point": str(frames),
        "kind": "memory",
        "sequence": "collision",
        "codec": "meshreel",
        "options": {},
        "frames": frames,
        "peak_rss_mb": peak,
    }


GOOD = [
    row("dancer", "meshreel paper", 1.5, 62.0),
    row("dancer", "meshreel paper", 0.5, 58.0, options={"quality": 20.0}),
    *(
        row("dancer", "meshreel paper m", mbps - 1, db + 1, options={"basis_size": m, "quality": 50.0})
        for m, (mbps, db) in RELEASED.items()
    ),
    row("dancer", "meshreel paper m", 7.0, 66.0, options=dict(LARGEST)),
    row("mitch", "meshreel paper", 1.5, 62.0),
    row("basketball_player", "meshreel paper", 1.5, 62.0),
    row("dancer", "decimated_draco_subdivided", 0.7, 58.0),
    row("dancer", "decimated_draco_subdivided", 3.0, 66.0),
    row("collision", "meshreel paper", 0.5, 62.0),
    memory(20, 500.0),
    memory(60, 540.0),
]


def judged(rows):
    return {promise.text: promise for promise in TARGETS.promises(rows)}


def test_good_rows_keep_every_promise():
    promises = judged(GOOD)
    assert len(promises) == 14
    assert all(promise.met for promise in promises.values()), promises


def test_without_rows_nothing_is_claimed():
    assert {promise.verdict for promise in TARGETS.promises([])} == {"not measured"}


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("dancer, m = 10", row("dancer", "meshreel paper m", 5.0, 56.0, options={"basis_size": 10, "quality": 50.0})),
        ("dancer, m = 10", row("dancer", "meshreel paper m", 5.9, 60.0, options={"basis_size": 10, "quality": 50.0})),
        ("one point", row("dancer", "meshreel paper", 1.9, 62.0)),
        ("one point", row("dancer", "meshreel paper", 1.5, 62.0, normal_error_deg=6.1)),
        ("mitch", row("mitch", "meshreel paper", 1.5, 62.0, d2_psnr_paper_worst=54.9)),
        ("bridge", row("collision", "meshreel paper", 0.5, 62.0, bridges=[0, 3, 0])),
        ("encode, dancer", row("dancer", "meshreel paper", 1.5, 62.0, encode_s=8.1)),
        ("memory", memory(60, 551.0)),
        (
            "decode",
            row(
                "dancer",
                "meshreel paper m",
                1.0,
                66.0,
                options=dict(LARGEST),
                decode={"frame_ms": 26.0, "vertices": 1.0},
            ),
        ),
    ],
)
def test_a_row_that_falls_short_is_missed(name, bad):
    same = ("sequence", "codec", "frames", "kind")
    rows = [r for r in GOOD if any(r[key] != bad[key] for key in same) or r["options"] != bad["options"]] + [bad]
    missed = [promise for promise in TARGETS.promises(rows) if promise.met is False]
    assert len(missed) == 1 and name in missed[0].text, missed


def test_the_report_is_made_of_the_rows(tmp_path):
    written = write_report(GOOD, {"targets": TARGETS}, tmp_path)
    bodies = ("dancer", "mitch", "basketball_player", "collision")
    plots = {f"targets-{name}.{kind}" for name in bodies for kind in ("png", "svg")}
    assert {path.name for path in written} == {"results.md", "index.html", *plots}
    page = (tmp_path / "results.md").read_text()
    assert "meshreel bench run targets" in page
    assert page.count("| met |") == 14 and "MISSED" not in page
    assert "BD-rate of meshreel paper against decimated_draco_subdivided: D2, paper form" in page
    assert "TSMC, released code: 2.23 Mbps 51.87 dB" in page
    assert all(
        (tmp_path / "results" / f"targets-{name}.png").read_bytes()[:4] == b"\x89PNG" for name in ("dancer", "mitch")
    )


@pytest.mark.parametrize("commits", [("1a", "1a"), ("1a", "2b"), ("1a", None)])
def test_rows_of_several_commits_are_not_mixed_without_saying_so(tmp_path, commits):
    rows = [
        row("dancer", "draco", 4.0 + place, 60.0, point=f"{place}", made_by={"meshreel": "0.1", "commit": commit})
        for place, commit in enumerate(commits)
    ]
    assert write_report(rows, {"targets": TARGETS}, tmp_path)
    told = f"Rows of more than one version: 0.1 {commits[0]}, 0.1 {commits[1] or '(installed)'}."
    assert (told in (tmp_path / "results.md").read_text()) == (commits[0] != commits[1])


def test_a_metric_that_was_not_measured_has_no_panel_and_no_number(tmp_path):
    rows = [row("dancer", "draco", 4.0, 60.0, d2_psnr_paper_worst=None, peer={}, decode_over_peer=None)]
    assert write_report(rows, {"targets": TARGETS}, tmp_path)
    assert "nan" not in (tmp_path / "results.md").read_text()


def test_points_are_told_apart_by_their_keys():
    for small in (True, False):
        keys = [point.key for point in TARGETS.points(small)]
        assert len(set(keys)) == len(keys)
        assert all(json.loads(key)["codec"] for key in keys)


def test_an_unknown_experiment_is_told():
    with pytest.raises(InputError, match="known: ablation_basis, ablation_centers"):
        experiment("all")
