"""Records: dataclasses whose fields declare their layout; record <-> bytes.

A field is declared as `name: Annotated[type, KIND, "meaning"]`; pack, unpack and FORMAT.md's tables follow from it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache
from typing import Any, TypeVar, get_type_hints

from ..errors import FormatError, InputError
from .kinds import Kind

R = TypeVar("R")


def pack(record: object) -> bytes:
    """Pack a record into bytes. Raises InputError if a value does not fit its field."""
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
    """Unpack the record at `offset`; also return the offset behind it. Raises FormatError for invalid bytes."""
    values = {}
    for field in record_fields(record_type):
        try:
            values[field.name], offset = field.kind.unpack(data, offset)
        except FormatError as error:
            raise FormatError(f"{record_type.__name__}.{field.name}: {error}") from error
    return record_type(**values), offset


def unpack_all(record_type: type[R], data: bytes) -> R:
    """Unpack the record that fills `data` exactly. Raises FormatError if bytes are left over."""
    record, end = unpack(record_type, data)
    if end != len(data):
        raise FormatError(f"{record_type.__name__}: {len(data) - end} bytes too many")
    return record


@cache
def least_size(record_type: type) -> int:
    """Return the smallest size of a record in bytes: its size if all fields are of fixed size."""
    return sum(field.kind.least for field in record_fields(record_type))


@dataclass(frozen=True, slots=True)
class Field:
    """Declaration of one field of a record."""

    name: str
    kind: Kind
    meaning: str


def record_fields(record_type: type) -> tuple[Field, ...]:
    return _declared(record_type)  # for type checkers, which do not know that all types can be hashed


@cache
def _declared(record_type: type) -> tuple[Field, ...]:
    hints = get_type_hints(record_type, include_extras=True)
    return tuple(Field(field.name, *hints[field.name].__metadata__) for field in fields(record_type))


@dataclass(frozen=True, slots=True)
class Nested:
    """A record as a field of another record."""

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
