"""The tables of FORMAT.md follow from the layout."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from meshreel.errors import InputError
from meshreel.format.layout import PAYLOADS, RECORDS, IndexEntry, Layer, Preamble
from meshreel.format.records import least_size
from scripts.format_tables import fill_tables, table

ROOT = Path(__file__).resolve().parents[2]


def test_format_md_is_not_stale():
    text = (ROOT / "FORMAT.md").read_text(encoding="utf-8")
    assert fill_tables(text, RECORDS + PAYLOADS) == text


def test_generate_check_passes_and_fails_on_a_stale_document(tmp_path):
    copied = tmp_path / "scripts"
    copied.mkdir()
    makers = ("code", "tables")
    for name in ("generate", "generate_format.py", *(f"format_{maker}.py" for maker in makers), "reliability.py"):
        (copied / name).write_bytes((ROOT / "scripts" / name).read_bytes())
    shutil.copytree(ROOT / "docs", tmp_path / "docs", ignore=shutil.ignore_patterns("pictures"))
    (tmp_path / "src").symlink_to(ROOT / "src")
    text = (ROOT / "FORMAT.md").read_text(encoding="utf-8")
    (tmp_path / "FORMAT.md").write_text(text, encoding="utf-8")
    generated = (
        "web/player-core/src/format/layout.gen.ts",
        "web/player-three/src/ground.gen.ts",
        "core/src/layout.gen.h",
    )
    for module in (tmp_path / name for name in generated):
        module.parent.mkdir(parents=True)
        module.write_bytes((ROOT / module.relative_to(tmp_path)).read_bytes())
    command = ["bash", str(copied / "generate"), "--check"]
    environment = os.environ | {"PYTHON": sys.executable}
    assert subprocess.run(command, env=environment).returncode == 0
    (tmp_path / "FORMAT.md").write_text(text.replace("| `flags` |", "| `flag` |"), encoding="utf-8")
    assert subprocess.run(command, env=environment, capture_output=True).returncode == 1
    assert subprocess.run(command[:-1], env=environment).returncode == 0
    assert (tmp_path / "FORMAT.md").read_text(encoding="utf-8") == text
    for module in (tmp_path / name for name in generated):
        stale = module.read_text(encoding="utf-8")
        for name in ("VERSION", "kVersion", "RIM"):
            stale = stale.replace(f"{name} = ", f"{name} = 1")
        module.write_text(stale, encoding="utf-8")
        assert subprocess.run(command, env=environment, capture_output=True).returncode == 1
        assert subprocess.run(command[:-1], env=environment).returncode == 0
    assert subprocess.run(command, env=environment).returncode == 0


def test_offsets_are_shown_while_they_are_fixed():
    rows = table(IndexEntry).splitlines()[2:]
    assert [row.split("|")[1].strip() for row in rows] == ["0", "1", "2", "4", "", ""]


def test_the_sizes_that_the_prose_of_format_md_names_are_right():
    assert least_size(Preamble) == 14


@pytest.mark.parametrize(
    "text", ["", "<!-- table Layer -->\n<!-- end -->\n" * 2, "<!-- table Other -->\n<!-- end -->\n"]
)
def test_a_record_without_its_table_is_an_input_error(text):
    with pytest.raises(InputError, match="tables and records differ"):
        fill_tables(text, (Layer,))
