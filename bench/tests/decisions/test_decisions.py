"""Decisions: the tables of docs/decisions are those of their rows."""

import re
import shutil
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import pytest
from meshreel_bench import decisions
from meshreel_bench.decisions.tables import COLUMNS, PIVOTS, read, write_tables

PAGES = Path(__file__).parents[3] / "docs" / "decisions"
TOLD = {"float64", "lattice"}  # decisions whose rows a page tells in a sentence


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
    assert page.parent == pages and "| 17000 | 57493 |" in page.read_text()


def test_every_row_is_in_a_table_or_in_a_sentence_and_every_table_in_a_page():
    made = COLUMNS.keys() | PIVOTS.keys()
    assert {row["decision"] for row in read(PAGES / "measured.jsonl")} == made | TOLD
    text = "".join(page.read_text() for page in PAGES.glob("0*.md"))
    assert set(re.findall(r"<!-- table: (\w+) -->", text)) == made
    assert all(f"`{name}`" in text for name in TOLD)


def test_every_module_of_decisions_can_be_imported():
    for module in iter_modules(decisions.__path__):
        import_module(f"{decisions.__name__}.{module.name}")
