"""A recording fuses each frame once, keeps it while the disk has room, and gives its depth pictures."""

from __future__ import annotations

import shutil
import signal
import sys
import tempfile

import numpy as np
import pytest

from meshreel.capture.recording import Kept, open_recording
from meshreel.geometry.derived_sequences import captured, picked
from meshreel.types import Mesh
from tests.capture import depth_scenes
from tests.capture.depth_scenes import camera

CAMERAS = [camera("left", -20), camera("right", 20)]
TRIANGLE = Mesh.of(np.array([[0, 0, 1 / 3], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])


@pytest.fixture
def recording(tmp_path):
    folder = depth_scenes.record(tmp_path / "rig", CAMERAS, [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)])
    return open_recording(folder)[0]


def test_a_frame_is_fused_once_and_is_the_same_again(recording, monkeypatch):
    first = recording[1]
    monkeypatch.setattr("meshreel.capture.recording.fuse_depths", None)
    again = recording[1]
    assert np.array_equal(first.vertices, again.vertices) and np.array_equal(first.faces, again.faces)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows deletes the file when it is closed")
def test_kept_meshes_are_in_a_file_without_a_name_that_no_killed_process_leaves(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    kept = Kept()
    kept.put(3, TRIANGLE)
    kept.put(4, Mesh.empty())
    again = kept.get(3)
    assert np.array_equal(again.vertices, TRIANGLE.vertices) and np.array_equal(again.faces, TRIANGLE.faces)
    assert kept.get(2) is None and kept.get(4).is_empty
    assert kept._file.fileno() and list(tmp_path.iterdir()) == []


def test_on_a_full_disk_frames_are_fused_again(recording, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("meshreel.capture.recording.tempfile.TemporaryFile", full)
    first, again = recording[0], recording[0]
    assert np.array_equal(first.vertices, again.vertices) and not recording._kept._places


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of a file's size")
def test_a_disk_that_fills_while_a_frame_is_kept_costs_no_kept_frame():
    import resource

    kept, most = Kept(), resource.getrlimit(resource.RLIMIT_FSIZE)
    kept.put(1, TRIANGLE)
    heeded = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, most[1]))
    try:
        kept.put(2, TRIANGLE)
        again = kept.get(1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, most)
        signal.signal(signal.SIGXFSZ, heeded)
    assert np.array_equal(again.vertices, TRIANGLE.vertices) and kept.get(2) is None


def test_without_keep_no_frame_is_stored(tmp_path, monkeypatch):
    folder = depth_scenes.record(tmp_path / "rig", CAMERAS, [(0.0, 0.0, 0.0)])
    monkeypatch.setattr("meshreel.capture.recording.Kept", None)
    assert not open_recording(folder, keep=False)[0][0].is_empty


def test_depth_pictures_are_given_per_camera_and_none_for_a_missing_one(tmp_path):
    folder = depth_scenes.record(tmp_path / "rig", CAMERAS, [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)])
    (folder / "right" / "depth" / "depth_00001.png").unlink()
    found, _ = open_recording(folder)
    assert captured(found) is found and picked(found, [1]).depth is not None
    both, one = found.depth[0], found.depth[1]
    assert [picture is not None for picture in both] == [True, True]
    assert one[0] is not None and one[1] is None
    assert np.array_equal(one[0].depth, found.rig.depth(0, 1)) and one[0].unit == CAMERAS[0].depth_unit
    shutil.rmtree(folder)
