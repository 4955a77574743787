"""Records: dataclasses whose fields say how they lie in bytes. In: a record, or bytes. Out: bytes, or a record.

A field is declared `name: Annotated[type, KIND, "what it means"]`; pack, unpack and the tables of FORMAT.md all follow
from that.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache
from typing import Any, TypeVar, get_type_hints

from ..errors import FormatError, InputError
from .kinds import Kind

R = TypeVar("R")


def pack(record: object) -> bytes:
    """The bytes of a record. InputError where a value does not fit its field."""
    parts = []
    for field in record_fields(type(record)):
        value = getattr(record, field.name)
        try:
            parts.append(field.kind.pack(value))
        except (ValueError, TypeError, OverflowError, InputError) as error:
            raise InputError(
                f"{type(record).__name__}.{field.name}: {value!r:.60} is no {field.kind.label}: {error}"
            ) from error
    return b"".join(parts)


def unpack(record_type: type[R], data: bytes, offset: int = 0) -> tuple[R, int]:
    """The record that starts at `offset`, and the offset behind it. FormatError where the bytes are no such record."""
    values = {}
    for field in record_fields(record_type):
        try:
            values[field.name], offset = field.kind.unpack(data, offset)
        except FormatError as error:
            raise FormatError(f"{record_type.__name__}.{field.name}: {error}") from error
    return record_type(**values), offset


def unpack_all(record_type: type[R], data: bytes) -> R:
    """The record that fills `data` exactly. FormatError where bytes are left over."""
    record, end = unpack(record_type, data)
    if end != len(data):
        raise FormatError(f"{record_type.__name__}: {len(data) - end} bytes too many")
    return record


def least_size(record_type: type) -> int:
    """The fewest bytes a record can take; its size where all fields have a fixed one."""
    return sum(field.kind.least for field in record_fields(record_type))


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a record, as its declaration says."""

    name: str
    kind: Kind
    meaning: str


def record_fields(record_type: type) -> tuple[Field, ...]:
    """The fields of a record in the order of their bytes."""
    return _declared(record_type)


@cache
def _declared(record_type: type) -> tuple[Field, ...]:
    hints = get_type_hints(record_type, include_extras=True)
    found = []
    for field in fields(record_type):
        kind, meaning = hints[field.name].__metadata__
        found.append(Field(field.name, kind, meaning))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class Nested:
    """Another record."""

    record: type

    @property
    def label(self) -> str:
        return self.record.__name__

    @property
    def least(self) -> int:
        return least_size(self.record)

    def pack(self, value: object) -> bytes:
        if not isinstance(value, self.record):
            raise TypeError(f"not a {self.label}")
        return pack(value)

    def unpack(self, data: bytes, offset: int) -> tuple[Any, int]:
        return unpack(self.record, data, offset)
