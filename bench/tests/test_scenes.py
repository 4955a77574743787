"""Scenes: anchors on a small one whose truth is known, promises on rows made up, the noise floor in the report."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from meshreel_bench.codecs import make_codec
from meshreel_bench.datasets import scenes as module
from meshreel_bench.datasets.rooms import RoomOptions
from meshreel_bench.datasets.scenes import SceneData, SceneFrames, open_scene
from meshreel_bench.experiments import scenes
from meshreel_bench.names import BEST
from meshreel_bench.report import write_report
from meshreel_bench.rows import Point
from meshreel_bench.scene_rows import BACKGROUND_S, FLOOR, MEMORY, SEGMENTATION, measure_scene, seams_of

from meshreel.capture.simulated_rig import SceneFrame, SensorOptions, simulate_rig
from meshreel.capture.truth import read_truth
from meshreel.errors import InputError
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.topology import drop_unreferenced
from meshreel.metrics.scene_comparison import compare_with_truth
from meshreel.types import Mesh, MeshList
from tests.capture.depth_scenes import camera
from tests.metrics.shapes import moved, plane, sphere

BACK = moved(plane(6.0, 4), (-3, -3, 0.8))
PLATE = Mesh.of(BACK.vertices, BACK.faces[:, ::-1])  # faces the cameras
FRAMES = [SceneFrame.of([PLATE], [moved(sphere(0.3, 3), (0.1 * n - 0.15, 0, 0))]) for n in range(4)]
QUIET = SensorOptions(noise=0.1, holes=0.0, flying=0.0)


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A folder in which the scene `room2-4` is a ball that slides before a plate."""
    folder = tmp_path_factory.mktemp("scenes.cache")
    cameras = tuple(camera(f"at{side}", side, 128) for side in (0, 40, 320))
    simulate_rig(folder / "room2-4" / "rig", FRAMES, cameras, 30.0, QUIET)
    return folder


@pytest.fixture(scope="module")
def scene(cache):
    return open_scene("room2", cache, cache, 4)


def point(codec, kind=scenes.SCENE, **options):
    return Point("room2", codec, options, 4, kind)


def test_a_scene_is_captured_once_and_kept(scene, cache):
    assert len(scene.meshes) == len(scene.truth) == 4 and scene.meshes.frame_rate == 30.0
    first = scene.folder / "meshes" / "frame_00000.ply"
    made = first.stat().st_mtime_ns
    again = open_scene("room2", cache, cache, 4)
    assert first.stat().st_mtime_ns == made and np.array_equal(again.meshes[0].faces, scene.meshes[0].faces)


def test_labels_are_those_of_the_nearest_clean_faces_or_those_of_a_file(scene):
    labels = [scene.labels(number) for number in range(4)]
    middles = scene.meshes[3].vertices[scene.meshes[3].faces].mean(axis=1)
    assert np.array_equal(labels[3], middles[:, 2] < 0.5) and labels[3].any()
    assert np.array_equal(scene.labels(3), labels[3])  # as kept
    path = scene.folder / "labels" / "planted.npz"
    np.savez(
        path, **{f"frame_{i:05}": np.packbits(~found) for i, found in enumerate(labels[:3])}, frame_00003=np.zeros(1)
    )
    assert np.array_equal(scene.labels(2, "planted"), ~labels[2])
    with pytest.raises(InputError, match="frame_00003 for"):
        scene.labels(3, "planted")
    with pytest.raises(InputError, match=r"none\.npz: no labels of frame_00000"):
        scene.labels(0, "none")
    np.savez(path, frame_00000=np.zeros(1))
    with pytest.raises(InputError, match="no labels of frame_00001"):
        scene.labels(1, "planted")


def test_labels_that_another_encoder_has_found_are_not_taken_for_this_ones(scene, monkeypatch):
    """Rows of a changed segmenter would have the numbers of the old one."""
    calls = []

    class Found:
        def moving(self, _, mesh):
            return np.full(len(mesh.faces), len(calls) == 2)

    monkeypatch.setattr(module, "segment", lambda meshes: calls.append(len(meshes)) or Found())
    module._kept_as.cache_clear()
    assert not scene.labels(0, "found").any() and not scene.labels(1, "found").any() and calls == [4]
    real = module.SegmentOptions
    monkeypatch.setattr(module, "SegmentOptions", lambda: real(island=0.5))
    module._kept_as.cache_clear()
    assert scene.labels(0, "found").all() and calls == [4, 4]
    monkeypatch.undo()
    module._kept_as.cache_clear()
    for path in (scene.folder / "labels").glob("found*"):
        path.unlink()


def test_the_background_is_what_stands_also_behind_what_moves(scene):
    still = scene.background()
    assert abs(np.median(still.vertices[:, 2]) - 0.8) < 0.003 and (still.vertices[:, 2] > 0.5).all()
    behind = moved(plane(0.6, 20), (-0.3, -0.3, 0.8)).vertices
    assert np.linalg.norm(Surface(still).closest(behind).points - behind, axis=1).max() < 0.01


@pytest.mark.parametrize(
    ("name", "options"),
    [("scene_draco", {"share": 0.3}), ("scene_draco", {"share": 0.3, "levels": 1}), ("background_draco", {})],
)
def test_an_anchor_decodes_to_the_scene(scene, name, options):
    codec = make_codec(name, options)
    data = codec.encode(SceneFrames(scene, (0, 2)))
    decoded = codec.decode(data)
    assert len(decoded) == 2
    row = compare_with_truth(SceneFrames(scene, (0, 2)), decoded, _Chosen(scene.truth, (0, 2)), [0, 1])
    assert row["decoded"]["people_median_m"] < 0.005 and row["decoded"]["background_median_m"] < 0.005
    assert row["decoded"]["covered"] > 0.9 and row["decoded"]["people_covered"] > 0.9
    if not options.get("levels"):  # decimation denoises
        assert row["noise_floor"]["normal_error_deg"] > row["decoded"]["normal_error_deg"]
    json.dumps(row, allow_nan=False)


class _Chosen:
    """Some clean frames."""

    def __init__(self, truth, numbers):
        self._truth, self._numbers, self.cameras = truth, numbers, truth.cameras

    def __len__(self):
        return len(self._numbers)

    def __getitem__(self, index):
        return self._truth[self._numbers[index]]


def test_a_background_that_is_sent_once_counts_once_in_ten_seconds(cache):
    row = measure_scene(point("background_draco", share=0.5), cache, cache)
    assert 0 < row["background_bytes"] < row["bytes"] and row["coded_frames"] == 1 and row["measured_frames"] == [0]
    moving = 8 * (row["bytes"] - row["background_bytes"]) * 30
    assert row["mbps"] == pytest.approx((moving + 8 * row["background_bytes"] / BACKGROUND_S) / 1e6)
    whole = measure_scene(point("scene_draco", share=0.5), cache, cache)
    assert whole["background_bytes"] == 0 and whole["mbps"] == pytest.approx(8 * whole["bytes"] * 30 / 1e6)
    assert whole["input_d2_psnr_forward"] > row["truth_d2_psnr_forward"]
    json.dumps([row, whole], allow_nan=False)


def test_the_noise_floor_is_the_input_against_the_truth(cache):
    row = measure_scene(point("captured", FLOOR), cache, cache)
    assert row["codec"] == scenes.NOISE_FLOOR and row["truth_people_median_m"] < 0.005
    assert not any(name.startswith("input_") for name in row)


def test_rows_of_a_stream_have_their_seams(scene, monkeypatch):
    ring = np.abs(np.linalg.norm(scene.meshes[0].vertices[:, :2] - (-0.15, 0), axis=1) - 0.3) < 0.1
    touching = ring[scene.meshes[0].faces].all(axis=1)  # some of the plate and of the ball's rim: they meet in labels
    parts = {"background": ~touching, "moving": touching}

    class Apart:
        """A video that has both parts of the frame as they are."""

        def background(self, index):
            del index
            return self._part("background")

        def moving(self, index):
            del index
            return self._part("moving")

        def _part(self, name):
            return drop_unreferenced(Mesh.of(scene.meshes[0].vertices, scene.meshes[0].faces[parts[name]]))

    monkeypatch.setattr(SceneData, "labels", lambda *_: touching)
    row = seams_of(scene, [0], Apart())
    assert row["seam_gap_mm_median"] < 0.01 and row["seam_uncovered"] == 0 and row["seam_mm"] > 0
    monkeypatch.setattr(SceneData, "labels", lambda *_: np.zeros_like(touching))
    assert set(seams_of(scene, [0, 0], Apart()).values()) == {None}
    json.dumps(row, allow_nan=False)


def test_found_labels_are_scored(cache, scene):
    labels = {f"frame_{i:05}": np.packbits(scene.labels(i)) for i in range(4)}
    np.savez(scene.folder / "labels" / "planted.npz", **labels)
    row = measure_scene(point("segmentation", SEGMENTATION, labels="planted"), cache, cache)
    assert (row["iou_mean"], row["iou_worst"], row["static_called_dynamic"]) == (1.0, 1.0, 0.0)


def test_what_makes_no_sense_is_refused(cache):
    with pytest.raises(InputError, match="known: room2, room2-standing"):
        RoomOptions("room3")
    with pytest.raises(InputError, match="0 frames"):
        RoomOptions(frames=0)
    with pytest.raises(InputError, match="folder that is kept"):
        measure_scene(point("scene_draco"), cache, None)
    with pytest.raises(InputError, match="for scenes with labels"):
        make_codec("scene_draco", {}).encode(MeshList((PLATE,)))
    for name, wrong in (("scene_draco", {"share": 0.0}), ("background_draco", {"background_share": 1.5})):
        with pytest.raises(InputError, match="0 < share <= 1"):
            make_codec(name, wrong)
    with pytest.raises(InputError, match="qp 30"):
        make_codec("background_draco", {"background_qp": 30})


def test_an_empty_truth_is_told(tmp_path):
    simulate_rig(tmp_path, [SceneFrame.of([], [])], (camera(size=16),), 30.0, QUIET)
    truth = read_truth(tmp_path / "truth")
    with pytest.raises(InputError, match="frame 0 of the truth has no faces"):
        compare_with_truth(MeshList((PLATE,)), MeshList((PLATE,)), truth, [0])


def row(codec, mbps, quality, **changed):
    """A measured point of room2; what is not given keeps the promises."""
    metrics = {
        "truth_d2_psnr_backward": 63.0,
        "truth_ssim_masked": 0.78,
        "input_d2_psnr_forward": quality,
        "input_ssim_masked": quality / 100,
        "input_people_d2_psnr_forward": quality,
        "input_people_ssim_masked": quality / 100,
        "truth_people_ssim_masked": 0.65,
        "truth_people_median_m": 0.002,
        "truth_people_normal_error_deg": 15.0,
        "truth_people_coverage_rms_m": 0.006,
        "truth_background_median_m": 0.001,
        "truth_background_covered": 0.996,
    }
    decode = {"frame_ms": 3.0, "first_frame_ms": 100.0}
    base = {"point": f"{codec} {mbps}", "kind": scenes.SCENE, "experiment": "scenes", "sequence": "room2"}
    base |= {"codec": codec, "options": {"quality": 50.0}, "frames": 60, "mbps": mbps, "background_bytes": 50_000}
    seam = {"seam_gap_mm_median": 4.25, "seam_gap_mm_95": 15.75, "seam_overlap_mm_median": 0.0}
    seam |= {"seam_overlap_mm_95": 8.0, "seam_uncovered": 0.002, "seam_mm": 2400.0}
    return base | metrics | seam | {"decode": decode, "encode_s": 5.0} | changed


FLOOR_ROW = row(scenes.NOISE_FLOOR, 0, 0, kind=FLOOR, point="floor", options={}) | {
    "truth_d2_psnr_backward": 60.0,
    "truth_ssim_masked": 0.6,
    "truth_people_ssim_masked": 0.5,
    "truth_people_median_m": 0.003,
    "truth_people_normal_error_deg": 18.0,
}
CURVE = ((0.4, 56.0), (0.5, 58.0), (0.6, 59.5), (0.7, 61.0))


def segmented(name):
    base = {"point": f"labels {name}", "kind": SEGMENTATION, "experiment": "scenes", "sequence": name, "frames": 60}
    scores = {"iou_mean": 0.97, "iou_worst": 0.93, "static_called_dynamic": 0.001}
    return base | {"codec": "segmentation", "options": {}} | scores


def memory(frames, peak):
    base = {"point": f"memory {frames}", "kind": MEMORY, "experiment": "scenes", "sequence": "room2"}
    return base | {"codec": "meshreel", "options": {}, "frames": frames, "peak_rss_mb": peak}


def test_memory_is_measured_in_a_fresh_process_that_takes_words(monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr("meshreel_bench.scene_rows.open_scene", lambda *_: None)
    monkeypatch.setattr(
        "meshreel_bench.peers.subprocess.run",
        lambda command, **_: asked.append(command) or SimpleNamespace(returncode=0, stdout='{"peak_rss_mb": 1}'),
    )
    points = [point for point in scenes.points(False) if point.kind == MEMORY]
    rows = [measure_scene(point, tmp_path, tmp_path) for point in points]
    assert [row["peak_rss_mb"] for row in rows] == [1, 1]
    assert all(isinstance(word, str) for command in asked for word in command)
    assert [command[-2:] for command in asked] == [["60", "50.0"], ["240", "50.0"]]


GOOD = [
    FLOOR_ROW,
    *(row(BEST, mbps, quality, options={"quality": 50.0 + i}) for i, (mbps, quality) in enumerate(CURVE)),
    *(row(scenes.ANCHORS["a"], 10 * mbps, quality) for mbps, quality in CURVE),
    *(row(scenes.ANCHORS["b"], 2 * mbps, quality) for mbps, quality in CURVE),
    segmented("room2"),
    segmented("room2-standing"),
    memory(60, 1000.0),
    memory(240, 1050.0),
]


def test_good_rows_keep_every_promise():
    found = scenes.promises(GOOD)
    assert [promise for promise in found if not promise.met] == [] and len(found) == 12


def test_without_rows_nothing_is_claimed():
    assert {promise.verdict for promise in scenes.promises([])} == {"not measured"}


def changed(rows, codec, **values):
    return [r | values if r["codec"] == codec else r for r in rows]


@pytest.mark.parametrize(
    ("name", "rows"),
    [
        ("room2: segmentation", [r | {"iou_worst": 0.89} if r["kind"] == SEGMENTATION else r for r in GOOD]),
        ("room2: background", changed(GOOD, BEST, background_bytes=61_000)),
        ("room2: background", changed(GOOD, BEST, background_bytes=0)),
        ("room2: rate", changed(GOOD, BEST, truth_ssim_masked=0.75)),
        ("room2: people to the truth, median", changed(GOOD, BEST, truth_people_median_m=0.0031)),
        ("room2: people to the truth, SSIM", changed(GOOD, BEST, truth_people_ssim_masked=0.59)),
        ("room2: people's coverage", changed(GOOD, BEST, truth_people_coverage_rms_m=0.0071)),
        ("room2: BD-rate against anchor b", changed(GOOD, scenes.ANCHORS["b"], mbps=0.6)),
        ("room2: encode", changed(GOOD, BEST, encode_s=6.1)),
        ("room2: decode", changed(GOOD, BEST, decode={"frame_ms": 5.1, "first_frame_ms": 100.0})),
        ("memory", [r | {"peak_rss_mb": 1101.0} if r["frames"] == 240 else r for r in GOOD]),
    ],
)
def test_one_part_that_falls_short_is_missed_alone(name, rows):
    missed = [promise for promise in scenes.promises(rows) if promise.met is False]
    assert len(missed) == 1 and missed[0].text.startswith(name), missed


def test_rates_are_compared_below_the_noise_floor_only():
    worse = [r | {"mbps": 9.0} if r["codec"] == BEST and r["mbps"] == 0.7 else r for r in GOOD]
    [found] = [p for p in scenes.promises(worse) if "anchor a" in p.text]
    assert "over 56 to 60" in found.value and found.met


def test_the_report_has_the_noise_floor_and_every_row(tmp_path):
    written = write_report(GOOD, {"scenes": scenes}, tmp_path)
    assert {path.name for path in written} == {"results.md", "index.html", "scenes-room2.png", "scenes-room2.svg"}
    page = (tmp_path / "results.md").read_text()
    assert "noise floor (the input against the truth)" in page and "nan" not in page
    assert page.count("| room2 | ") == 13 and "| room2 | meshreel best | quality 50.0 | 0.400 | 50.0 | 2.00 |" in page
    assert "BD-rate, D2 to the input, below the noise floor" in page
    told = "median (95 %): gap 4.2 (15.8) mm, overlap 0.0 (8.0) mm; surface near it uncovered 0.20%"
    assert page.count("seam of bodies") == 1 and told in page
    assert scenes.floors(GOOD)["input_d2_psnr_forward"] == 60.0 and scenes.floors(GOOD[1:]) == {}
