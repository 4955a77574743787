"""Rows alike for every codec: rates of all bytes, analyses that points share, sampled scenes, pictures."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Event

import numpy as np
import pytest
from meshreel_bench import fresh, peers, rd_rows, runner
from meshreel_bench.apart import make_apart
from meshreel_bench.bench import Bench
from meshreel_bench.cli import describe
from meshreel_bench.codec import TwoStepCodec
from meshreel_bench.codecs import codec_names, make_codec
from meshreel_bench.codecs.tvmc import TvmcCodec
from meshreel_bench.curves import SSIM_WITHOUT_KEYS, value
from meshreel_bench.datasets import open_known
from meshreel_bench.measure import measure_point
from meshreel_bench.rd_rows import FLOOR, RATED, SAMPLED
from meshreel_bench.rows import Point
from meshreel_bench.runner import run_points, runs_of
from PIL import Image

from meshreel.capture.procedural import sliding_sphere
from meshreel.encoder.sequence import encode
from meshreel.errors import InputError
from meshreel.geometry.derived_sequences import Chosen
from meshreel.metrics.comparison import ComparisonOptions
from meshreel.metrics.viewpoints import ViewOptions
from tests.small_options import quick
from tests.small_scene import scene

BALLS = sliding_sphere(3, levels=2)
QUICK = ComparisonOptions(views=ViewOptions(96, 64))
ROOM = "procedural_room"
FRAMES = 4  # of it
SCENE = scene(4)


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A folder with `ball`, and another to keep things in."""
    folder = tmp_path_factory.mktemp("rated")
    np.savez(folder / "ball.npz", vertices=np.stack([mesh.vertices for mesh in BALLS]), faces=BALLS[0].faces)
    return Bench(folder, "figure6", QUICK, folder / "rows.cache")


@pytest.fixture(scope="module")
def room(bench):
    """The procedural room, captured."""
    return open_known(ROOM, bench.data, FRAMES, bench.cache)


def test_a_body_is_judged_by_all_frames_and_drawn(bench):
    row = measure_point(Point("ball", "draco", {"qp": 9}, kind=RATED), bench)
    data = make_codec("draco", {"qp": 9}).encode(BALLS)
    assert row["bytes"] == len(data) and row["mbps"] == pytest.approx(len(data) * 8 * 30 / 3 / 1e6)
    assert row["measured_frames"] == [0, 1, 2] and row["frames_compared"] == 3 and len(row["per_frame"]) == 3
    assert (
        0.9 < row["ssim_masked"] <= 1
        and 0.9 < row["ssim"] <= 1
        and row["decode"]["frames"] == 3
        and "truth_ssim" not in row
    )
    folder, named = bench.cache.with_suffix(".pictures"), row["pictures"]
    sizes = {Image.open(folder / named[name]).size for name in ("original", "normals", "errors")}
    assert named["frame"] == 1 and sizes == {(900, 900)}
    errors = np.asarray(Image.open(folder / named["errors"]))
    seen = (np.asarray(Image.open(folder / named["original"])) < 255).any(axis=2)
    assert (errors[~seen] == 255).all() and (errors[seen] < 255).any(axis=1).all()


def test_a_scene_is_judged_by_some_frames_from_where_its_cameras_stood(bench, room, monkeypatch):
    monkeypatch.setattr(rd_rows, "SOME", 3)
    some = measure_point(Point(ROOM, "draco", {"qp": 9}, FRAMES, SAMPLED), bench)
    numbers = some["measured_frames"]
    assert numbers == [0, 3] and (some["frames"], some["coded_frames"]) == (FRAMES, 3)
    data = make_codec("draco", {"qp": 9}).encode(Chosen(room.sequence, [0, 2, 3]))
    assert some["mbps"] == pytest.approx(len(data) * 8 * 30 / 3 / 1e6)
    whole = measure_point(Point(ROOM, "draco", {"qp": 9}, FRAMES, RATED), bench)  # of it the same frames are measured
    assert whole["coded_frames"] == FRAMES and whole["measured_frames"] == numbers
    for a, b in zip(whole["per_frame"], some["per_frame"], strict=True):
        assert a == pytest.approx(b, rel=0.02)
    assert some["groups"] == [] and value(some, SSIM_WITHOUT_KEYS) is None  # groups count in frames, metrics do not
    floor = measure_point(Point(ROOM, "captured", {}, FRAMES, FLOOR), bench)
    assert floor["codec"] == rd_rows.TRUTH_ITSELF and "mbps" not in floor
    assert some["truth_ssim_masked"] < floor["truth_ssim_masked"] + 0.01  # no better than what it is made of
    assert floor["ssim_masked"] < some["ssim_masked"]  # and nearer to it than the truth
    assert "to the input" in describe(floor) and "Mbps" in describe(some)


def test_a_floor_needs_a_truth(bench):
    with pytest.raises(InputError, match="needs the truth"):
        measure_point(Point("ball", "captured", {}, kind=FLOOR), bench)


TWO_STEPS = {
    "meshreel": {"preset": "best", "quality": 20.0},
    "decimated_draco": {"fraction": 0.2, "qp": 9},
    "background_once_draco": {"fraction": 0.2, "qp": 9},
    "necgs": {"resolution": 16, "channels": 8, "epochs": 20, "fitting": 2},
    "tvmc": {"qp": 7, "vertices": 300, "centers": 60},
}


def test_codecs_in_two_steps_are_those_that_say_so():
    assert {kind for kind in codec_names() if isinstance(make_codec(kind, {}), TwoStepCodec)} == set(TWO_STEPS)


@pytest.fixture
def small(monkeypatch):
    """Encoders that are quick."""
    for name in ("meshreel", "background_once", "tvmc.codec"):
        monkeypatch.setattr(f"meshreel_bench.codecs.{name}.preset_options", quick)


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("kind", TWO_STEPS)
def test_two_steps_give_the_bytes_of_one_and_leave_the_analysis_as_it_was(kind, tmp_path):
    if kind == "necgs":
        pytest.importorskip("torch", reason="the extra necgs is not installed: MESHREEL_NECGS=1 ./scripts/setup")
    codec = make_codec(kind, TWO_STEPS[kind])
    analysis = codec.analyse(SCENE)
    data = codec.code(analysis)
    assert len(codec.decode(data)) == len(SCENE)
    if kind == "meshreel":  # whose analysis test_scene.py uses twice
        encode(SCENE, tmp_path / "a.reel", codec.encoder_options)
        assert data == (tmp_path / "a.reel").read_bytes()
    else:
        assert data == codec.code(analysis) == codec.encode(SCENE)


def test_tsmc_as_the_paper_has_it_and_tvmc_are_tracked_together():
    paper = [Point("ball", "meshreel", {"preset": "paper", "basis_size": size}, kind=RATED) for size in (2, 4)]
    best = [Point("ball", "meshreel", {"quality": quality}, kind=RATED) for quality in (20.0, 60.0)]
    tvmc = [Point("ball", "tvmc", {"qp": qp}, kind=RATED) for qp in (5, 9)]
    finer = Point("ball", "tvmc", {"vertices": 3000}, kind=RATED)
    assert runs_of([*paper, finer, *tvmc]) == [[*paper, *tvmc], [finer]]
    assert runs_of([replace(point, options=point.options | {"preset": "best"}) for point in best]) == [
        [replace(point, options=point.options | {"preset": "best"}) for point in best]
    ]


@pytest.mark.usefixtures("small")
def test_points_of_one_analysis_are_measured_together_and_analysed_once(bench, monkeypatch, tmp_path):
    points = [
        Point("ball", "tvmc", TWO_STEPS["tvmc"] | changed, kind=RATED)
        for changed in ({"qp": 6}, {"vertices": 200}, {"qp": 8})
    ]
    draco = Point("ball", "draco", {}, kind=RATED)
    assert runs_of([points[0], draco, *points[1:]]) == [[points[0], points[2]], [draco], [points[1]]]
    assert runs_of([Point("ball", "draco", {"qp": -1}, kind=RATED)]) != []  # told when it is measured
    calls = []
    track = TvmcCodec.analyse
    monkeypatch.setattr(TvmcCodec, "analyse", lambda *a: calls.append(a) or track(*a))
    quick_bench = replace(bench, comparison=ComparisonOptions(ssim=False), cache=None)
    rows = run_points(points, tmp_path / "rows.jsonl", quick_bench, lambda *_: None)
    assert len(calls) == 2 and [row["options"]["qp"] for row in rows] == [6, 7, 8]
    assert rows[0]["bytes"] < rows[2]["bytes"]
    for row in rows:  # each has paid for the tracking
        assert row["encode_stages_s"]["track"] > 0 and row["encode_s"] >= row["encode_stages_s"]["track"]
    assert rows[0]["encode_stages_s"]["track"] == rows[2]["encode_stages_s"]["track"]


def test_side_by_side_the_longest_runs_come_first(bench, monkeypatch, tmp_path):
    came = []

    def measured(point, *_):
        came.append(point.codec)
        return {"point": point.key, "sequence": point.sequence, "codec": point.codec}

    monkeypatch.setattr(runner, "measure_point", measured)
    draco = [Point("ball", "draco", {"qp": qp}, kind=RATED) for qp in (7, 8)]
    smaller = [Point("ball", "decimated_draco", {"fraction": 0.2, "qp": qp}, kind=RATED) for qp in (7, 8, 9)]
    with ThreadPoolExecutor(1) as executor:
        rows = run_points([*draco, *smaller], tmp_path / "rows.jsonl", bench, lambda *_: None, executor)
    assert came == ["decimated_draco"] * 3 + ["draco"] * 2
    assert [row["codec"] for row in rows] == ["draco"] * 2 + ["decimated_draco"] * 3  # told in their order


def test_side_by_side_a_sequence_is_made_beside_the_runs_of_others(bench, monkeypatch, tmp_path):
    """And runs wait for their own, the longest of those that can begin first."""
    came, begun = [], Event()

    def measured(point, *_):
        came.append(point.sequence)
        begun.set()
        return {"point": point.key, "sequence": point.sequence}

    def make(sequence, frames, _):
        came.append(f"{sequence} of {frames}")
        assert begun.wait(60)  # while it is made, others are measured

    monkeypatch.setattr(runner, "measure_point", measured)
    monkeypatch.setattr(runner, "make_apart", make)
    rooms = [Point(ROOM, "decimated_draco", {"qp": qp}, FRAMES, RATED) for qp in (7, 8)]
    ball = Point("ball", "draco", {}, kind=RATED)
    with ThreadPoolExecutor(2) as executor:
        rows = run_points([*rooms, ball], tmp_path / "rows.jsonl", bench, lambda *_: None, executor)
    assert sorted(came[:2]) == ["ball", f"{ROOM} of {FRAMES}"] and came[2:] == [ROOM, ROOM]
    assert [row["sequence"] for row in rows] == [ROOM, ROOM, "ball"]


def test_a_sequence_is_made_in_a_process_and_what_is_missing_is_told(bench, tmp_path):
    make_apart(ROOM, 2, replace(bench, cache=tmp_path / "rows.cache"))
    assert (tmp_path / "rows.cache" / f"{ROOM}-2").is_dir()
    point = Point("room2", "draco", {}, kind=RATED)
    with pytest.raises(InputError, match="lr_kt2"), ThreadPoolExecutor(1) as executor:
        run_points([point], tmp_path / "rows.jsonl", bench, lambda *_: None, executor)
    assert not (tmp_path / "rows.jsonl").exists()


def test_rows_of_an_experiment_that_measures_alike_count(bench, monkeypatch, tmp_path):
    point, file = Point("ball", "draco", {"qp": 7}, kind=RATED), tmp_path / "rows.jsonl"
    [row] = run_points([point], file, bench, lambda *_: None)
    monkeypatch.setattr(runner, "measure_point", lambda *_: pytest.fail("measured again"))
    other = Bench(bench.data, "table2", QUICK, bench.cache, alike=("figure6", "table2"))
    [again] = run_points([point], file, other, lambda *_: None)
    assert again == row | {"experiment": "table2"} and len(file.read_text().splitlines()) == 2


def test_a_decoder_that_is_another_in_a_fresh_process_is_refused(bench, monkeypatch):
    asked = peers.run_fresh
    monkeypatch.setattr(peers, "run_fresh", lambda *a: asked(*a) | {fresh.FRAMES: ["0" * 64] * 3})
    with pytest.raises(InputError, match="draco decodes another frame 0 in a fresh process"):
        measure_point(Point("ball", "draco", {"qp": 9}, kind=RATED), bench)


def test_pictures_of_any_sequence_are_beside_the_rows(bench, tmp_path):
    """A sequence may be a path."""
    place = str(bench.data / "ball.npz")
    for name in (place, str(bench.data / ".." / bench.data.name / "ball.npz")):
        row = measure_point(Point(name, "draco", {"qp": 9}, 1, RATED), replace(bench, cache=tmp_path / "rows.cache"))
        folder, named = tmp_path / "rows.pictures", row["pictures"]
        assert {named[key] for key in ("original", "normals", "errors")} <= {path.name for path in folder.iterdir()}
    assert len(list(folder.iterdir())) == 6 and [path.name for path in bench.data.glob("*.png")] == []
