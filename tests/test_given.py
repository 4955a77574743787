"""Paths, bytes and files that public functions are given: they are used, or named with their type and a remedy."""

import io
import mmap
import os
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.errors import InputError, MeshreelError
from meshreel.export.animated_file import export
from meshreel.export.frames import write_splats
from meshreel.io.write import write_mesh
from tests.golden import GOLDEN

FILE = GOLDEN / "layers.reel"
MESH = meshreel.Mesh.of(np.eye(3), np.array([[0, 1, 2]]))
pytestmark = pytest.mark.skipif(os.environ.get("MESHREEL_SHAPES") != "0", reason="annotations refuse these types first")


class Named:
    """A path of another library."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __fspath__(self) -> str:
        return self.name


def mapped() -> mmap.mmap:
    with FILE.open("rb") as file:
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)


DATA = FILE.read_bytes()
OF_BYTES = {
    "bytes": lambda: DATA,
    "bytearray": lambda: bytearray(DATA),
    "memoryview": lambda: memoryview(DATA),
    "mmap": mapped,
    "array": lambda: np.frombuffer(DATA, np.uint8),
}
OTHERS = OF_BYTES | {
    "BytesIO": lambda: io.BytesIO(DATA),
    "StringIO": lambda: io.StringIO("x"),
    "path in bytes": lambda: os.fsencode(FILE),
    "int": lambda: 5,
    "float": lambda: 0.5,
    "None": lambda: None,
    "list": lambda: [1, 2],
}
ENTRIES = {
    "encode": lambda given: meshreel.encode([MESH, MESH], given),
    "encode sequence": lambda given: meshreel.encode(given, "a.reel"),
    "as_sequence": meshreel.as_sequence,
    "open_sequence": meshreel.open_sequence,
    "cut": lambda given: meshreel.edit.cut(given, "a.reel", "1:2"),
    "cut to": lambda given: meshreel.edit.cut(FILE, given, "1:2"),
    "cut frames": lambda given: meshreel.edit.cut(FILE, "a.reel", given),
    "concat": lambda given: meshreel.edit.concat([given], "a.reel"),
    "concat all": lambda given: meshreel.edit.concat(given, "a.reel"),
    "concat to": lambda given: meshreel.edit.concat([FILE], given),
    "retime": lambda given: meshreel.edit.retime(given, "a.reel", speed=2),
    "transform": lambda given: meshreel.edit.transform(given, "a.reel", 2),
    "tag": lambda given: meshreel.edit.tag(given, "a.reel"),
    "write_mesh": lambda given: write_mesh(MESH, given),
    "write_splats": lambda given: write_splats(None, given),
    "export": lambda given: export(meshreel.open(FILE).reader, given),
}


@pytest.mark.parametrize("kind", OTHERS)
@pytest.mark.parametrize("entry", ENTRIES)
def test_an_object_that_is_no_path_is_refused_by_its_type(entry, kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    try:
        made = ENTRIES[entry](OTHERS[kind]())
    except InputError as error:
        assert "give" in str(error), error
    else:  # no frame, or files that are missed when they are read
        assert entry in ("as_sequence", "open_sequence") and kind == "StringIO" and len(made) in (0, 1)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("given", [str(FILE), FILE, Named(str(FILE))], ids=lambda given: type(given).__name__)
def test_paths_of_all_kinds_are_used(given, tmp_path):
    with meshreel.open(given) as video:
        assert len(video) == 14
    assert meshreel.edit.cut(given, Named(str(tmp_path / "a.reel")), "1:3").frames == 2
    assert meshreel.edit.concat(given, tmp_path / "b.reel").frames == 14  # one file alone
    write_mesh(MESH, str(tmp_path / "a.obj"))
    assert len(meshreel.open_sequence(Named(str(tmp_path / "a.obj")))) == 1


@pytest.mark.parametrize("kind", [*OF_BYTES, "BytesIO"])
def test_bytes_of_all_kinds_are_opened(kind):
    video, wanted = meshreel.open(OTHERS[kind]()), meshreel.open(FILE)
    assert all(np.array_equal(a.vertices, b.vertices) for a, b in zip(video, wanted, strict=True))


@pytest.mark.parametrize("kind", [kind for kind in OTHERS if kind not in (*OF_BYTES, "BytesIO")])
def test_what_is_no_recording_is_refused_by_its_type(kind):
    with pytest.raises(MeshreelError, match=r"is no path; give a|give its bytes|not a \.reel file"):
        meshreel.open(OTHERS[kind]())


@pytest.mark.parametrize("kind", [kind for kind in OTHERS if kind not in ("None", "array")])
def test_audio_is_bytes_or_a_path(kind, tmp_path):
    sound = meshreel.open(GOLDEN / "audio/audio.reel").audio.data
    if kind in OF_BYTES:
        given = {"bytes": bytes, "bytearray": bytearray, "memoryview": memoryview}.get(kind, memoryview)(sound)
        meshreel.edit.tag(FILE, tmp_path / "a.reel", audio=given)
        assert meshreel.open(tmp_path / "a.reel").audio.data == sound
        return
    with pytest.raises(InputError, match="give"):
        meshreel.edit.tag(FILE, Path(tmp_path, "a.reel"), audio=OTHERS[kind]())
