"""Where the optional benchmark data lies; tests that need it skip, with the reason, where it is missing."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1].parent / "shared" / "data"


def performer(name: str) -> Path:
    """The folder (or file) of one captured performer."""
    path = ROOT / "performers" / name
    if not path.exists():
        pytest.skip(f"benchmark data not present: {path}")
    return path
