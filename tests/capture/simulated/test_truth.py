"""The truth of a simulated rig is read back; missing, damaged or inconsistent parts are refused."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from meshreel.capture.simulated.simulated_rig import LABELS, TRUTH, SceneFrame, simulate_rig
from meshreel.capture.simulated.truth import read_truth
from meshreel.errors import InputError
from meshreel.io.write import write_mesh
from meshreel.types import Mesh
from tests.capture.depth_scenes import camera
from tests.metrics.shapes import moved, plane, sphere

FRAMES = [SceneFrame.of([moved(plane(4.0), (-2, -2, 1))], [sphere(0.3, 2 + number)]) for number in range(2)]
CAMERAS = (camera(size=16), camera("side", 30.0, 16))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rig")
    simulate_rig(folder, FRAMES, CAMERAS, 24.0)
    return folder / TRUTH


@pytest.fixture
def folder(written, tmp_path):
    """A copy that may be damaged."""
    return shutil.copytree(written, tmp_path / "truth")


def test_a_simulated_truth_is_read_back(written):
    truth = read_truth(written)
    assert len(truth) == 2 and truth.frame_rate == 24.0
    assert [one.name for one in truth.cameras] == ["front", "side"]
    for number, frame in enumerate(FRAMES):
        assert np.array_equal(truth[number].dynamic, frame.dynamic)
        assert np.allclose(truth[number].mesh.vertices, frame.mesh.vertices, atol=1e-6)
        assert np.array_equal(truth[number - 2].mesh.faces, frame.mesh.faces)
    with pytest.raises(IndexError):
        truth[2]


def test_a_missing_part_is_named(folder):
    (folder / "frame_00001.ply").unlink()
    with pytest.raises(InputError, match="1 clean meshes and labels of 2 frames, unlike in frame_00001"):
        read_truth(folder)
    (folder / "frame_00000.ply").unlink()
    with pytest.raises(InputError, match="no clean meshes"):
        read_truth(folder)
    (folder / "rig.json").unlink()
    with pytest.raises(InputError, match=r"rig\.json"):
        read_truth(folder)


@pytest.mark.parametrize("data", [b"", b"PK\x03\x04", b"no archive", None])
def test_unreadable_labels_are_refused(folder, data):
    (folder / LABELS).unlink()
    if data is not None:
        (folder / LABELS).write_bytes(data)
    with pytest.raises(InputError, match="labels cannot be read"):
        read_truth(folder)


def test_every_truncation_of_the_labels_is_refused(folder):
    whole = (folder / LABELS).read_bytes()
    for size in range(0, len(whole), 37):
        (folder / LABELS).write_bytes(whole[:size])
        with pytest.raises(InputError):
            read_truth(folder)


def test_labels_as_objects_are_not_unpickled(folder):
    np.savez(folder / LABELS, frame_00000=np.array([{}], object), frame_00001=np.zeros(3, np.uint8))
    with pytest.raises(InputError, match="labels cannot be read"):
        read_truth(folder)


@pytest.mark.parametrize("bits", [np.zeros(1, np.uint8), np.zeros(10_000, np.uint8), np.zeros(25, np.int64)])
def test_labels_of_another_mesh_are_refused_with_the_frame(folder, bits):
    np.savez(folder / LABELS, frame_00000=bits, frame_00001=np.packbits(FRAMES[1].dynamic))
    truth = read_truth(folder)
    assert truth[1].dynamic.sum() == FRAMES[1].dynamic.sum()
    with pytest.raises(InputError, match=r"frame_00000\.ply.*bit a face"):
        truth[0]


def test_a_damaged_clean_mesh_is_refused(folder):
    (folder / "frame_00000.ply").write_bytes(b"ply\n")
    with pytest.raises(InputError, match="frame_00000"):
        read_truth(folder)[0]


def test_an_empty_frame_may_be_read(folder):
    write_mesh(Mesh.empty(), folder / "frame_00000.ply")
    np.savez(folder / LABELS, frame_00000=np.zeros(0, np.uint8), frame_00001=np.packbits(FRAMES[1].dynamic))
    assert read_truth(folder)[0].mesh.is_empty
