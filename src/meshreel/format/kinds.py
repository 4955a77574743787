"""Kinds of fields: value <-> bytes at an offset.

The only module that packs numbers, little-endian throughout. Packing raises ValueError or TypeError for values that do
not fit, unpacking raises FormatError; counts are checked against the remaining bytes before anything is allocated.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol, runtime_checkable

from ..errors import FormatError

EXACT = (1 << 53) - 1  # whole numbers up to this one are doubles, too, which is what a page counts in


@runtime_checkable
class Kind(Protocol):
    """Layout of one field in bytes."""

    @property
    def label(self) -> str:
        """Name of the kind in FORMAT.md."""

    @property
    def least(self) -> int:
        """The fewest bytes that a value can take; at least 1 for an item of a List."""

    def pack(self, value: Any) -> bytes: ...

    def unpack(self, data: bytes, offset: int) -> tuple[Any, int]: ...


@dataclass(frozen=True, slots=True)
class Number:
    """A number of fixed size; floats are finite."""

    label: str
    code: str  # as in the struct module

    @property
    def least(self) -> int:
        return _SIZES[self.code]

    def pack(self, value: Any) -> bytes:
        return self.pack_many([value])

    def unpack(self, data: bytes, offset: int) -> tuple[Any, int]:
        (value,), offset = self.unpack_many(data, offset, 1)
        return value, offset

    def pack_many(self, values: Sequence[Any]) -> bytes:
        if not self._finite(values):
            raise ValueError("not finite")
        try:
            return struct.pack(f"<{len(values)}{self.code}", *values)
        except struct.error as error:
            raise ValueError(str(error)) from error

    def unpack_many(self, data: bytes, offset: int, count: int) -> tuple[tuple[Any, ...], int]:
        size = count * self.least
        _check_room(data, offset, size)
        values = struct.unpack_from(f"<{count}{self.code}", data, offset)
        if not self._finite(values):
            raise FormatError("a number that is not finite")
        return values, offset + size

    def _finite(self, values: Sequence[Any]) -> bool:
        return self.code not in "fd" or all(map(math.isfinite, values))


_SIZES = {code: struct.calcsize("<" + code) for code in "BHIqfd"}

U8 = Number("u8", "B")
U16 = Number("u16", "H")
U32 = Number("u32", "I")
I64 = Number("i64", "q")
F32 = Number("f32", "f")
F64 = Number("f64", "d")


@dataclass(frozen=True, slots=True)
class Varint:
    """An unsigned number below 2^53 in the fewest bytes: 7 bits per byte, low bits first (LEB128)."""

    label: str = "varint"
    least: int = 1

    def pack(self, value: int) -> bytes:
        number = int(value)
        if number != value or not 0 <= number <= EXACT:
            raise ValueError("not a whole number in 0 .. 2^53 - 1")
        data = bytearray()
        while number >= 0x80:
            data.append(number & 0x7F | 0x80)
            number >>= 7
        data.append(number)
        return bytes(data)

    def unpack(self, data: bytes, offset: int) -> tuple[int, int]:
        if offset < len(data) and data[offset] < 0x80:  # as nearly always
            return data[offset], offset + 1
        value = 0
        for shift in range(0, 56, 7):
            chunk, offset = _take(data, offset, 1)
            value |= (chunk[0] & 0x7F) << shift
            if chunk[0] < 0x80:
                break
        if chunk[0] >= 0x80 or value > EXACT or (shift and not chunk[0]):
            raise FormatError("a varint beyond 53 bits or longer than it needs to be")
        return value, offset


@dataclass(frozen=True, slots=True)
class Choice:
    """A value of an enumeration; of an open one, also a number that only later versions know."""

    number: Number
    values: type[IntEnum]
    is_open: bool = False

    @property
    def label(self) -> str:
        known = ", ".join(f"{value.value} {value.name}" for value in self.values)
        return f"{self.number.label} ({known}{' ...' if self.is_open else ''})"

    @property
    def least(self) -> int:
        return self.number.least

    def pack(self, value: int) -> bytes:
        return self.number.pack(value if self.is_open else self.values(value))

    def unpack(self, data: bytes, offset: int) -> tuple[int, int]:
        value, offset = self.number.unpack(data, offset)
        try:
            return self.values(value), offset
        except ValueError as error:
            if self.is_open:
                return value, offset
            raise FormatError(f"{value} is none of the known values") from error


@dataclass(frozen=True, slots=True)
class Bytes:
    """Exactly `size` bytes."""

    size: int

    @property
    def label(self) -> str:
        return f"bytes[{self.size}]"

    @property
    def least(self) -> int:
        return self.size

    def pack(self, value: bytes) -> bytes:
        if len(value) != self.size:
            raise ValueError(f"{len(value)} bytes")
        return bytes(value)

    def unpack(self, data: bytes, offset: int) -> tuple[bytes, int]:
        return _take(data, offset, self.size)


@dataclass(frozen=True, slots=True)
class Blob:
    """A length, then that number of bytes."""

    length: Kind

    @property
    def label(self) -> str:
        return f"{self.length.label} length, bytes"

    @property
    def least(self) -> int:
        return self.length.least

    def pack(self, value: bytes) -> bytes:
        return self.length.pack(len(value)) + bytes(value)

    def unpack(self, data: bytes, offset: int) -> tuple[bytes, int]:
        size, offset = self.length.unpack(data, offset)
        return _take(data, offset, size)


@dataclass(frozen=True, slots=True)
class Text:
    """A length in bytes, then UTF-8 text."""

    length: Kind

    @property
    def label(self) -> str:
        return f"{self.length.label} length, UTF-8"

    @property
    def least(self) -> int:
        return self.length.least

    def pack(self, value: str) -> bytes:
        return Blob(self.length).pack(value.encode())

    def unpack(self, data: bytes, offset: int) -> tuple[str, int]:
        raw, offset = Blob(self.length).unpack(data, offset)
        try:
            return raw.decode(), offset
        except UnicodeDecodeError as error:
            raise FormatError(f"not UTF-8: {error.reason}") from error


@dataclass(frozen=True, slots=True)
class Rest:
    """All bytes to the end; only the last field of a record may be of this kind."""

    label: str = "bytes to the end"
    least: int = 0

    def pack(self, value: bytes) -> bytes:
        return bytes(value)

    def unpack(self, data: bytes, offset: int) -> tuple[bytes, int]:
        return _take(data, offset, len(data) - offset)


@dataclass(frozen=True, slots=True)
class Array:
    """Exactly `count` values of one kind, as a tuple."""

    count: int
    item: Kind

    @property
    def label(self) -> str:
        return f"{self.count} x {self.item.label}"

    @property
    def least(self) -> int:
        return self.count * self.item.least

    def pack(self, value: Sequence[Any]) -> bytes:
        if len(value) != self.count:
            raise ValueError(f"{len(value)} values")
        return _pack_items(self.item, value)

    def unpack(self, data: bytes, offset: int) -> tuple[tuple[Any, ...], int]:
        return _unpack_items(self.item, data, offset, self.count)


@dataclass(frozen=True, slots=True)
class List:
    """A count, then that number of values of one kind, as a tuple."""

    length: Kind
    item: Kind

    @property
    def label(self) -> str:
        return f"{self.length.label} count, {self.item.label} each"

    @property
    def least(self) -> int:
        return self.length.least

    def pack(self, value: Sequence[Any]) -> bytes:
        return self.length.pack(len(value)) + _pack_items(self.item, value)

    def unpack(self, data: bytes, offset: int) -> tuple[tuple[Any, ...], int]:
        count, offset = self.length.unpack(data, offset)
        return _unpack_items(self.item, data, offset, count)


def _pack_items(item: Kind, values: Sequence[Any]) -> bytes:
    if isinstance(item, Number):
        return item.pack_many(values)
    return b"".join(item.pack(value) for value in values)


def _unpack_items(item: Kind, data: bytes, offset: int, count: int) -> tuple[tuple[Any, ...], int]:
    assert item.least > 0
    if count * item.least > len(data) - offset:
        raise FormatError(f"{count} values of at least {item.least} bytes, {len(data) - offset} bytes left")
    if isinstance(item, Number):
        return item.unpack_many(data, offset, count)
    values = []
    for _ in range(count):
        value, offset = item.unpack(data, offset)
        values.append(value)
    return tuple(values), offset


def _take(data: bytes, offset: int, size: int) -> tuple[bytes, int]:
    _check_room(data, offset, size)
    return bytes(data[offset : offset + size]), offset + size


def _check_room(data: bytes, offset: int, size: int) -> None:
    if size > len(data) - offset:
        raise FormatError(f"{size} bytes needed at byte {offset}, {max(len(data) - offset, 0)} left")
