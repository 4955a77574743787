"""What tests keep is made once for equal keys, and again where a key, or what a path holds, is another."""

from pathlib import Path

import pytest

from tests import kept as keeping
from tests.kept import kept


def test_a_file_is_made_once_for_equal_keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(keeping, "_folder", lambda: tmp_path)
    made = list[Path]()

    def make(path: Path) -> int:
        path.write_bytes(b"file")
        made.append(path)
        return len(made)

    (source := tmp_path / "source").write_bytes(b"1")
    first = kept(make, "a.reel", source, 50.0)
    assert kept(make, "a.reel", source, 50.0) == first and first[0].read_bytes() == b"file" and first[1] == 1
    source.write_bytes(b"2")
    assert kept(make, "a.reel", source, 50.0)[1] == 2 and kept(make, "a.reel", source, 60.0)[1] == 3
    assert not made[0].parent.exists()  # it was renamed when it was whole
