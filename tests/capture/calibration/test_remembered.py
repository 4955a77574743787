"""Corrections of colour cameras are found once for a rig, and again when anything that they depend on has changed."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest
from PIL import Image

from meshreel.capture import recording as recordings
from meshreel.capture.calibration.colors import Correction
from meshreel.capture.calibration.remembered import REMEMBERED, remembered
from meshreel.capture.recording import open_recording
from meshreel.capture.rig.fusion import FusionOptions
from meshreel.capture.rig.rig import read_rig
from tests.capture.depth_scenes import camera, record

FOUND = tuple(Correction(np.full(3, 0.1 * (k + 1)), np.arange(6) / 700 - k) for k in range(2))


@pytest.fixture
def folder(tmp_path):
    folder = record(tmp_path / "rig", [camera("left", -20), camera("right", 20)], [(0.1 * k, 0, 0) for k in range(3)])
    described = json.loads((folder / "rig.json").read_text())
    for entry in described["cameras"]:
        entry["color"] = f"{entry['name']}/color"
        (folder / entry["color"]).mkdir()
        for number in range(3):
            Image.new("RGB", (96, 96), (90, 80, 70)).save(folder / entry["color"] / f"{number}.png")
    (folder / "rig.json").write_text(json.dumps(described))
    return folder


@pytest.fixture
def asked(monkeypatch):
    """Numbers of frames that corrections were found from, one for each time."""
    found = []
    monkeypatch.setattr(recordings, "corrections_of", lambda frames, *_: found.append(len(frames)) or FOUND)
    return found


def same(corrections):
    pairs = zip(corrections, FOUND, strict=True)
    return all(np.array_equal(a.gains, b.gains) and np.array_equal(a.pose, b.pose) for a, b in pairs)


def test_all_frames_of_a_rig_tell_once_whichever_are_asked_for(folder, asked):
    described = (folder / "rig.json").read_bytes()
    part = open_recording(folder, frames="1:2")[0]
    assert asked == []  # nobody looked at a picture
    (left, right), raw = part.colors[0], part.pictures[0]
    assert asked == [3] and same(part.colors.corrections)
    assert left.gains != right.gains and not np.array_equal(left.camera.extrinsic, raw[0].camera.extrinsic)
    np.testing.assert_array_equal(left.pixels, raw[0].pixels)
    again = open_recording(folder)[0].colors
    assert same(again.corrections) and asked == [3] and (folder / "rig.json").read_bytes() == described
    assert same(pickle.loads(pickle.dumps(again)).corrections)


def test_other_poses_pictures_and_options_are_calibrated_again(folder, asked):
    def looked(options=FusionOptions()):
        return same(open_recording(folder, options)[0].colors.corrections)

    assert looked() and looked(FusionOptions(0.03)) and looked() and asked == [3] * 3
    described = json.loads((folder / "rig.json").read_text())
    described["cameras"][0]["camera_to_world"][0][3] += 0.001
    (folder / "rig.json").write_text(json.dumps(described))
    assert looked() and asked == [3] * 4
    Image.new("RGB", (96, 96), (1, 200, 3)).save(folder / "left" / "color" / "1.png", compress_level=0)
    assert looked() and looked() and asked == [3] * 5


@pytest.mark.parametrize(
    "damage",
    [
        lambda record: record["cameras"][0]["log2_gains"].append(1.0),
        lambda record: record["cameras"][0].update(motion=[float("nan")] * 6),
        lambda record: record["cameras"][0].update(name="other"),
        lambda record: record["cameras"].append(record["cameras"][0]),
        lambda record: record.update(cameras=5),
        lambda record: record["cameras"].pop(),
    ],
)
def test_a_damaged_file_is_found_again(folder, damage):
    rig = read_rig(folder)
    assert same(remembered(rig, [0, 2], {}, lambda: FOUND))
    record = json.loads((folder / REMEMBERED).read_text())
    damage(record)
    (folder / REMEMBERED).write_text(json.dumps(record))
    assert same(remembered(rig, [0, 2], {}, lambda: FOUND))
    (folder / REMEMBERED).write_bytes(b"[" * 100_000)
    assert same(remembered(rig, [0, 2], {}, lambda: FOUND))


def test_that_nothing_is_to_be_mended_is_remembered_too(folder):
    rig, asked = read_rig(folder), []
    assert [remembered(rig, [0], {}, lambda: asked.append(1) or ()) for _ in range(2)] == [(), ()] and len(asked) == 1


def test_a_folder_that_may_not_be_written_stays_as_it_is(folder):
    before = sorted(folder.iterdir())
    folder.chmod(0o555)
    try:
        assert same(remembered(read_rig(folder), [0], {}, lambda: FOUND)) and sorted(folder.iterdir()) == before
    finally:
        folder.chmod(0o755)
