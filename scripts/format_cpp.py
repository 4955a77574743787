"""Generator of the decoder's layout.gen.h from the declarations of the records: records -> C++."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import asdict
from enum import IntEnum

from meshreel.format.budget import LIMITS
from meshreel.format.kinds import Array, Blob, Bytes, Choice, Kind, List, Number, Rest, Text, Varint
from meshreel.format.layout import EDITED, LAYER_PICTURES, MAGIC, VERSION
from meshreel.format.records import Nested, least_size, record_fields

HEAD = """\
// clang-format off
// Made from src/meshreel/format/layout.py and budget.py by scripts/generate. Do not edit.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "records.h"

namespace meshreel {
"""
TYPES = {"f32": "double", "f64": "double", "u8": "uint8_t", "u16": "uint16_t", "u32": "uint32_t", "i64": "int64_t"}
WIDTH = 118  # of a line of comment


def cpp(records: Sequence[type]) -> str:
    """Return a header with all limits, enumerations and records; a record follows the records that are its fields."""
    enumerations: dict[str, type[IntEnum]] = {}
    done: dict[str, str] = {}
    for record in records:
        _declare(record, enumerations, done)
    magic = ", ".join(f"{byte:#04x}" for byte in MAGIC)
    constants = [
        f"constexpr uint8_t kMagic[{len(MAGIC)}] = {{{magic}}};",
        f"constexpr uint8_t kVersion = {VERSION}, kEdited = {EDITED};",
        f"constexpr uint64_t kLayerPictures = {LAYER_PICTURES};",
        "constexpr size_t "
        + ", ".join(f"k{record.__name__}Size = {least_size(record)}" for record in records[:1])
        + ";  // bytes\n",
    ]
    limits = [f"constexpr double {_limit(name)} = {value};" for name, value in asdict(LIMITS).items()]
    parts = [HEAD, *constants, "// Numbers of the law of costs: src/meshreel/format/budget.py has their meaning."]
    parts += ["namespace limits {", *limits, "}  // namespace limits\n"]
    parts += [_enumeration(values) for values in enumerations.values()]
    return "\n".join([*parts, *done.values(), "}  // namespace meshreel\n"])


def _declare(record: type, enumerations: dict[str, type[IntEnum]], done: dict[str, str]) -> None:
    """Declare a record after the records that are its fields."""
    if record.__name__ in done:
        return
    name, members, reads = record.__name__, [], []
    for field in record_fields(record):
        for part in _parts(field.kind):
            if isinstance(part, Nested):
                _declare(part.record, enumerations, done)
            elif isinstance(part, Choice):
                enumerations[part.values.__name__] = part.values
        members += textwrap.wrap(field.meaning, WIDTH, initial_indent="    // ", subsequent_indent="    // ")
        members.append(f"    {_type(field.kind)} {field.name};")
        reads.append(f'        in.begin("{name}.{field.name}");')
        reads += [f"        {line}" for line in _reads(f"record.{field.name}", field.kind)]
    summary = textwrap.wrap((record.__doc__ or "").splitlines()[0], WIDTH)
    lines = [*(f"// {line}" for line in summary), f"struct {name} {{", *members, ""]
    lines += [f"    static {name} read(Records& in) {{", f"        {name} record;", *reads, "        return record;"]
    done[name] = "\n".join([*lines, "    }", "};\n"])


def _parts(kind: Kind) -> list[Kind]:
    """Return a kind and the kinds that it is made of."""
    if isinstance(kind, Array):
        return [kind, *_parts(kind.item)]
    if isinstance(kind, List):
        return [kind, *_parts(kind.length), *_parts(kind.item)]
    return [kind]


def _limit(name: str) -> str:
    return "k" + "".join(word.capitalize() for word in name.split("_"))


def _enumeration(values: type[IntEnum]) -> str:
    numbers = [value.value for value in values]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), f"{values.__name__} has gaps"
    members = ", ".join(f"{value.name} = {value.value}" for value in values)
    lines = textwrap.wrap(f"enum class {values.__name__} : uint8_t {{ {members} }};", WIDTH, subsequent_indent="    ")
    summary = (values.__doc__ or "").splitlines()[0]
    return "\n".join([f"// {summary}", *lines, ""])


def _type(kind: Kind) -> str:
    if isinstance(kind, Number):
        return TYPES[kind.label]
    if isinstance(kind, Varint):
        return "uint64_t"
    if isinstance(kind, Choice):
        return kind.values.__name__
    if isinstance(kind, Text):
        return "std::string"
    if isinstance(kind, Bytes | Blob | Rest):
        return "mr_bytes"
    if isinstance(kind, Array):
        return f"std::array<{_type(kind.item)}, {kind.count}>"
    if isinstance(kind, List):
        return f"std::vector<{_type(kind.item)}>"
    assert isinstance(kind, Nested), kind
    return kind.record.__name__


def _reads(place: str, kind: Kind) -> list[str]:
    """Return the statements that read a value."""
    if isinstance(kind, Array):
        return [f"for ({_type(kind.item)}& item : {place}) {_reads('item', kind.item)[0]}"]
    if isinstance(kind, List):
        count = f"in.count({_value(kind.length)}, {kind.item.least})"
        return [f"{place}.resize({count});", f"for ({_type(kind.item)}& item : {place}) {_reads('item', kind.item)[0]}"]
    return [f"{place} = {_value(kind)};"]


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
