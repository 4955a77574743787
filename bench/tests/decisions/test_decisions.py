"""Decisions: every measurement can be called, and the tables of docs/decisions are those of their rows."""

from __future__ import annotations

import json
import shutil
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import pytest
from meshreel_bench import decisions
from meshreel_bench.decisions.__main__ import MEASURE, main
from meshreel_bench.decisions.rows import Case, read
from meshreel_bench.decisions.tables import write_tables

from meshreel.io.write import make_folder, write_mesh
from tests.spheres import sliding_sphere

PAGES = Path(__file__).parents[3] / "docs" / "decisions"


@pytest.fixture
def pages(tmp_path):
    """A copy of the pages with their rows."""
    return shutil.copytree(PAGES, tmp_path / "decisions")


def test_the_tables_of_all_pages_are_those_of_the_rows(pages):
    assert list(write_tables(pages)) == []


def test_a_table_follows_its_rows(pages):
    rows = pages / "measured.jsonl"
    rows.write_text(rows.read_text().replace('"laplacian_bytes": 17241', '"laplacian_bytes": 17000'))
    [page] = write_tables(pages)
    assert "| 17000 | 57493 |" in page.read_text()


def test_a_decision_that_is_measured_anew_replaces_its_own_rows_alone(pages, capsys):
    file = pages / "measured.jsonl"
    before = read(file)
    file.write_text("".join(json.dumps(row | {"float32_gap_m": 0.0}) + "\n" for row in before))
    main(["float64", "--pages", str(pages)])
    assert "float32_gap_m 0.0625" in capsys.readouterr().out
    after = read(file)
    assert [row for row in after if row["decision"] == "float64"] == [r for r in before if r["decision"] == "float64"]
    assert len(after) == len(before)


def test_every_row_in_the_docs_has_a_command_that_measures_it():
    assert {row["decision"] for row in read(PAGES / "measured.jsonl")} == set(MEASURE)


def test_every_module_of_decisions_can_be_imported():
    for module in iter_modules(decisions.__path__):
        import_module(f"{decisions.__name__}.{module.name}")


def test_frames_of_a_case_are_normalised(tmp_path):
    make_folder(tmp_path / "performers" / "ball")
    for number, mesh in enumerate(sliding_sphere(4, levels=1)):
        write_mesh(mesh, tmp_path / "performers" / "ball" / f"{number:05}.ply")
    frames = Case("ball", first=1, count=2, stride=2).frames(tmp_path)
    assert len(frames) == 2 and max(frame.diagonal for frame in frames) < 1 + 1e-6
