"""Tables of FORMAT.md, generated from the declarations of the records: text with markers -> text with tables.

A marker is the pair `<!-- table NAME -->` and `<!-- end -->`; the text between them is replaced.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from meshreel.errors import InputError
from meshreel.format.kinds import Array, Bytes, Choice, Kind, Number
from meshreel.format.records import record_fields

MARKED = re.compile(r"(<!-- table (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def fill_tables(text: str, records: Sequence[type]) -> str:
    """Regenerate every marked table of a text. Raises InputError where a table or a record lacks its counterpart."""
    by_name = {record.__name__: record for record in records}
    marked = [name for _, name, _ in MARKED.findall(text)]
    if sorted(marked) != sorted(by_name):
        odd = sorted(set(marked) ^ set(by_name)) or "a marker twice"
        raise InputError(f"tables and records differ: {odd}; give each record one marker")
    return MARKED.sub(lambda match: match[1] + table(by_name[match[2]]) + match[3], text)


def table(record_type: type) -> str:
    """Return the Markdown table of a record: offset (while it is fixed), field, kind, meaning."""
    lines = ["| offset | field | kind | meaning |", "| ---: | --- | --- | --- |"]
    offset: int | None = 0
    for field in record_fields(record_type):
        place = "" if offset is None else str(offset)
        lines.append(f"| {place} | `{field.name}` | {field.kind.label} | {field.meaning} |")
        offset = offset + field.kind.least if offset is not None and _is_fixed(field.kind) else None
    return "\n".join(lines) + "\n"


def _is_fixed(kind: Kind) -> bool:
    return isinstance(kind, Number | Bytes | Choice) or (isinstance(kind, Array) and _is_fixed(kind.item))
