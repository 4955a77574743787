"""The player's reader of records declares all fields and matches the layout."""

import re
from pathlib import Path

from meshreel.format.layout import PAYLOADS, RECORDS
from meshreel.format.records import record_fields
from scripts.format_code import typescript

CORE = Path(__file__).resolve().parents[2] / "web" / "player-core" / "src"
TEXT = typescript(RECORDS + PAYLOADS)


def test_the_players_module_is_generated_from_this_layout():
    assert (CORE / "format" / "layout.gen.ts").read_text(encoding="utf-8") == TEXT


def test_every_record_has_its_fields_in_their_order():
    for record in RECORDS + PAYLOADS:
        [body] = re.findall(rf'record\("{record.__name__}", {{\n(.*?)\n}}\);', TEXT, re.DOTALL)
        names = re.findall(r"^  (\w+): ", body, re.MULTILINE)
        assert [name.lower() for name in names] == [field.name.replace("_", "") for field in record_fields(record)]


def test_a_record_follows_the_records_that_are_its_fields():
    for name in re.findall(r"nested\(\(\) => (\w+)\)", TEXT):
        assert 0 <= TEXT.index(f"export const {name}:") < TEXT.index(f"nested(() => {name})")


def test_every_kind_of_field_has_a_reader_in_the_player():
    [imported] = re.findall(r'import {\n(.*?)} from "./records.ts"', TEXT, re.DOTALL)
    declared = (CORE / "format" / "records.ts").read_text(encoding="utf-8")
    for name in re.findall(r"\w+", imported):
        assert re.search(rf"export (const|function) {name}\b", declared), name
