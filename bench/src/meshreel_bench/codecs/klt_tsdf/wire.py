"""Numbers and blobs one after the other: whole numbers as LEB128, doubles as IEEE, blobs behind their length."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

from meshreel.errors import FormatError


@dataclass(slots=True)
class Writer:
    """Collects the bytes of a record."""

    data: bytearray = field(default_factory=bytearray)

    def number(self, value: int) -> None:
        """A whole number from 0 on."""
        while value >= 0x80:
            self.data.append(value & 0x7F | 0x80)
            value >>= 7
        self.data.append(value)

    def integer(self, value: int) -> None:
        """A whole number of any sign."""
        self.number(2 * value if value >= 0 else -2 * value - 1)

    def real(self, value: float) -> None:
        """A double."""
        self.data += struct.pack("<d", value)

    def blob(self, data: bytes) -> None:
        """Bytes and, before them, how many."""
        self.number(len(data))
        self.data += data


@dataclass(slots=True)
class Reader:
    """Reads what a `Writer` has written; FormatError where there is not so much, or a number over its bound."""

    data: bytes
    at: int = 0

    def take(self, size: int) -> bytes:
        """So many bytes."""
        if size > len(self.data) - self.at:
            raise FormatError(f"byte {self.at}: {size} bytes are missing of {len(self.data)}; the stream is truncated")
        self.at += size
        return self.data[self.at - size : self.at]

    def number(self, most: int) -> int:
        """A whole number from 0 to `most`."""
        value, shift = 0, 0
        while True:
            byte = self.take(1)[0]
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                break
            if shift > 63:
                raise FormatError(f"byte {self.at}: a number without an end; the stream is damaged")
        if value > most:
            raise FormatError(f"byte {self.at}: {value} is over {most}; the stream is damaged")
        return value

    def integer(self, most: int) -> int:
        """A whole number of any sign, its magnitude at most `most`."""
        value = self.number(2 * most)
        return value // 2 if value % 2 == 0 else -(value + 1) // 2

    def real(self) -> float:
        """A double."""
        value: float = struct.unpack("<d", self.take(8))[0]
        return value

    def blob(self) -> bytes:
        """Bytes behind their length."""
        return self.take(self.number(len(self.data)))

    def end(self) -> None:
        """Raises FormatError where something is left."""
        if self.at != len(self.data):
            raise FormatError(f"{len(self.data) - self.at} bytes too many; the stream is damaged")
