"""SHA-256 of the benchmark data that the published rows were measured on; other data of the same name are refused."""

from __future__ import annotations

import hashlib
import json
import sys
from functools import cache
from importlib.resources import files
from pathlib import Path

from meshreel.capture.calibration.colors import REMEMBERED
from meshreel.errors import InputError

TABLE = "checksums.json"  # package data: by path below the benchmark data; `python -m` this with their folder writes it


def check_source(path: Path, known_as: Path) -> None:
    """Raise InputError where `path` is there and is not the benchmark data called `known_as`, if these are known."""
    expected = known_checksums().get(known_as.as_posix())
    if expected is None or not path.exists():
        return
    found = checksum(path)
    if found != expected:
        text = f"{path}: SHA-256 {found[:12]}, and {expected[:12]} is that of the benchmark's {known_as.as_posix()}"
        raise InputError(f"{text}; copy it again, or give your own data another name")


@cache
def known_checksums() -> dict[str, str]:
    """Return the checksums by path below the benchmark data."""
    table: dict[str, str] = json.loads((files(__package__) / TABLE).read_text(encoding="utf-8"))
    return table


def write_checksums(data: Path, table: Path) -> None:
    """Replace the checksums in a table by those of the benchmark data in a folder; a new entry may have any value."""
    found = {name: checksum(data / name) for name in sorted(json.loads(table.read_text(encoding="utf-8")))}
    table.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file, or of a folder's names and contents. InputError for unreadable ones."""
    try:
        listed = sorted(p for p in path.rglob("*") if p.is_file() and p.name != REMEMBERED) if path.is_dir() else [path]
        stamps = [(file, file.stat()) for file in listed]
        return _checksum(path, tuple((file, stat.st_size, stat.st_mtime_ns) for file, stat in stamps))
    except OSError as error:
        text = f"{error.filename}: cannot be read ({error.strerror})"
        raise InputError(f"{text}; check the path and its rights") from None


@cache
def _checksum(path: Path, stamps: tuple[tuple[Path, int, int], ...]) -> str:
    if path.is_file():
        return hashlib.sha256(path.read_bytes()).hexdigest()
    digest = hashlib.sha256()
    for file, _, _ in stamps:
        data = file.read_bytes()
        digest.update(f"{file.relative_to(path).as_posix()} {len(data)}\n".encode())
        digest.update(data)
    return digest.hexdigest()


if __name__ == "__main__":
    write_checksums(Path(sys.argv[1]), Path(__file__).with_name(TABLE))
