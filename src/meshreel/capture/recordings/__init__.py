"""Recordings of other programs: RGB-D folders and files, which become the folder of a rig.

Each format has a reader, a module with KIND, `fits` and `read`, found by the entry points `meshreel.recordings`.
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Protocol, runtime_checkable

from ...errors import InputError
from ..rig.rig import RIG, SINGLE
from .takes import Take, reading

PLUGINS = "meshreel.recordings"


@runtime_checkable
class Reader(Protocol):
    """A module that reads one format."""

    KIND: str  # what it reads, for users

    @staticmethod
    def fits(path: Path) -> bool:
        """Return whether a file or folder looks like this format, by its name and what is in the folder."""

    @staticmethod
    def read(path: Path) -> Take:
        """Return its contents; pictures are read on access to their stream. May raise any exception for damage."""


@cache
def readers() -> tuple[Reader, ...]:
    """Return all readers, by the names of their entry points."""
    return tuple(entry.load() for entry in sorted(entry_points(group=PLUGINS), key=lambda entry: entry.name))


def is_rig(path: Path) -> bool:
    """Return whether a folder is a rig's. Raises InputError for a folder without permission."""
    try:
        return any((path / name).is_file() for name in (RIG, SINGLE))
    except PermissionError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check its rights") from None


def is_take(path: Path) -> bool:
    """Return whether some reader knows a file or folder; a rig is none."""
    try:
        return not is_rig(path) and any(reader.fits(path) for reader in readers())
    except (OSError, InputError):  # a name that is too long, or a folder without permission
        return False


def open_take(path: Path) -> Take:
    """Return the contents of a recording. Raises InputError if no reader supports it, or if it cannot be read."""
    if not path.exists():
        raise InputError(f"{path}: no such file or folder; check the path")
    if is_rig(path):
        raise InputError(f"{path}: is a rig, which no other recording joins; give it alone")
    found = [reader for reader in readers() if reader.fits(path)]
    if len(found) > 1:
        kinds = " and ".join(reader.KIND for reader in found)
        raise InputError(f"{path}: is {kinds} at once; move the files of one into a folder of their own")
    if found:
        with reading(path):
            return found[0].read(path)
    known = "; ".join(reader.KIND for reader in readers())
    text = "is neither the folder of a rig (rig.json, camera.json) nor a recording that can be read"
    raise InputError(f"{path}: {text}: {known}; nor point clouds (.ply, .pcd, .npz, .las, .laz)")
