"""The command `meshreel-bench`: rows into a file, and from the file a report."""

import dataclasses
import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from meshreel_bench.cli import describe, main, make_app, operating_point
from meshreel_bench.codecs.draco import DracoCodec
from meshreel_bench.measure import digests
from meshreel_bench.rows import append_row, read_rows
from msgspec.structs import replace

from bench.tests.made_up import failed, row
from meshreel.errors import InputError
from meshreel.geometry.cameras import pack_cameras
from meshreel.io.write import write_mesh
from meshreel.metrics.viewpoints import Box, ViewOptions, views_around
from meshreel.types import Texture
from tests.capture.recordings.test_scenehub4d import LENS, of_each, scene
from tests.capture.test_clouds import POINTS, ply
from tests.spheres import sliding_sphere

PAGE = Path(__file__).resolve().parents[2] / "docs" / "codecs.md"


@pytest.fixture
def bench(capsys):
    """Run a command line in this process; return its exit code, its JSON or text, and what it says beside it."""

    def call(*arguments):
        code = main([str(argument) for argument in arguments])
        said = capsys.readouterr()
        return code, json.loads(said.out) if "--json" in arguments and code == 0 else said.out, said.err

    return call


@pytest.fixture
def data(tmp_path):
    """A folder with a user's sequence."""
    balls = sliding_sphere(2, levels=1)
    np.savez(tmp_path / "own.npz", vertices=np.stack([mesh.vertices for mesh in balls]), faces=balls[0].faces)
    return tmp_path


def test_data_of_the_papers_authors_are_read_as_they_release_them(bench, tmp_path):
    """Textured meshes and cameras, one a file."""
    places = views_around(Box.of(sliding_sphere(1, levels=1)), ViewOptions(width=90, height=160))
    for name in ("answering", "synthetic"):
        (tmp_path / name / "meshes").mkdir(parents=True)
        for number, mesh in enumerate(sliding_sphere(2, levels=1)):
            uv = np.zeros((len(mesh.faces), 3, 2), np.float32)
            textured = dataclasses.replace(mesh, uv=uv, texture=Texture.of(np.full((4, 4, 3), 90, np.uint8)))
            write_mesh(textured, tmp_path / name / "meshes" / f"mesh_{number:02}.obj")
        for number, place in enumerate(places):
            (tmp_path / name / f"view_{number:02}.json").write_bytes(pack_cameras([place]))
    rows = tmp_path / "rows.jsonl"
    code, found, said = bench("run", "table1", "-o", rows, "--data", tmp_path, "--only", "draco", "--json")
    assert code == 0 and found["failed"] == 0 and found["rows"] == 10 and "answering draco qp 6 level 7: " in said
    known = {(one.point.sequence, one.metrics["ssim_masked"] > 0.5) for one in read_rows(rows)}
    assert known == {("answering", True), ("synthetic", True)}


def test_data_that_the_paper_took_are_read_as_they_are_published(bench, tmp_path):
    """Recordings of four cameras, and coloured point clouds."""
    scene(tmp_path / "arena", of_each(LENS), 2)
    (tmp_path / "drinking").mkdir()
    for number in range(2):
        ply(tmp_path / "drinking" / f"{number}.ply", POINTS + [0.1 * number, 0, 0])
    rows = tmp_path / "rows.jsonl"
    code, found, _ = bench("run", "table1", "-o", rows, "--data", tmp_path, "--only", "draco", "--no-ssim", "--json")
    assert code == 0 and found["failed"] == 0 and found["rows"] == 10
    known = {(one.point.sequence, one.metrics["d2_psnr_paper"] > 40) for one in read_rows(rows)}
    assert known == {("arena", True), ("drinking", True)}


def test_operating_points_on_a_users_sequence_are_measured_once_and_reported(bench, data):
    rows = data / "rows.jsonl"
    chosen = ("--on", "own", "--only", "draco", "--add", "draco:qp=12", "--no-ssim", "--json")
    run = ("run", "figure6", "-o", rows, "--data", data, *chosen)
    code, first, said = bench(*run)
    assert code == 0 and first["rows"] == 6 and first["failed"] == 0 and "own draco qp 12 level 7: " in said
    code, _, said = bench(*run)
    assert code == 0 and said.count("(measured before)") == 6 and len(rows.read_text().splitlines()) == 6
    code, found, _ = bench("report", rows, "-o", data / "out", "--json")
    assert code == 0 and [Path(path).name for path in found["files"]][:2] == ["results.md", "appendix-figure6.md"]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("run", "figure7", "-o", "r.jsonl"), "no experiment is called 'figure7'; known: ablation_centers"),
        (("run", "table2", "-o", "r.jsonl", "--only", "zip"), "table2 has no points of zip"),
        (("run", "table2", "-o", "r.cache"), "give a file, as rows.jsonl"),
        (("run", "table2", "-o", "r.jsonl", "--jobs", "0"), "give at least 1"),
        (("run", "table2", "-o", "r.jsonl", "--add", "draco:7"), "'7' is no option=value"),
        (("run", "table2", "-o", "r.jsonl", "--data", "nowhere", "--only", "draco"), "no sequence 'dancer' below"),
        (("report", "none.jsonl", "-o", "out"), "cannot be read"),
    ],
)
def test_what_cannot_be_done_is_refused_in_a_line(bench, tmp_path, monkeypatch, arguments, reason):
    monkeypatch.chdir(tmp_path)
    code, _, said = bench(*arguments)
    assert code != 0 and reason in " ".join(said.split())


@pytest.mark.parametrize("state", ["source", "encoder", "data"])
def test_rows_of_different_states_make_no_report(bench, tmp_path, state):
    rows = [row("own", "a", rate, 60.0) for rate in (1.0, 2.0)]
    for each in (rows[0], replace(rows[1], **{state: "0123"})):
        append_row(tmp_path / "rows.jsonl", each)
    code, _, said = bench("report", tmp_path / "rows.jsonl", "-o", tmp_path / "out")
    said = " ".join(said.split())
    assert code != 0 and "rows.jsonl: rows of different states" in said and "run figure6 --stale -o" in said


def test_rows_of_one_state_make_a_report(bench, tmp_path):
    for rate in (1.0, 2.0):
        append_row(tmp_path / "rows.jsonl", replace(row("own", "a", rate, 60.0), encoder="01", data="23"))
    assert bench("report", tmp_path / "rows.jsonl", "-o", tmp_path / "out")[0] == 0


def test_only_rows_of_another_encoder_are_measured_again_where_it_is_asked_for(bench, data, monkeypatch):
    rows = data / "rows.jsonl"
    run = ("run", "figure6", "-o", rows, "--data", data, "--on", "own", "--only", "draco", "--no-ssim", "--json")
    run = (*run, "--add", "decimated_draco:fraction=0.5", "--only", "decimated_draco")
    assert bench(*run)[1]["stale"] == 0
    digests._digest.cache_clear()
    monkeypatch.setattr(DracoCodec, "encode", lambda *_: b"other bytes")
    code, found, said = bench(*run)
    assert code == 0 and found["stale"] == 5 and "5 of 10 rows are of another encoder" in " ".join(said.split())
    code, found, said = bench(*run, "--stale")
    digests._digest.cache_clear()
    assert code == 0 and found["stale"] == 0 and said.count("(measured before)") == 5
    assert len(rows.read_text().splitlines()) == 15


def test_experiments_and_codecs_are_listed(bench):
    _, found, _ = bench("list", "--json")
    assert {"experiment": "table2", "sequences": ["synthetic4", "synthetic4-crane"], "points": 72} in found[
        "experiments"
    ]
    _, found, _ = bench("codecs", "--json")
    assert found["codecs"]["tvmc"] == "meshreel-bench"


def test_the_commands_of_codecs_md_parse():
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    commands = [shlex.split(line)[1:] for line in lines if line.startswith("meshreel-bench ")]
    assert len(commands) == 3
    for tokens in commands:
        make_app().parse_args(tokens, exit_on_error=False, print_error=False)


def test_an_operating_point_is_a_codec_and_its_options_and_a_row_is_described_in_one_printable_line():
    assert operating_point("decimated_draco:fraction=0.5,qp=9") == ("decimated_draco", {"fraction": 0.5, "qp": 9})
    assert operating_point("necgs:full,seed=2") == ("necgs", {"configuration": "full", "seed": 2})
    with pytest.raises(InputError, match="does not take"):
        operating_point("draco:bits=9")
    assert describe(row("ball", "best", 1.0, 60.0)) == "ball best quality 1.0: 1.000 Mbps, 60.00 dB, 7.00 s/frame"
    assert describe(failed("ball\x1b[2J", "draco", "no\nluck")) == "ball?[2J draco qp 9: failed: no luck"
