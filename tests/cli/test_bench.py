"""`meshreel bench`: rows into a file, and from the file a report."""

from __future__ import annotations

import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from meshreel.capture.procedural import sliding_sphere
from meshreel.cli.bench import describe
from meshreel.evaluation.experiments import targets
from meshreel.evaluation.rows import Point
from meshreel.evaluation.scene_rows import FLOOR, MEMORY, SCENE, SEGMENTATION
from tests.cli.conftest import failed
from tests.evaluation.report_rows import failed as failed_row
from tests.evaluation.report_rows import pictured, row


@pytest.fixture
def tiny(monkeypatch, tmp_path):
    """An experiment of two quick points on a ball that stands in for the dancer."""
    balls = sliding_sphere(1, levels=2)
    np.savez(tmp_path / "dancer.npz", vertices=np.stack([mesh.vertices for mesh in balls]), faces=balls[0].faces)
    points = [Point("dancer", "draco", {"qp": 9}), Point("dancer", "decimated_draco", {"levels": 1})]
    chosen = ModuleType("tiny")
    chosen.points = lambda small: points[: 1 if small else 2]
    for name in ("references", "promises", "comparisons", "shown", "sections", "COMPARISON"):
        setattr(chosen, name, getattr(targets, name))
    monkeypatch.setattr("meshreel.cli.bench.find_experiment", lambda _: chosen)
    monkeypatch.setattr("meshreel.cli.bench.EXPERIMENTS", {"tiny": chosen})
    return tmp_path


def test_a_run_writes_rows_and_goes_on_where_it_was(run, tiny):
    rows = tiny / "new" / "rows.jsonl"
    first = run("bench", "run", "tiny", "-o", rows, "--data", tiny, "--small", "--no-ssim")
    assert first.code == 0 and "dancer draco qp 9:" in first.err and "not measured" in first.out
    second = run("bench", "run", "tiny", "-o", rows, "--data", tiny, "--no-ssim", "--json")
    assert "(measured before)" in second.err.splitlines()[0]
    assert second.row["rows"] == 2 and len(second.row["promises"]) == 14
    assert len(rows.read_text().splitlines()) == 2
    said = run("bench", "report", rows, "-o", tiny / "out", "--json")
    names = ["results.md", "index.html", "tiny-dancer.png", "tiny-dancer.svg"]
    assert [Path(path).name for path in said.row["files"]] == names
    assert run("bench", "run", "tiny", "-o", rows, "--data", tiny, "--quiet").err == ""


def test_only_some_codecs_may_be_run(run, tiny):
    said = run("bench", "run", "tiny", "-o", tiny / "r.jsonl", "--data", tiny, "--no-ssim", "--json", "--only", "draco")
    assert said.row["rows"] == 1


def test_a_report_has_what_failed_and_the_pictures_beside_the_rows(run, tiny):
    rows = tiny / "some.jsonl"
    made = [
        pictured(tiny / "some.pictures", row("dancer", "draco", 1.0, 60.0)),
        failed_row("dancer", "necgs", "too slow"),
    ]
    rows.write_text("".join(json.dumps(each | {"experiment": "tiny"}) + "\n" for each in made))
    said = run("bench", "report", rows, "-o", tiny / "out", "--json")
    assert said.code == 0 and "dancer necgs qp 9: failed: too slow" in said.err
    assert "tiny-dancer-sheet.png" in [Path(path).name for path in said.row["files"]]
    assert "| too slow |" in (tiny / "out" / "results.md").read_text()


def test_rows_of_scenes_are_told_in_a_line():
    row = {"sequence": "room2", "codec": "x", "options": {}, "truth_d2_psnr_backward": 61.0, "truth_ssim_masked": 0.7}
    assert describe(row | {"kind": SCENE, "mbps": 0.5}) == "room2 x : 0.500 Mbps, to the truth 61.00 dB, SSIM 0.700"
    assert describe(row | {"kind": FLOOR}) == "room2 x : to the truth 61.00 dB, SSIM 0.700"
    assert "IoU 0.950, worst frame 0.900" in describe(row | {"kind": SEGMENTATION, "iou_mean": 0.95, "iou_worst": 0.9})
    assert "60 frames, peak 900 MB" in describe(row | {"kind": MEMORY, "frames": 60, "peak_rss_mb": 900.0})


def test_what_is_missing_is_told(run, tmp_path):
    assert failed(run("bench", "run", "nothing", "-o", tmp_path / "r.jsonl"), "known: ablation_basis, ablation_centers")
    said = run("bench", "run", "targets", "-o", tmp_path / "r.jsonl", "--data", tmp_path)
    assert failed(said, "dancer", "--data")
    assert failed(run("bench", "run", "targets", "-o", tmp_path / "r.jsonl", "--jobs", "0"), "--jobs", "0")
    for name in (".", "rows.cache", "rows.pictures"):
        said = run("bench", "run", "scenes", "-o", name)
        assert failed(said, f"--output {name}", "give a file, as rows.jsonl")
    said = run("bench", "run", "scenes", "-o", tmp_path / "r.jsonl", "--only", "nothing")
    assert failed(said, "--only nothing", "no such points")
    assert failed(run("bench", "report", tmp_path / "none.jsonl", "-o", tmp_path), "none.jsonl", "bench run")
