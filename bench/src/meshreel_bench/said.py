"""What others say, in a line. In -> out: a text, or the exit code of a process and the file that it said things to ->
words fit for a terminal."""

from __future__ import annotations

import os
from typing import IO

LONGEST = 300  # characters of what a process said last
_TAIL = 1 << 16  # bytes of it that are read: it may have said gigabytes


def one_line(text: str) -> str:
    """A text without ends of lines, and with ? for what else moves a terminal's cursor or colours it."""
    return "".join(sign if sign.isprintable() else "?" for sign in " ".join(text.split()))


def last_words(code: int, said: IO[bytes]) -> str:
    """How a process has ended, and the last line that it said."""
    size = said.seek(0, os.SEEK_END)
    said.seek(max(0, size - _TAIL))
    lines = said.read().decode(errors="replace").strip().splitlines()
    ended = f"ended by signal {-code}" if code < 0 else f"exit code {code}"
    return f"{ended}: {lines[-1][:LONGEST]}" if lines else ended
