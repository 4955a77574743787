"""Generator of the player's layout.gen.ts from the declarations of the records: records -> TypeScript."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from enum import IntEnum

from meshreel.format.budget import LIMITS
from meshreel.format.kinds import Array, Blob, Bytes, Choice, Kind, List, Number, Rest, Text, Varint
from meshreel.format.layout import EDITED, MAGIC, VERSION
from meshreel.format.records import Nested, record_fields

HEAD = """\
// Made from src/meshreel/format/layout.py and budget.py by scripts/generate. Do not edit.

import {
  array, blob, bytes, choice, f32, f64, i64, list, nested, record, rest, text, u8, u16, u32, varint,
} from "./records.ts";
import type { Kind } from "./records.ts";
"""


def typescript(records: Sequence[type]) -> str:
    """Return a module with all limits, enumerations and records; a record follows the records that are its fields."""
    enumerations: dict[str, type[IntEnum]] = {}
    done: dict[str, str] = {}
    for record in records:
        _declare(record, enumerations, done)
    magic = ", ".join(str(byte) for byte in MAGIC)
    parts = [
        HEAD,
        f"export const MAGIC = [{magic}] as const;\n",
        f"export const VERSION = {VERSION};\nexport const EDITED = {EDITED};\n",
    ]
    parts.append(_constants("LIMITS", {_camel(name): value for name, value in asdict(LIMITS).items()}))
    parts += [
        _constants(values.__name__, {value.name: value.value for value in values}) for values in enumerations.values()
    ]
    return "\n".join([*parts, *done.values()])


def _declare(record: type, enumerations: dict[str, type[IntEnum]], done: dict[str, str]) -> None:
    """Declare a record after the records that are its fields."""
    if record.__name__ in done:
        return
    lines, kinds = [], []
    for field in record_fields(record):
        for part in _parts(field.kind):
            if isinstance(part, Nested):
                _declare(part.record, enumerations, done)
            elif isinstance(part, Choice):
                enumerations[part.values.__name__] = part.values
        name = _camel(field.name)
        lines.append(f"  readonly {name}: {_type(field.kind)}; // {field.meaning}")
        kinds.append(f"  {name}: {_reader(field.kind)},")
    name = record.__name__
    text = f"/** {(record.__doc__ or '').splitlines()[0]} */\nexport interface {name} {{\n" + "\n".join(lines) + "\n}\n"
    text += f'export const {name}: Kind<{name}> = record("{name}", {{\n' + "\n".join(kinds) + "\n});\n"
    done[name] = text


def _parts(kind: Kind) -> list[Kind]:
    """Return a kind and the kinds that it is made of."""
    if isinstance(kind, Array):
        return [kind, *_parts(kind.item)]
    if isinstance(kind, List):
        return [kind, *_parts(kind.length), *_parts(kind.item)]
    return [kind]


def _constants(name: str, values: dict[str, int]) -> str:
    members = "\n".join(f"  {key}: {value}," for key, value in values.items())
    return f"export const {name} = {{\n{members}\n}} as const;\n"


def _type(kind: Kind) -> str:
    if isinstance(kind, Number | Varint | Choice):
        return "number"
    if isinstance(kind, Text):
        return "string"
    if isinstance(kind, Bytes | Blob | Rest):
        return "Uint8Array"
    if isinstance(kind, Array | List):
        return f"readonly {_type(kind.item)}[]"
    assert isinstance(kind, Nested), kind
    return kind.record.__name__


def _reader(kind: Kind) -> str:
    """Return the TypeScript expression that makes the reader of a kind."""
    if isinstance(kind, Number):
        return kind.label
    if isinstance(kind, Choice):
        return kind.number.label if kind.is_open else f"choice({kind.number.label}, {kind.values.__name__})"
    if isinstance(kind, Array):
        return f"array({kind.count}, {_reader(kind.item)})"
    if isinstance(kind, List):
        return f"list({_reader(kind.length)}, {_reader(kind.item)})"
    if isinstance(kind, Blob | Text):
        return f"{type(kind).__name__.lower()}({_reader(kind.length)})"
    if isinstance(kind, Bytes):
        return f"bytes({kind.size})"
    if isinstance(kind, Nested):
        return f"nested(() => {kind.record.__name__})"
    return type(kind).__name__.lower()  # Varint, Rest


def _camel(name: str) -> str:
    first, *others = name.split("_")
    return first + "".join(other.capitalize() for other in others)
