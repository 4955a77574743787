"""Input files are regular and of bounded size: pipes, devices and sparse files end at once, with file and frame."""

import os
import sys
import time
import tracemalloc

import pytest

import meshreel
from meshreel.analysis.scene.masks import read_view_file
from meshreel.capture.rig.rig import read_rig, write_rig
from meshreel.capture.simulated.simulated_rig import read_truth
from meshreel.encoder.run.interval_files import IntervalFiles
from meshreel.errors import InputError
from meshreel.io import files
from meshreel.io.files import read_file
from meshreel.io.pictures import read_depth, read_mask
from meshreel.io.sequence import open_sequence
from meshreel.io.write import replacing
from tests.capture.depth_scenes import camera

posix = pytest.mark.skipif(sys.platform == "win32", reason="POSIX files")


def sparse(path):
    with path.open("wb") as file:
        file.truncate(5_000_000_000)


def zeros(path):
    path.symlink_to("/dev/zero")


@posix
@pytest.mark.parametrize(
    ("make", "words"),
    [(os.mkfifo, "pipe or a device"), (zeros, "pipe or a device"), (sparse, "5000000000 bytes, more")],
)
@pytest.mark.parametrize("extension", ["ply", "obj", "glb", "stl", "off"])
def test_what_is_no_mesh_file_ends_at_once_and_takes_no_memory(tmp_path, make, words, extension):
    make(tmp_path / f"frame_0.{extension}")
    tracemalloc.start()
    begun = time.process_time()
    with pytest.raises(InputError, match=rf"frame 0 \(.*frame_0.{extension}\): cannot be read \(it (is|has).*{words}"):
        open_sequence([tmp_path / f"frame_0.{extension}"])[0]
    assert time.process_time() - begun < 5 and tracemalloc.get_traced_memory()[1] < 10_000_000
    tracemalloc.stop()


@posix
@pytest.mark.parametrize("make", [os.mkfifo, zeros, sparse])
@pytest.mark.parametrize("of", [read_depth, read_mask])
def test_what_is_no_picture_ends_at_once(tmp_path, make, of):
    make(tmp_path / "depth_0.png")
    with pytest.raises(InputError, match=r"depth_0.png: cannot be read \(it "):
        of(tmp_path / "depth_0.png")


@posix
@pytest.mark.parametrize("make", [os.mkfifo, zeros, sparse])
def test_what_is_no_description_of_a_rig_ends_at_once(tmp_path, make):
    make(tmp_path / "rig.json")
    with pytest.raises(InputError, match=r"rig.json: cannot be read \(it .*check it and its rights"):
        read_rig(tmp_path)


def truth(folder):
    """The folder as the truth of a simulated rig, but for its labels."""
    write_rig(folder, (camera(),), 30.0)
    (folder / "frame_00000.ply").touch()
    return folder


@posix
@pytest.mark.parametrize("make", [os.mkfifo, zeros, sparse])
@pytest.mark.parametrize(
    ("name", "of"),
    [
        ("cameras.json", lambda folder: read_view_file(folder / "cameras.json")),
        ("dynamic.npz", lambda folder: read_truth(truth(folder))),
    ],
)
def test_what_are_no_cameras_or_labels_ends_at_once(tmp_path, make, name, of):
    make(tmp_path / name)
    with pytest.raises(InputError, match=rf"{name}: .*cannot be read \(it "):
        of(tmp_path)


@posix
def test_a_pipe_among_frames_is_refused_and_not_left_out(tmp_path):
    for number in (0, 2):
        (tmp_path / f"f_{number}.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    os.mkfifo(tmp_path / "f_1.obj")
    sequence = open_sequence(tmp_path)
    with pytest.raises(InputError, match=r"f_1.obj\): cannot be read \(it is a pipe"):
        sequence[1]


@posix
def test_a_pipe_in_place_of_a_video_ends_at_once(tmp_path):
    os.mkfifo(tmp_path / "a.reel")
    with pytest.raises(InputError, match=r"a.reel is no binary file that can seek"):
        meshreel.open(tmp_path / "a.reel")


@posix
@pytest.mark.parametrize("opened", [IntervalFiles, replacing])
def test_a_pipe_in_place_of_the_output_is_not_replaced(tmp_path, opened):
    os.mkfifo(tmp_path / "a.reel")
    with pytest.raises(InputError, match=r"a.reel: is a pipe or a device"), opened(tmp_path / "a.reel"):
        pass
    assert (tmp_path / "a.reel").is_fifo() and len(list(tmp_path.iterdir())) == 1


def test_an_archive_of_nothing_but_zeros_ends_at_once(tmp_path):
    sparse(tmp_path / "a.npz")
    with pytest.raises(InputError, match=r"a.npz: cannot be read as .npz"):
        open_sequence(tmp_path / "a.npz")


def test_a_file_that_grows_while_it_is_read_is_bounded(tmp_path, monkeypatch):
    (tmp_path / "a").write_bytes(bytes(100))
    monkeypatch.setattr(files, "MOST_BYTES", 99)
    monkeypatch.setattr(
        os, "fstat", lambda number, real=os.fstat: os.stat_result([*real(number)[:6], 9, *real(number)[7:10]])
    )
    with pytest.raises(OSError, match="more than the 99"):
        read_file(tmp_path / "a")
