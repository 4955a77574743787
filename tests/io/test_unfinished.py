"""An output in the making has one name: a living process keeps it, and a dead one's is taken over."""

import os
import subprocess
import sys

import pytest

from meshreel.errors import InputError
from meshreel.io.write import check_apart, claim, discard, part_of, replacing, unfinished

HOLD = """
import sys, time
from pathlib import Path
from meshreel.io.write import unfinished
with unfinished(Path(sys.argv[1])) as file:
    file.write(b"half")
    file.flush()
    print("writing", flush=True)
    time.sleep(float(sys.argv[2]))
"""


def holder(path, seconds=60.0):
    """Another process that is writing a file for some time."""
    process = subprocess.Popen([sys.executable, "-c", HOLD, path, str(seconds)], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "writing\n"
    return process


def test_a_living_process_keeps_its_file_and_a_killed_ones_is_taken_over(tmp_path):
    path = tmp_path / "a.ply"
    path.write_bytes(b"old")
    other = holder(path)
    with pytest.raises(InputError, match=r"a.ply: another process is writing it; wait for its end"), unfinished(path):
        raise AssertionError("the block must not run")
    assert path.read_bytes() == b"old" and part_of(path).read_bytes() == b"half"
    other.kill()
    other.wait()
    assert [file.name for file in sorted(tmp_path.iterdir())] == [".a.ply.part", "a.ply"]
    with unfinished(path) as file:
        file.write(b"new")
    assert path.read_bytes() == b"new" and list(tmp_path.iterdir()) == [path]


def test_a_short_write_waits_for_another_and_the_last_one_stays(tmp_path):
    path = tmp_path / "a.ply"
    other = holder(path, seconds=0.3)
    with replacing(path) as file:
        file.write(b"last")
    assert other.wait() == 0 and path.read_bytes() == b"last" and list(tmp_path.iterdir()) == [path]


def test_a_name_that_was_renamed_while_its_lock_was_awaited_is_made_again(tmp_path, monkeypatch):
    name, real, calls = tmp_path / "x", os.open, []

    def renamed_meanwhile(path, *rest):
        calls.append(path)
        number = real(path, *rest)
        if len(calls) == 1:
            path.rename(tmp_path / "finished")
        return number

    monkeypatch.setattr(os, "open", renamed_meanwhile)
    file = claim(name, tmp_path / "y")
    file.write(b"mine")
    file.close()
    assert len(calls) == 2 and name.read_bytes() == b"mine" and (tmp_path / "finished").read_bytes() == b""


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX files")
def test_a_link_or_a_pipe_of_that_name_is_not_followed(tmp_path):
    path, other = tmp_path / "a.ply", tmp_path / "other"
    other.write_bytes(b"precious")
    part_of(path).symlink_to(other)
    with pytest.raises(InputError, match=r"a.ply: cannot be written"), unfinished(path):
        raise AssertionError("the block must not run")
    part_of(path).unlink()
    os.mkfifo(part_of(path))
    with pytest.raises(InputError, match=r".a.ply.part: is no regular file.* move it away"), unfinished(path):
        raise AssertionError("the block must not run")
    assert other.read_bytes() == b"precious"


@pytest.mark.parametrize("name", ["n" * 250 + ".reel", "ü" * 125 + ".reel"])
@pytest.mark.parametrize("hidden", [True, False])
def test_any_name_that_a_file_may_have_has_an_unfinished_one(tmp_path, name, hidden):
    found = part_of(tmp_path / name, hidden)
    assert found.suffix == ".part" and len(os.fsencode(found.name)) <= 255
    assert found != part_of(tmp_path / ("m" + name[1:]), hidden)
    file = claim(found, tmp_path / name)
    discard(file, found)
    assert list(tmp_path.iterdir()) == []


def test_an_output_that_is_an_input_is_refused_by_whatever_name(tmp_path):
    scan, out = tmp_path / "a.ply", tmp_path / "a.reel"
    scan.write_bytes(b"scan")
    check_apart(out, [scan])
    out.hardlink_to(scan)
    with pytest.raises(InputError, match=r"a.reel: is the input .*a.ply, which the output would replace; choose"):
        check_apart(out, [scan])
    out.unlink()
    out.symlink_to(scan)
    with pytest.raises(InputError, match="is the input"):
        check_apart(out, [tmp_path / "gone.ply", scan])


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_may_not_be_written_is_reported(tmp_path):
    tmp_path.chmod(0o500)
    try:
        with (
            pytest.raises(InputError, match=r"a.ply: cannot be written \(Permission denied\)"),
            unfinished(tmp_path / "a.ply"),
        ):
            raise AssertionError("the block must not run")
    finally:
        tmp_path.chmod(0o700)
