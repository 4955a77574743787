"""Generators of the decoder's layout.gen.h and the player's layout.gen.ts from the declarations of the records."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import asdict
from enum import IntEnum

from meshreel.format.budget import LIMITS
from meshreel.format.checks import LARGEST, MOST_CHANGES, MOST_NESTED, MOST_TRACKS, SMALLEST
from meshreel.format.kinds import EXACT, Array, Blob, Bytes, Choice, Kind, List, Number, Rest, Text, Varint
from meshreel.format.layout import EDITED, LAYER_PICTURES, MAGIC, VERSION
from meshreel.format.records import Nested, least_size, record_fields

CPP_HEAD = """\
// clang-format off
// Made from src/meshreel/format/layout.py, budget.py and checks.py by scripts/generate. Do not edit.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "records.h"

namespace meshreel {
"""
CPP_TYPES = {"f32": "double", "f64": "double", "u8": "uint8_t", "u16": "uint16_t", "u32": "uint32_t", "i64": "int64_t"}
TYPESCRIPT_HEAD = """\
// Made from src/meshreel/format/layout.py, budget.py and checks.py by scripts/generate. Do not edit.

import {
  array, blob, bytes, choice, f32, f64, i64, list, nested, record, rest, text, u8, u16, u32, varint,
} from "./records.ts";
import type { Kind } from "./records.ts";
"""
WIDTH = 118  # of a line of comment


def in_order(records: Sequence[type]) -> tuple[list[type], list[type[IntEnum]]]:
    """Return all records, each after the records that are its fields, and the enumerations of their fields."""
    ordered: dict[type, None] = {}
    enumerations: dict[type[IntEnum], None] = {}

    def add(record: type) -> None:
        for field in () if record in ordered else record_fields(record):
            kind = field.kind
            while isinstance(kind, Array | List):
                kind = kind.item  # no length is a choice
            if isinstance(kind, Nested):
                add(kind.record)
            elif isinstance(kind, Choice):
                enumerations[kind.values] = None
        ordered[record] = None

    for record in records:
        add(record)
    return [*ordered], [*enumerations]


def cpp(records: Sequence[type]) -> str:
    """Return a header with all limits, enumerations and records; a record follows the records that are its fields."""
    ordered, enumerations = in_order(records)
    magic = ", ".join(f"{byte:#04x}" for byte in MAGIC)
    constants = [
        f"constexpr uint8_t kMagic[{len(MAGIC)}] = {{{magic}}};",
        f"constexpr uint8_t kVersion = {VERSION}, kEdited = {EDITED};",
        f"constexpr uint64_t kLayerPictures = {LAYER_PICTURES}, kMostTracks = {MOST_TRACKS};",
        f"constexpr int kMostChanges = {MOST_CHANGES}, kMostNested = {MOST_NESTED};",
        f"constexpr int64_t kExact = {EXACT};  // beyond it whole numbers are no doubles",
        f"constexpr double kLargest = {LARGEST:g}, kSmallest = {SMALLEST:g};  // of the numbers in a header",
        f"constexpr size_t k{records[0].__name__}Size = {least_size(records[0])};  // bytes\n",
    ]
    limits = [f"constexpr double {_limit(name)} = {value};" for name, value in asdict(LIMITS).items()]
    parts = [CPP_HEAD, *constants, "// Numbers of the law of costs: src/meshreel/format/budget.py has their meaning."]
    parts += ["namespace limits {", *limits, "}  // namespace limits\n"]
    parts += [*map(_cpp_enumeration, enumerations), *map(_struct, ordered)]
    return "\n".join([*parts, "}  // namespace meshreel\n"])


def _struct(record: type) -> str:
    name, members, reads = record.__name__, [], []
    for field in record_fields(record):
        members += textwrap.wrap(field.meaning, WIDTH, initial_indent="    // ", subsequent_indent="    // ")
        members.append(f"    {_cpp_type(field.kind)} {field.name};")
        reads.append(f'        in.begin("{name}.{field.name}");')
        reads += [f"        {line}" for line in _reads(f"record.{field.name}", field.kind)]
    summary = textwrap.wrap((record.__doc__ or "").splitlines()[0], WIDTH)
    lines = [*(f"// {line}" for line in summary), f"struct {name} {{", *members, ""]
    lines += [f"    static {name} read(Records& in) {{", f"        {name} record;", *reads, "        return record;"]
    return "\n".join([*lines, "    }", "};\n"])


def _limit(name: str) -> str:
    return "k" + "".join(word.capitalize() for word in name.split("_"))


def _cpp_enumeration(values: type[IntEnum]) -> str:
    numbers = [value.value for value in values]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), f"{values.__name__} has gaps"
    members = ", ".join(f"{value.name} = {value.value}" for value in values)
    lines = textwrap.wrap(f"enum class {values.__name__} : uint8_t {{ {members} }};", WIDTH, subsequent_indent="    ")
    summary = (values.__doc__ or "").splitlines()[0]
    return "\n".join([f"// {summary}", *lines, ""])


def _cpp_type(kind: Kind) -> str:
    if isinstance(kind, Number):
        return CPP_TYPES[kind.label]
    if isinstance(kind, Varint):
        return "uint64_t"
    if isinstance(kind, Choice):
        return kind.values.__name__
    if isinstance(kind, Text):
        return "std::string"
    if isinstance(kind, Bytes | Blob | Rest):
        return "mr_bytes"
    if isinstance(kind, Array):
        return f"std::array<{_cpp_type(kind.item)}, {kind.count}>"
    if isinstance(kind, List):
        return f"std::vector<{_cpp_type(kind.item)}>"
    assert isinstance(kind, Nested), kind
    return kind.record.__name__


def _reads(place: str, kind: Kind) -> list[str]:
    """Return the statements that read a value."""
    if not isinstance(kind, Array | List):
        return [f"{place} = {_value(kind)};"]
    each = f"for ({_cpp_type(kind.item)}& item : {place}) {_reads('item', kind.item)[0]}"
    if isinstance(kind, Array):
        return [each]
    return [f"{place}.resize(in.count({_value(kind.length)}, {kind.item.least}));", each]


def _value(kind: Kind) -> str:
    """Return the expression that reads a value."""
    if isinstance(kind, Number):
        return f"in.{kind.label}()"
    if isinstance(kind, Choice):
        name, values = kind.values.__name__, [*kind.values]
        if kind.is_open:
            return f"static_cast<{name}>(in.{kind.number.label}())"
        return f"in.choice({name}::{values[0].name}, {name}::{values[-1].name})"
    if isinstance(kind, Blob):
        return f"in.blob({_value(kind.length)})"
    if isinstance(kind, Text):
        return f"in.text({_value(kind.length)})"
    if isinstance(kind, Bytes):
        return f"in.blob({kind.size})"
    if isinstance(kind, Nested):
        return f"{kind.record.__name__}::read(in)"
    return f"in.{type(kind).__name__.lower()}()"  # Varint, Rest


def typescript(records: Sequence[type]) -> str:
    """Return a module with all limits, enumerations and records; a record follows the records that are its fields."""
    ordered, enumerations = in_order(records)
    magic = ", ".join(str(byte) for byte in MAGIC)
    parts = [
        TYPESCRIPT_HEAD,
        f"export const MAGIC = [{magic}] as const;\n",
        f"export const VERSION = {VERSION};\nexport const EDITED = {EDITED};",
        f"export const MOST_TRACKS = {MOST_TRACKS};\nexport const MOST_CHANGES = {MOST_CHANGES};",
        f"export const MOST_NESTED = {MOST_NESTED};\nexport const LARGEST = {LARGEST:g};",
        f"export const SMALLEST = {SMALLEST:g};\n",
    ]
    parts.append(_constants("LIMITS", {_camel(name): value for name, value in asdict(LIMITS).items()}))
    parts += [_constants(values.__name__, {value.name: value.value for value in values}) for values in enumerations]
    return "\n".join([*parts, *map(_interface, ordered)])


def _interface(record: type) -> str:
    lines, kinds, name = [], [], record.__name__
    for field in record_fields(record):
        member = _camel(field.name)
        lines.append(f"  readonly {member}: {_typescript_type(field.kind)}; // {field.meaning}")
        kinds.append(f"  {member}: {_reader(field.kind)},")
    text = f"/** {(record.__doc__ or '').splitlines()[0]} */\nexport interface {name} {{\n" + "\n".join(lines) + "\n}\n"
    return text + f'export const {name}: Kind<{name}> = record("{name}", {{\n' + "\n".join(kinds) + "\n});\n"


def _constants(name: str, values: dict[str, int]) -> str:
    members = "\n".join(f"  {key}: {value}," for key, value in values.items())
    return f"export const {name} = {{\n{members}\n}} as const;\n"


def _typescript_type(kind: Kind) -> str:
    if isinstance(kind, Number | Varint | Choice):
        return "number"
    if isinstance(kind, Text):
        return "string"
    if isinstance(kind, Bytes | Blob | Rest):
        return "Uint8Array"
    if isinstance(kind, Array | List):
        return f"readonly {_typescript_type(kind.item)}[]"
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
