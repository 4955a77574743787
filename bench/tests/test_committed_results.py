"""The pages of results are those of the rows beside them."""

from __future__ import annotations

from pathlib import Path

import pytest
from meshreel_bench.experiments import EXPERIMENTS
from meshreel_bench.report import pages, write_report
from meshreel_bench.rows import join_rows, read_rows

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.mark.slow
def test_the_pages_of_results_are_those_of_their_rows(tmp_path, monkeypatch):
    """But for sheets, whose pictures are not kept with the rows; `meshreel bench report` makes them anew."""
    monkeypatch.setattr(pages, "plot_curves", lambda *_: [])
    files = sorted((DOCS / "results").glob("*.jsonl"))
    write_report(join_rows([read_rows(path) for path in files]), EXPERIMENTS, tmp_path)
    shown = set[str]()
    for name in ("results.md", "reproducing.md"):
        told = set((DOCS / name).read_text(encoding="utf-8").splitlines())
        made = (tmp_path / name).read_text(encoding="utf-8").splitlines()
        commands = "meshreel bench report "  # names its files in the order that somebody gave
        assert [line for line in made if line not in told and not line.startswith(commands)] == []
        shown |= {line.split("](results/")[1].split(")")[0] for line in made if "](results/" in line}
    assert shown and all((DOCS / "results" / name).is_file() for name in shown)
