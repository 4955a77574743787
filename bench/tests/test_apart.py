"""Who crashes, hangs or decodes nonsense: a row that says so, and the sweep goes on."""

from __future__ import annotations

import json
import os
import time
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from meshreel_bench import provenance
from meshreel_bench.bench import Bench
from meshreel_bench.codec import Codec
from meshreel_bench.codecs import make_codec
from meshreel_bench.measure import run_point
from meshreel_bench.rd_rows import RATED
from meshreel_bench.row_form import FAILED
from meshreel_bench.rows import Point, failed_rows, join_rows, read_rows, select
from meshreel_bench.runner import run_points, runs_of

from meshreel.capture.procedural import sliding_sphere
from meshreel.errors import InputError
from meshreel.metrics.comparison import ComparisonOptions

BALLS = sliding_sphere(2, levels=1)
QUICK = ComparisonOptions(ssim=False)
PLUGIN = """
import os, time
from dataclasses import asdict, dataclass
import numpy as np
from meshreel.types import Mesh

@dataclass(frozen=True)
class Raw:
    how: str = "right"
    name = "raw"
    analysis_key = ""  # all points are one run

    @property
    def options(self):
        return asdict(self)

    def analyse(self, sequence, progress=None):
        return sequence

    def code(self, analysis, progress=None):
        return self.encode(analysis)

    def encode(self, sequence, progress=None):
        if self.how == "crash":
            os._exit(3)
        if self.how == "raise":
            raise RuntimeError("no idea")
        if self.how == "hang":
            time.sleep(600)
        meshes = list(sequence)[: 1 if self.how == "few" else None]
        sizes = [np.array([len(mesh.vertices), len(mesh.faces)], "<i4") for mesh in meshes]
        scale = np.nan if self.how == "nan" else 1.0
        return b"".join(s.tobytes() + (scale * m.vertices).tobytes() + m.faces.tobytes() for s, m in zip(sizes, meshes))

    def decode(self, data):
        found = []
        while data:
            v, f = np.frombuffer(data[:8], "<i4")
            vertices = np.frombuffer(data[8 : 8 + 24 * v]).reshape(-1, 3)
            faces = np.frombuffer(data[8 + 24 * v : 8 + 24 * v + 12 * f], "<i4").reshape(-1, 3)
            found.append(Mesh.of(vertices, faces) if self.how != "nan" else Mesh(vertices, faces))
            data = data[8 + 24 * v + 12 * f :]
        return found
"""


@pytest.fixture(scope="module")
def plugin(tmp_path_factory):
    """A folder with a package that has a codec by an entry point, and a sequence `ball`."""
    folder = tmp_path_factory.mktemp("site")
    (folder / "rawcodec.py").write_text(PLUGIN)
    info = folder / "rawcodec-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: rawcodec\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[meshreel.codecs]\nraw = rawcodec:Raw\ndraco = rawcodec:Raw\ngone = nowhere:X\n"
    )
    np.savez(folder / "ball.npz", vertices=np.stack([mesh.vertices for mesh in BALLS]), faces=BALLS[0].faces)
    return folder


@pytest.fixture
def installed(plugin, monkeypatch):
    """The same, found by this process and those it starts."""
    monkeypatch.syspath_prepend(str(plugin))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(plugin), os.environ.get("PYTHONPATH", "")]))
    return plugin


@pytest.mark.usefixtures("installed")
def test_a_codec_of_another_package_is_found_and_a_name_has_one_codec():
    assert isinstance(make_codec("raw", {}), Codec) and make_codec("raw", {"how": "few"}).options == {"how": "few"}
    with pytest.raises(InputError, match="both bring a codec 'draco'; uninstall one"):
        make_codec("draco", {})
    with pytest.raises(InputError, match="'gone' cannot be loaded"):
        make_codec("gone", {})
    with pytest.raises(InputError, match=r"known: .*raw"):
        make_codec("none", {})


def test_rows_know_the_version_of_somebody_elses_codec(installed, tmp_path, monkeypatch):
    points, file = [Point("ball", "raw", {}, kind=RATED)], tmp_path / "rows.jsonl"
    [row] = run_points(points, file, Bench(installed, comparison=QUICK), lambda *_: None)
    assert row["codec_version"] == "rawcodec 1.0" and len(row["source"]) == 64
    monkeypatch.setattr("meshreel_bench.identity.codec_version", lambda _: "rawcodec 2.0")
    with pytest.raises(InputError, match=r"another version of the codec \(rawcodec 1.0, now rawcodec 2.0\)"):
        run_points(points, file, Bench(installed, comparison=QUICK), lambda *_: None)


@pytest.mark.usefixtures("installed")
def test_a_codec_with_bytes_of_its_own_is_measured_as_ours_are():
    row = run_point("ball", BALLS, make_codec("raw", {}), QUICK)
    assert row["bytes"] == sum(8 + 24 * len(mesh.vertices) + 12 * len(mesh.faces) for mesh in BALLS)
    assert row["decode"]["frames"] == 2 and row["decode"]["frame_ms"] > 0 and row["groups"] == []
    assert row["d2_psnr"] > 120


def test_the_codec_of_the_docs_works(tmp_path, monkeypatch):
    text = (Path(__file__).parents[2] / "docs" / "codecs.md").read_text(encoding="utf-8")
    code = text.split("```python\n")[1].split("```")[0]
    (tmp_path / "zipmesh_of_the_docs.py").write_text(code)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    codec = import_module("zipmesh_of_the_docs").ZipMesh(0.002)
    row = run_point("ball", BALLS, codec, QUICK)
    assert row["options"] == {"step": 0.002} and row["decode"]["frames"] == 2 and row["rms_forward_m"] < 0.002
    assert len([line for line in code.splitlines() if line.strip()]) <= 25


def test_what_fails_is_a_row_and_the_others_are_measured(installed, tmp_path):
    ways = {"crash": "exit code 3", "raise": "no idea", "few": "1 frames of 2", "nan": "not finite"}
    points = [Point("ball", "raw", {"how": how}, kind="curve") for how in (*ways, "right")]
    file, bench = tmp_path / "rows.jsonl", Bench(installed, comparison=QUICK, limit_s=60)
    with ThreadPoolExecutor(2) as executor:
        rows = run_points(points, file, bench, lambda *_: None, executor)
    for row, (how, words) in zip(rows, ways.items(), strict=False):
        assert words in row[FAILED] and row["options"] == {"how": how} and row["sequence"] == "ball"
    raised = PLUGIN.splitlines().index('            raise RuntimeError("no idea")') + 1
    assert rows[1][FAILED] == f"RuntimeError: no idea (rawcodec.py, line {raised})"
    assert FAILED not in rows[-1] and rows[-1]["mbps"] > 0
    assert len(failed_rows(rows)) == 4 and select(rows, "ball", kind="curve") == rows[-1:]
    assert sorted(map(json.dumps, read_rows(file))) == sorted(map(json.dumps, rows))


@pytest.mark.parametrize("how", ["crash", "raise"])
def test_who_fails_ends_neither_its_run_nor_the_sweep(installed, tmp_path, how):
    """Points that share an analysis share a process, too; one that ends it fails alone."""
    points = [Point("ball", "raw", {"how": each}, kind=RATED) for each in ("right", how, "some")]
    assert len(runs_of(points)) == 1
    bench = Bench(installed, comparison=QUICK, limit_s=60)
    rows = run_points(points, tmp_path / "rows.jsonl", bench, lambda *_: None)
    assert [FAILED in row for row in rows] == [False, True, False]


def test_who_hangs_is_ended_at_the_limit_and_asked_again_only_if_told(installed, tmp_path):
    point, file = Point("ball", "raw", {"how": "hang"}, kind="curve"), tmp_path / "rows.jsonl"
    bench = Bench(installed, comparison=QUICK, limit_s=4)
    start = time.monotonic()
    [row] = run_points([point], file, bench, lambda *_: None)
    assert "longer than 4 s" in row[FAILED] and time.monotonic() - start < 60
    told: list[bool] = []
    run_points([point], file, bench, lambda _, new: told.append(new))
    run_points(
        [point], file, Bench(installed, comparison=QUICK, limit_s=4, retry=True), lambda _, new: told.append(new)
    )
    assert told == [False, True]


def test_a_point_that_was_measured_at_last_counts():
    first = {"point": "a", FAILED: "crash"}
    again = {"point": "a", "mbps": 1.0}
    assert join_rows([[first, again]]) == [again] and join_rows([[first], [again]]) == [again]
    assert join_rows([[first]]) == [first] and join_rows([[again], [again | {"mbps": 2.0}]]) == [again]


def test_rows_say_what_made_them():
    made = provenance.made_by()[provenance.MADE_BY]
    assert set(made) == {"meshreel", "commit", "platform", "python", "cpu", "cores"}
    assert made["commit"] is None or set(made["commit"]) <= set("0123456789abcdef+")
    rows = [{provenance.MADE_BY: made | {"commit": "a"}}, {}, {provenance.MADE_BY: made | {"commit": None}}, {}]
    assert len(provenance.makers(rows)) == 3 and provenance.makers(rows)[1] == "not recorded"


def test_the_interrupt_of_a_sweep_ends_what_runs(installed, tmp_path):
    from meshreel_bench.cli import side_by_side

    runs = [
        [Point("ball", "raw", {"how": "hang"}, frames, RATED), Point("ball", "raw", {}, frames, RATED)]
        for frames in (1, 2)
    ]
    bench, start = Bench(installed, comparison=QUICK, limit_s=600), time.monotonic()
    with pytest.raises(KeyboardInterrupt), side_by_side(2) as executor:
        for run in runs:  # none of them goes on with its second point
            executor.submit(run_points, run, tmp_path / "rows.jsonl", bench, lambda *_: None)
        time.sleep(3)
        raise KeyboardInterrupt
    assert time.monotonic() - start < 60 and not (tmp_path / "rows.jsonl").exists()
    with side_by_side(2) as executor:  # another sweep may begin
        [row] = run_points(runs[0][1:], tmp_path / "rows.jsonl", bench, lambda *_: None, executor)
    assert row["mbps"] > 0
