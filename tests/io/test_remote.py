"""Files behind URLs are found, read and written as files on a disk are; what is not there is an error that names it."""

import re
import subprocess
import sys
import tempfile

import fsspec
import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.io.file_names import find_frames
from meshreel.io.files import Remote, located, uploaded
from meshreel.io.sequence import open_sequence
from meshreel.io.write import write_mesh
from tests.spheres import sliding_sphere


@pytest.fixture
def store():
    """Files in memory, behind memory://."""
    store = fsspec.filesystem("memory")
    yield store
    store.rm("/", recursive=True)


@pytest.fixture
def scan(tmp_path, store):
    """A folder of four frames that `capture` wrote, also behind memory://scan."""
    (tmp_path / "scan").mkdir()
    for number, mesh in enumerate(sliding_sphere(4, levels=1)):
        write_mesh(mesh, tmp_path / "scan" / f"frame_{number}.ply")
    (tmp_path / "scan" / "capture.json").write_text('{"up": "z"}')
    store.put(f"{tmp_path}/scan/", "/scan", recursive=True)
    return tmp_path / "scan"


def alike(one, other):
    assert len(one) == len(other) and one.up == other.up and one.warnings == other.warnings
    for a, b in zip(one, other, strict=True):
        assert np.array_equal(a.vertices, b.vertices) and np.array_equal(a.faces, b.faces)


@pytest.mark.parametrize("name", ["", "/", "/frame_[1-9].ply", "/*", "/frame_2.ply"])
def test_frames_are_those_of_a_disk(scan, name):
    alike(open_sequence(f"memory://scan{name}"), open_sequence(f"{scan}{name}"))


def test_a_list_may_mix_urls_and_paths(scan):
    both = open_sequence(["memory://scan/frame_3.ply", scan / "frame_0.ply"])
    alike(both, open_sequence([scan / "frame_3.ply", scan / "frame_0.ply"]))
    assert both.files == (scan / "frame_0.ply",) and both.name(0) == "frame 0 (memory://scan/frame_3.ply)"


@pytest.mark.parametrize(
    "names",
    [
        ["f10.obj", "f9.obj", ".f1.obj", "f1.txt"],
        ["v2_take1.obj", "v2_take11.obj", "v2_take2.obj"],
        ["b.obj", "a.obj"],
        ["a1.obj", "b2.obj"],
        ["f1.obj", "f01.obj"],
        ["f1.obj", "f2.ply"],
        ["f1.txt"],
    ],
)
@pytest.mark.parametrize("pattern", ["", "/*.obj", "/*9/*.obj"])
def test_names_are_chosen_and_ordered_as_on_a_disk(tmp_path, store, names, pattern):
    folder = tmp_path / "take9" / "v9"
    folder.mkdir(parents=True)
    for name in names:
        (folder / name).write_bytes(b"v")
    (tmp_path / "take9" / "c9").mkdir()
    store.put(f"{tmp_path}/take9/", "/take9", recursive=True)
    source = "take9/v9" + pattern if "9" not in pattern else "take9" + pattern

    def found(root):
        try:
            paths, remarks = find_frames(f"{root}{source}")
        except InputError as error:
            return re.split(r"^.*?: |;", str(error))[1].replace("no mesh file fits this pattern", "holds 0 mesh files")
        names = [str(path).replace("\\", "/").rsplit("take9", 1)[1] for path in paths]
        return names, [text.split(": ", 1)[1] for text in remarks]

    assert found("memory://") == found(f"{tmp_path}/")


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("memory://nowhere", r"^memory://nowhere: cannot be read \(FileNotFoundError: /nowhere\); check the URL"),
        ("memory://scan/take_*.ply", "^memory://scan/take_[*].ply: holds 0 mesh files"),
        ("moon://a", r"^moon://a: cannot be read \(ValueError: Protocol not known: moon"),
        ("memory://scan/a.npz", "^memory://scan/a.npz: an .npz is not read by URL"),
        ("file://elsewhere", "^file://elsewhere: cannot be read"),
    ],
)
@pytest.mark.usefixtures("scan")
def test_what_is_not_there_is_refused(source, words):
    with pytest.raises(InputError, match=words):
        open_sequence(source)


@pytest.mark.usefixtures("scan")
def test_a_file_that_is_gone_is_named_with_its_frame(store):
    sequence = open_sequence("memory://scan")
    store.rm("/scan/frame_2.ply")
    with pytest.raises(InputError, match=r"^frame 2 \(memory://scan/frame_2.ply\): cannot be read \(FileNotFoundError"):
        sequence[2]


def test_more_bytes_than_a_file_may_have_are_refused(store, monkeypatch):
    # Only by name: in s3fs, the version of a file comes before the range.
    monkeypatch.setattr(store, "cat_file", lambda _, *, start, end: b"12345"[start:end])
    assert Remote("memory://a").read(5) == b"12345"
    with pytest.raises(OSError, match="more than the 4 bytes"):
        Remote("memory://a").read(4)


@pytest.mark.parametrize("module", ["fsspec.core", "s3fs"])
def test_a_package_that_is_missing_is_named_with_the_extra(monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=rf"^s3://a: .*{module.split('.')[0]}.*pip install 'meshreel\[remote\]'"):
        open_sequence("s3://a")
    with pytest.raises(InputError, match=r"^s3://a/b.reel: .*'meshreel\[remote\]'"), uploaded(Remote("s3://a/b.reel")):
        pass


@pytest.mark.parametrize(
    ("name", "remote"), [("s3://a", True), ("C://a", False), ("a/b", False), ("1a://b", False), ("git+x://b", True)]
)
def test_a_scheme_makes_a_url(name, remote):
    assert isinstance(located(name), Remote) == remote and isinstance(located(located(name)), Remote) == remote


def test_an_output_is_uploaded_when_it_is_complete(store, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    store.pipe("/out/a.reel", b"old")
    with pytest.raises(KeyboardInterrupt), uploaded(Remote("memory://out/a.reel")) as path:
        path.write_bytes(b"half")
        raise KeyboardInterrupt
    assert store.cat("/out/a.reel") == b"old" and not list(tmp_path.iterdir())
    with uploaded(Remote("memory://out/a.reel")) as path:
        path.write_bytes(b"whole")
        assert path.name == "a.reel" and store.cat("/out/a.reel") == b"old"
    assert store.cat("/out/a.reel") == b"whole" and not list(tmp_path.iterdir())


def test_what_cannot_be_uploaded_is_kept(store, tmp_path, monkeypatch):
    def fails(*_):
        raise RuntimeError("no\nroom")

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(store, "put_file", fails)
    said = r"^memory://a.reel: cannot be written \(RuntimeError: no room\); (.*) is complete: copy it there$"
    with pytest.raises(InputError, match=said) as caught, uploaded(Remote("memory://a.reel")) as path:
        path.write_bytes(b"whole")
    assert str(path) in str(caught.value) and path.read_bytes() == b"whole"


@pytest.mark.parametrize(
    ("url", "words"), [("https://a/b.reel", "takes no output"), ("moon://a", "Protocol not known")]
)
def test_what_takes_no_file_is_refused_before_the_work(url, words):
    with pytest.raises(InputError, match=f"^{url}: .*{words}"), uploaded(Remote(url)):
        pytest.fail("the work began")


def test_paths_need_no_fsspec(scan):
    code = (
        "import sys; from meshreel.io.sequence import open_sequence as o; from meshreel.io.files import *\n"
        f"o({str(scan)!r})[0]\nwith uploaded(located('a')): pass\nsys.exit('fsspec' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
