"""The files of a library, and the facts of each."""

import os
import sys
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from meshreel.errors import InputError
from meshreel.server import heads
from meshreel.server.app import make_app
from meshreel.server.heads import HeadReader
from meshreel.server.library import Library
from tests.server.conftest import ODD, with_long_head

BYTES_AS_NAMES = sys.platform == "linux"


def link(path, target, **options):
    try:
        path.symlink_to(target, **options)
    except OSError:
        pytest.skip("this system lets nobody make links")


def test_files_of_all_folders_are_listed_in_order_and_hidden_ones_are_not(folder):
    (folder / ".git").mkdir()
    (folder / "Big").mkdir()
    (folder / "a folder.reel").mkdir()
    for name in (".git/x.reel", ".hidden.reel", "Big/b.REEL", "notes.reel.txt"):
        (folder / name).write_bytes(b"x")
    assert Library(folder).names() == ["Big/b.REEL", "cut.reel", "none.reel", f"sub/{ODD}", "walk.reel"]
    assert [Library(folder).path_of(name) for name in (".git/x.reel", ".hidden.reel", "a folder.reel")] == [None] * 3


@pytest.mark.parametrize(
    "name",
    ["", ".reel", "..", "../outside.reel", "sub/../walk.reel", "./walk.reel", "/walk.reel", "sub//walk.reel"]
    + ["..\\outside.reel", "sub\\..\\walk.reel", "walk.reel\0", "walk\0.reel", "secret.txt", "secret.txt\0.reel"]
    + ["walk.reel/", "walk.reel/x.reel", "a" * 300 + ".reel", "a/" * 3000 + "b.reel"],
)
def test_a_name_that_does_not_lead_straight_down_is_none(folder, name):
    assert Library(folder).path_of(name) is None
    assert Library(folder).path_of("walk.reel") == (folder / "walk.reel").resolve()


def test_an_absolute_name_is_none(folder):
    assert Library(folder).path_of(str(folder / "walk.reel")) is None


def test_links_are_followed_inside_of_the_folder_alone(folder):
    link(folder / "inside.reel", folder / "walk.reel")
    link(folder / "out", folder.parent, target_is_directory=True)
    library = Library(folder)
    assert library.path_of("inside.reel") == (folder / "walk.reel").resolve()
    assert library.path_of("out/outside.reel") is None and "inside.reel" in library.names()
    assert not any(name.startswith("out") for name in library.names())


def test_links_in_a_circle_break_nothing(folder, player):
    link(folder / "round.reel", "round.reel")
    link(folder / "up", folder, target_is_directory=True)
    client = TestClient(make_app(Library(folder), player))
    assert client.get("/files/round.reel").status_code == client.get("/watch/round.reel").status_code == 404
    assert "round" not in client.get("/").text


def test_a_folder_that_is_a_link_itself_is_served(folder):
    link(folder.parent / "shortcut", folder, target_is_directory=True)
    assert Library(folder.parent / "shortcut").names() == Library(folder).names()


@pytest.mark.skipif(not BYTES_AS_NAMES, reason="names are Unicode on this system")
def test_a_name_that_is_no_text_is_reported_and_breaks_nothing(folder, player):
    with open(os.fsencode(folder) + b"/\xff\xfe.reel", "wb") as file:  # noqa: PTH123  (bytes as a name)
        file.write(b"x")
    page = TestClient(make_app(Library(folder), player)).get("/")
    assert page.status_code == 200 and "no Unicode text" in page.text and "??" in page.text
    with pytest.raises(InputError, match="rename it"):
        Library.of_file(folder / os.fsdecode(b"\xff\xfe.reel"))


@pytest.mark.skipif(not BYTES_AS_NAMES, reason="names are Unicode on this system")
def test_a_folder_whose_name_is_no_text_is_served(folder, player):
    odd = folder.rename(folder.parent / os.fsdecode(b"caf\xe9"))
    client = TestClient(make_app(Library(odd), player))
    page = client.get("/")
    assert page.status_code == 200 and "caf?" in page.text
    assert client.get("/files/walk.reel").status_code == 200


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_a_pipe_is_no_file_to_wait_for(folder):
    os.mkfifo(folder / "pipe.reel")
    assert Library(folder).path_of("pipe.reel") is None


def facts_of(library):
    return {entry.name: entry for entry in library.entries()}


def test_errors_in_the_gallery_have_no_path_of_this_machine(folder, monkeypatch):
    def refused(_, path):
        raise InputError(f"{path}: cannot be opened: Permission denied")

    monkeypatch.setattr(HeadReader, "read", refused)
    assert facts_of(Library(folder))["walk.reel"].error == "cannot be opened: Permission denied"


def test_a_file_that_went_away_is_reported(folder, monkeypatch):
    monkeypatch.setattr(Library, "names", lambda _: ["gone.reel"])
    (entry,) = Library(folder).entries()
    assert (entry.frames, entry.error) == (0, "is not there any more")
    with HeadReader() as process, pytest.raises(InputError, match=r"gone\.reel: cannot be opened: No such file"):
        process.read(folder / "gone.reel")


def test_one_file_is_served_whatever_its_suffix(folder, player):
    (folder / "walk.reel").rename(folder / "walk.bin")
    client = TestClient(make_app(Library.of_file(folder / "walk.bin"), player))
    assert client.get("/files/walk.bin").status_code == 200
    assert client.get("/files/cut.reel").status_code == client.get("/files/secret.txt").status_code == 404


@pytest.fixture
def opened(monkeypatch):
    """Names of the files whose heads were read."""
    names: list[str] = []
    read = HeadReader.read
    monkeypatch.setattr(HeadReader, "read", lambda self, path: names.append(path.name) or read(self, path))
    return names


def test_a_gallery_of_500_files_reads_the_heads_of_changed_files_alone(folder, opened):
    for number in range(500):
        (folder / f"{number}.reel").write_bytes(b"none")
    facts = Library(folder)
    first = facts.entries()
    assert len(opened) == len(first) == 504
    opened.clear()
    assert facts.entries() == first and opened == []
    old = (folder / "7.reel").stat()
    (folder / "7.reel").write_bytes((folder / "cut.reel").read_bytes())
    (folder / "8.reel").unlink()
    (folder / "9.reel").rename(folder / "renamed.reel")
    os.utime(folder / "7.reel", ns=(old.st_atime_ns, old.st_mtime_ns))
    changed = {entry.name: entry for entry in facts.entries()}
    assert opened == ["7.reel", "renamed.reel"] and "truncated" in changed["7.reel"].error
    assert "8.reel" not in changed and len(changed) == 503


def test_a_folder_of_more_files_than_any_memory_of_them_is_read_once(folder, opened):
    for number in range(5000):
        (folder / f"{number}.reel").symlink_to("none.reel")
    facts = Library(folder)
    assert len(facts.entries()) == 5004 and len(opened) == 4
    assert len(facts.entries()) == 5004 and len(opened) == 4


def test_a_head_of_64_mib_is_not_read_for_the_gallery_and_the_file_still_plays(folder, player):
    with_long_head(folder / "long.reel", 64)
    entry = facts_of(Library(folder))["long.reel"]
    assert (entry.size, entry.frames, entry.error) == ((folder / "long.reel").stat().st_size, 0, "")
    page = TestClient(make_app(Library(folder), player)).get("/").text
    assert '<a href="/watch/long.reel">' in page and "not a .reel file" in page


def test_a_head_that_takes_too_long_or_too_much_memory_costs_its_file_alone_and_once(folder, monkeypatch):
    with_long_head(folder / "bomb.reel", 1 - 1e-3)
    monkeypatch.setattr(heads, "PATIENCE", 1e-3)
    library = Library(folder)
    assert "its head takes more than 0.001 s or 2 GiB to read" in facts_of(library)["bomb.reel"].error
    monkeypatch.undo()
    monkeypatch.setattr(HeadReader, "read", lambda *_: pytest.fail("read again"))
    assert "takes more than" in facts_of(library)["bomb.reel"].error
    monkeypatch.undo()
    (folder / "walk.reel").touch()
    assert facts_of(library)["walk.reel"].frames > 0


def test_files_beyond_the_time_of_a_gallery_are_read_by_the_next_one(folder, monkeypatch):
    library = Library(folder)
    monkeypatch.setattr(heads, "SHARE", -1.0)
    late = facts_of(library)["walk.reel"]
    assert (late.size, late.frames, late.error) == ((folder / "walk.reel").stat().st_size, 0, "")
    monkeypatch.undo()
    assert facts_of(library)["walk.reel"].frames > 0


def test_no_head_is_read_in_the_process_of_the_server(folder, monkeypatch):
    monkeypatch.setattr("meshreel.container.reader.ReelReader.__init__", lambda *_: pytest.fail("read here"))
    assert facts_of(Library(folder))["walk.reel"].frames > 0


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are those of Linux")
def test_the_process_that_reads_heads_has_a_limit_of_memory_and_ends_with_the_gallery(folder):
    with HeadReader() as process:
        process.read(folder / "walk.reel")
        began = process._process
        assert began is not None
        limits = Path(f"/proc/{began.pid}/limits").read_text()
        assert f"Max address space         {heads.MOST_MEMORY}" in limits
    assert began.returncode is not None
