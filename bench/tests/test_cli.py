"""`meshreel bench`: rows into a file, and from the file a report."""

from __future__ import annotations

import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import trimesh
from meshreel_bench.cli import describe
from meshreel_bench.experiments import targets
from meshreel_bench.rows import Point
from meshreel_bench.scene_rows import FLOOR, MEMORY, SCENE, SEGMENTATION
from meshreel_bench.study import Study, Sweep

from bench.tests.report_rows import failed as failed_row
from bench.tests.report_rows import pictured, row
from meshreel.capture.procedural import sliding_sphere
from tests.cli.conftest import failed

BALL = sliding_sphere(1, levels=1)[0]


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
    monkeypatch.setattr("meshreel_bench.cli.find_experiment", lambda _: chosen)
    monkeypatch.setattr("meshreel_bench.cli.EXPERIMENTS", {"tiny": chosen})
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
    assert run("bench", "run", "tiny", "-o", rows, "--data", tiny, "--no-ssim", "--quiet").err == ""
    assert failed(
        run("bench", "run", "tiny", "-o", rows, "--data", tiny), "was measured without pictures; say --no-ssim"
    )


def test_only_some_codecs_may_be_run(run, tiny):
    said = run("bench", "run", "tiny", "-o", tiny / "r.jsonl", "--data", tiny, "--no-ssim", "--json", "--only", "draco")
    assert said.row["rows"] == 1


@pytest.fixture
def study(tmp_path, monkeypatch):
    """An experiment of the paper's kind that has one point, and a user's sequence beside its own; where these are."""
    balls = sliding_sphere(2, levels=2)
    for name in ("own", "ball"):
        np.savez(tmp_path / f"{name}.npz", vertices=np.stack([mesh.vertices for mesh in balls]), faces=balls[0].faces)
    chosen = Study(sequences=("ball",), sweeps=(Sweep("draco", {"qp": (7,)}),))
    monkeypatch.setattr("meshreel_bench.cli.find_experiment", lambda _: chosen)
    monkeypatch.setattr("meshreel_bench.cli.EXPERIMENTS", {"figure6": chosen})
    return tmp_path


def test_an_experiment_takes_a_sequence_and_operating_points_more(run, study):
    rows, added = study / "r.jsonl", ("draco:qp=9", "decimated_draco:fraction=0.5,qp=8", "draco")
    plain = ("bench", "run", "figure6", "-o", rows, "--data", study, "--no-ssim")
    said = run(*plain, "--add", *added, "--on", "own", "--json")
    assert said.code == 0 and said.row["rows"] == 4
    found = [json.loads(line) for line in rows.read_text().splitlines()]
    assert {row["sequence"] for row in found} == {"own"}
    assert [row["options"].get("fraction") for row in found] == [None, None, 0.5, None]
    by_path = run(*plain, "--on", study / "own.npz", "--only", "draco")
    assert by_path.code == 0 and len(rows.read_text().splitlines()) == 5
    report = run("bench", "report", rows, "-o", study / "out", "--json")
    assert report.code == 0 and len({Path(path).name for path in report.row["files"]}) == len(report.row["files"])
    assert all(Path(path).is_relative_to(study / "out") for path in report.row["files"])


def test_a_path_is_a_path_and_its_rows_are_of_its_content(run, study, monkeypatch):
    """A folder `ball` of one's own is not the `ball` that the benchmark has, and what changes is another sequence."""
    mine = study / "mine"
    (mine / "ball").mkdir(parents=True)
    for number, mesh in enumerate(sliding_sphere(2, levels=1)):
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(mine / "ball" / f"f_{number}.obj")
    monkeypatch.chdir(mine)
    rows, common = mine / "r.jsonl", ("--data", study, "--no-ssim", "--quiet", "--on")
    for name in ("./ball", "./ball/f_*.obj"):
        assert run("bench", "run", "figure6", "-o", rows, *common, name, "--fps", "10").code == 0
    found = [json.loads(line) for line in rows.read_text().splitlines()]
    assert [row["frame_rate"] for row in found] == [10, 10] and found[0]["bytes"] == found[1]["bytes"]
    assert run("bench", "run", "figure6", "-o", rows, *common, "ball").code == 0
    assert json.loads(rows.read_text().splitlines()[-1])["bytes"] > found[0]["bytes"]  # finer
    again = ("bench", "run", "figure6", "-o", rows, *common, "./ball", "--fps")
    assert "measured of another sequence, frames, scale or rate" in run(*again, "20").err
    (mine / "ball" / "f_1.obj").write_text((mine / "ball" / "f_0.obj").read_text())
    assert "give another file for the rows" in run(*again, "10").err
    assert "'./none' at that path or below" in run("bench", "run", "figure6", "-o", rows, *common, "./none").err


def test_a_sequence_without_surface_fails_and_others_go_on(run, study):
    np.savez(study / "point.npz", vertices=[0 * BALL.vertices], faces=BALL.faces)
    common = ("-o", study / "r.jsonl", "--data", study, "--no-ssim", "--json")
    for _ in range(2):
        said = run("bench", "run", "figure6", *common, "--on", "point", "ball")
        assert said.code == 0 and said.row["failed"] == 1 and "no frame has a face with an area" in said.err


def test_rows_of_two_sequences_by_one_name_make_no_report(run, tmp_path):
    for name, source in (("a", "1f"), ("b", "2e")):
        made = row("ball", "draco", 1.0, 60.0, experiment="figure6", source=source)
        (tmp_path / f"{name}.jsonl").write_text(json.dumps(made) + "\n")
    said = run("bench", "report", tmp_path / "a.jsonl", tmp_path / "b.jsonl", "-o", tmp_path / "out")
    assert failed(said, "rows of ball are of sequences of different content", "make a report of each")
    assert not (tmp_path / "out").exists()


def test_how_files_are_read_is_about_own_sequences(run, study, monkeypatch):
    monkeypatch.setattr("meshreel_bench.cli.own_digest", lambda *_: None)
    said = run("bench", "run", "figure6", "-o", study / "r.jsonl", "--data", study, "--scale", "0.001")
    assert "the benchmark's sequences are what they are" in said.err


@pytest.mark.parametrize(
    ("point", "told"),
    [("zipmesh", "zipmesh"), ("draco:qp", "option=value"), ("draco:=3", "option=value"), ("draco:size=3", "size")],
)
def test_operating_points_that_are_none_are_told(run, study, point, told):
    said = run("bench", "run", "figure6", "-o", study / "r.jsonl", "--data", study, "--add", point)
    assert failed(said, point.split(":")[0], told) and not (study / "r.jsonl").exists()


def test_a_sequence_that_is_not_there_and_points_for_another_experiment_are_told(run, study, monkeypatch):
    said = run("bench", "run", "figure6", "-o", study / "r.jsonl", "--data", study, "--on", "nobody")
    assert failed(said, "nobody", "--data")
    monkeypatch.setattr("meshreel_bench.cli.find_experiment", lambda _: targets)
    said = run("bench", "run", "targets", "-o", study / "r.jsonl", "--data", study, "--add", "draco")
    assert failed(said, "--add draco", "figure6")


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


def test_a_row_is_one_line_whatever_is_in_it():
    row = {"sequence": "a\nb", "codec": "\x1b[31mx", "options": {}, "kind": "curve"}
    assert describe(row | {"failed": "1\r\n2"}) == "a b ?[31mx : failed: 1 2"
    told = "0.500 Mbps, no dB, 1.00 degrees, no s/frame; no pictures: full"
    assert describe(row | {"mbps": 0.5, "d2_psnr_paper": None, "normal_error_deg": 1.0, "unpictured": "full"}).endswith(
        told
    )


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
    assert failed(said, "--only nothing", "no such points; it has captured, meshreel, segmentation")
    said = run("bench", "run", "figure6", "-o", tmp_path / "r.jsonl", "--on", "room3", "demo", "--small")
    assert failed(said, "--on room3", "it has demo")
    assert failed(run("bench", "report", tmp_path / "none.jsonl", "-o", tmp_path), "none.jsonl", "bench run")


def test_a_report_is_not_replaced_by_one_of_nothing(run, tmp_path):
    rows, report = tmp_path / "rows.jsonl", tmp_path / "results.md"
    report.write_text("of before")
    rows.write_text("")
    assert failed(run("bench", "report", rows, "-o", tmp_path), "rows.jsonl: has no rows", "bench run")
    rows.write_text(
        '{"point": "", "kind": "curve", "sequence": "", "codec": "", "options": {}, "failed": "", "experiment": "x"}\n'
    )
    assert failed(run("bench", "report", rows, "-o", tmp_path), "line 1: no experiment is called 'x'; known: figure6")
    assert report.read_text() == "of before"
