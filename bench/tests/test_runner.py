"""Measuring: rows that are whole, that are not measured twice, and that say what they were."""

from __future__ import annotations

import json
import os
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from meshreel_bench import measure
from meshreel_bench.bench import Bench
from meshreel_bench.bridges import count_bridges
from meshreel_bench.codec import Codec
from meshreel_bench.codecs import codec_names, make_codec
from meshreel_bench.datasets import open_dataset
from meshreel_bench.fresh import peak_rss_mb
from meshreel_bench.locked import locked
from meshreel_bench.measure import run_point
from meshreel_bench.peers import equal_anchor, run_fresh
from meshreel_bench.rows import Point, append_row, read_rows
from meshreel_bench.runner import run_points

from meshreel.capture.procedural import sliding_sphere
from meshreel.errors import InputError
from meshreel.format.layout import Form
from meshreel.geometry.derived_sequences import Backwards
from meshreel.metrics.comparison import ComparisonOptions
from meshreel.types import Mesh, MeshList
from tests.golden import GOLDEN
from tests.small_options import TRIALS

BALLS = sliding_sphere(2, levels=2)
QUICK = ComparisonOptions(ssim=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with one sequence, `ball`."""
    path = tmp_path_factory.mktemp("data")
    np.savez(path / "ball.npz", vertices=np.stack([mesh.vertices for mesh in BALLS]), faces=BALLS[0].faces)
    return path


def test_every_codec_follows_the_protocol_and_tells_its_options():
    for kind in codec_names():
        codec = make_codec(kind, {})
        assert isinstance(codec, Codec)
        assert make_codec(kind, codec.options) == codec
        json.dumps(codec.options)


@pytest.mark.parametrize(
    ("kind", "options", "words"),
    [
        ("mpeg", {}, "known: background_draco, background_once_draco"),
        ("draco", {"bits": 3}, "bits"),
        ("draco", {"qp": 1}, "qp 1"),
        ("decimated_draco", {"fraction": 0.0}, "fraction 0"),
    ],
)
def test_codecs_and_points_that_do_not_exist_are_told(kind, options, words):
    with pytest.raises(InputError, match=words):
        make_codec(kind, options)


@pytest.mark.parametrize("qp", [7, 10])
def test_draco_errs_by_no_more_than_its_lattice(qp):
    codec = make_codec("draco", {"qp": qp})
    found = codec.decode(codec.encode(BALLS))
    step = 2 / (2**qp - 3)
    for mesh, ball in zip(found, BALLS, strict=True):
        radius = np.linalg.norm(mesh.vertices - ball.vertices.mean(axis=0), axis=1)
        assert np.abs(radius - 1).max() <= step * 3**0.5 / 2 + 1e-9


def test_the_decimated_anchor_is_smaller_and_its_subdivision_is_free():
    codecs = [make_codec("decimated_draco", {"fraction": f, "levels": n}) for f, n in ((1.0, 0), (0.5, 0), (0.5, 1))]
    whole, small, subdivided = (codec.encode(BALLS) for codec in codecs)
    assert len(small) < len(whole) and len(subdivided) == len(small)
    assert len(codecs[2].decode(subdivided)[0].faces) == 4 * len(codecs[1].decode(small)[0].faces)


def test_anchors_keep_empty_frames():
    codec = make_codec("draco", {"qp": 9})
    video = codec.decode(codec.encode(MeshList((Mesh.empty(), BALLS[0]))))
    assert [mesh.is_empty for mesh in video] == [True, False]
    assert video.reader.groups[0].form == Form.EMPTY


def test_a_row_has_rate_times_memory_peer_and_every_metric():
    row = run_point("ball", BALLS, make_codec("draco", {"qp": 9}), QUICK)
    assert row["mbps"] == row["bytes"] * 8 * 30 / 2 / 1e6
    assert row["codec"] == "draco" and row["options"] == {"qp": 9} and row["frames"] == 2
    assert row["decode"]["frame_ms"] > 0 and row["decode"]["peak_rss_mb"] > 1
    assert row["peer"]["qp"] == 9
    assert row["decode_over_peer"] == pytest.approx(row["decode"]["frame_ms"] / row["peer"]["frame_ms"])
    assert set(row["encode_stages_s"]) == {"code"}
    assert row["bridges"] == [0, 0]
    assert {"d2_psnr_paper", "symmetric_psnr", "normal_error_deg", "d2_psnr_paper_worst"} <= set(row)
    json.dumps(row, allow_nan=False)


def test_points_that_have_rows_are_not_run_again(folder, tmp_path, monkeypatch):
    points, bench = [Point("ball", "draco", {"qp": qp}) for qp in (7, 8)], Bench(folder, comparison=QUICK)
    told: list[bool] = []
    first = run_points(points[:1], tmp_path / "rows.jsonl", bench, lambda _, new: told.append(new))
    rows = run_points(points, tmp_path / "rows.jsonl", bench, lambda _, new: told.append(new))
    assert told == [True, False, True]
    assert rows[0] == json.loads(json.dumps(first[0])) and rows == read_rows(tmp_path / "rows.jsonl")
    monkeypatch.setattr(measure, "run_point", lambda *_: pytest.fail("measured again"))
    assert run_points(points, tmp_path / "rows.jsonl", bench, lambda *_: None) == rows


def test_rows_of_another_experiment_are_another_matter(folder, tmp_path):
    points, file = [Point("ball", "draco", {"qp": 7}, kind="curve")], tmp_path / "rows.jsonl"
    for name in ("targets", "layers", "layers"):
        [row] = run_points(points, file, Bench(folder, name, QUICK), lambda *_: None)
        assert row["experiment"] == name
    assert len(read_rows(file)) == 2


def test_points_measured_side_by_side_keep_their_order_and_later_ones_see_them(folder, tmp_path):
    anchor = Point("ball", "decimated_draco", {"fraction": 1.0, "qp": 12, "levels": 1}, kind="curve")
    coarse = Point("ball", "decimated_draco", {"fraction": 0.5, "qp": 6, "levels": 0}, kind="curve")
    pair = Point("ball", coarse.codec, coarse.options, kind="decode")
    bench = Bench(folder, "layers", QUICK)
    with ThreadPoolExecutor(2) as executor:
        rows = run_points([pair, anchor, coarse], tmp_path / "rows.jsonl", bench, lambda *_: None, executor)
    assert [row["kind"] for row in rows] == ["decode", "curve", "curve"]
    assert rows[0]["anchor"]["options"] == anchor.options and rows[0]["frames"] == 2
    assert min(rows[0][name] for name in ("frame_ms", "draco_ms", "subdivided_ms")) > 0
    json.dumps(rows, allow_nan=False)


def test_a_pair_needs_a_row_of_its_own_and_an_anchor_as_good(folder, tmp_path):
    pair = Point("ball", "draco", {"qp": 9}, kind="decode")
    with pytest.raises(InputError, match="no quality row yet"):
        run_points([pair], tmp_path / "rows.jsonl", Bench(folder, comparison=QUICK), lambda *_: None)
    own = {"sequence": "ball", "codec": "draco", "frames": 2, "d2_psnr_paper": 60.0}
    with pytest.raises(InputError, match="best 55"):
        equal_anchor(own, [own | {"codec": "decimated_draco_subdivided", "d2_psnr_paper": 55.0}])


def test_a_curve_row_has_rate_groups_and_a_few_metrics_of_each_frame(folder):
    row = measure.measure_point(Point("ball", "draco", {"qp": 9}, kind="curve"), Bench(folder, comparison=QUICK))
    assert row["mbps"] > 0 and set(row["per_frame"][0]) < set(measure.CURVE_METRICS)
    assert [group["frames"] for group in row["groups"]] == [1, 1] and "decode" not in row
    assert sum(group["bytes"] for group in row["groups"]) < row["bytes"]


def test_a_backwards_row_begins_with_the_last_frame(tmp_path):
    grown = np.stack([BALLS[0].vertices, 1.3 * BALLS[0].vertices])
    np.savez(tmp_path / "ball.npz", vertices=grown, faces=BALLS[0].faces)
    forth, back = (
        measure.measure_point(Point("ball", "draco", {"qp": 9}, kind=kind), Bench(tmp_path, comparison=QUICK))
        for kind in ("curve", "backwards")
    )
    assert [frame["d2_psnr"] for frame in back["per_frame"]] == [frame["d2_psnr"] for frame in forth["per_frame"]][::-1]
    assert len({frame["d2_psnr"] for frame in back["per_frame"]}) > 1
    turned = Backwards(open_dataset("ball", tmp_path))
    assert [len(turned), len(list(turned))] == [back["frames"]] * 2
    with pytest.raises(IndexError):
        turned[len(turned)]


def test_a_floor_row_says_what_draco_would_cost_each_group(folder, monkeypatch):
    monkeypatch.setattr("meshreel_bench.peers.IntraOptions", lambda: TRIALS)
    wasteful = Point("ball", "draco", {"qp": 14}, kind="floor")
    row = measure.measure_point(wasteful, Bench(folder, comparison=QUICK))
    assert len(row["groups"]) == 2 and all("draco_bytes" in group for group in row["groups"])
    assert all(g["draco_bytes"] is None or g["draco_bytes"] < g["bytes"] for g in row["groups"])


def test_an_encode_is_measured_in_a_process_of_its_own(tmp_path):
    np.savez(tmp_path / "nothing.npz", vertices=np.zeros((3, 4, 3)), faces=np.zeros((1, 3), dtype=np.int32))
    row = run_fresh("encode", "nothing", str(tmp_path), "2", json.dumps({"quality": 10.0}))
    assert row["frames"] == 2 and row["bytes"] > 50 and row["peak_rss_mb"] > 10 and row["encode_s"] > 0


def test_a_measurement_that_fails_says_so():
    with pytest.raises(RuntimeError, match="decode"):
        run_fresh("decode", "/none.reel")


def test_peak_memory_is_told_in_megabytes_and_is_not_the_parents():
    ballast = np.ones(60_000_000)
    assert 480 < peak_rss_mb() < 100_000
    assert run_fresh("decode", str(GOLDEN / "mixed.reel"))["peak_rss_mb"] < 300 < ballast.nbytes


def test_a_sequence_that_is_missing_is_told(tmp_path):
    with pytest.raises(InputError, match="--data"):
        open_dataset("dancer", tmp_path)


def test_the_demo_is_a_sequence_too(tmp_path):
    assert len(open_dataset("demo", tmp_path, 7)) == 7


def row(point, **changed):
    """The least that a row says."""
    return {"point": point, "kind": "memory", "sequence": "ball", "codec": "draco", "options": {}} | changed


def as_line(point, **changed):
    """The same as a line."""
    return json.dumps(row(point, **changed)) + "\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[1]\n", "no JSON object"),
        ('{"a": 1}\n', "'point' is missing"),
        ("{\n", "not JSON"),
        (as_line("b", mean=float("nan")), "NaN is no number"),
        (as_line("b", experiment=["targets"]), "'experiment' is .'targets'., and not a text"),
        (as_line("b", options=None), "'options' is None, and not a JSON object"),
        (as_line("b", decode="fast"), "'decode' is 'fast'"),
        (as_line("b", groups=None), "'groups' is None, and not a list"),
        (as_line("b", kind="curve", frames=2), "'mbps' is missing, and not a number above 0"),
        ("[" * 100_000 + "\n", "recursion"),
        (as_line("b", kind="curve", frames=2, mbps=0.0), "'mbps' is 0.0"),
        (as_line("b", kind="curve", frames=2, mbps="1"), "'mbps' is '1'"),
        (as_line("b", kind="curve", mbps=1.0), "'frames' is missing"),
        (as_line("b", kind="curve", frames=2, mbps=1.0).replace("1.0", "1e999"), "'mbps' is inf"),
        (as_line("b", kind="curve", frames=2.5, mbps=1.0), "'frames' is 2.5, and not a whole number"),
        (as_line("b", kind="curve", frames=2, mbps=1e300), "'mbps' is 1e[+]300, and nothing measured is so large"),
        (as_line("b", encode_s=10**400), "nothing measured is so large"),
        (as_line("b", d2_psnr_paper=True), "'d2_psnr_paper' is True, and not a number"),
        (as_line("b", encode_s=-5), "'encode_s' is -5, and not a number from 0"),
        (as_line("b", decode={"frame_ms": "x"}), "'decode.frame_ms' is 'x', and not a number"),
        (as_line("b", encode_stages_s={"code": []}), "'encode_stages_s.code' is "),
        (as_line("b", groups=[{"bytes": 1, "frames": 2}, 5]), "'groups.1.' is 5, and not a JSON object"),
        (as_line("b", groups=[{"bytes": 1}]), "'groups.0.' has no 'frames'"),
        (as_line("b", per_frame=[{"ssim": {}}]), "'per_frame.0..ssim' is {}, and not a number"),
        (as_line("b", measured_frames=[None]), "'measured_frames.0.' is None"),
        (as_line("b", kind="curve", frames=2, mbps=1.0, per_frame=[]), "'per_frame' is .., and not a list of frames"),
        (as_line("b", kind="curve", frames=2, mbps=1.0), "'per_frame' is missing"),
        (as_line("b", encode_stages_s={"code": None}), "'encode_stages_s.code' is None, and not a number"),
    ],
)
def test_a_line_that_is_no_row_is_told_by_its_number(tmp_path, text, words):
    (tmp_path / "rows.jsonl").write_text(as_line("a") + text + as_line("c"))
    with pytest.raises(InputError, match=f"line 2: .*{words}.*; delete that line"):
        read_rows(tmp_path / "rows.jsonl")


def test_what_is_not_known_may_be_null_and_decibels_below_0(tmp_path):
    whole = row(
        "a", kind="curve", frames=2, mbps=1.0, d2_psnr_paper=-3.0, ssim=None, peer=None, per_frame=[{"ssim": None}]
    )
    append_row(
        tmp_path / "rows.jsonl",
        whole | {"cameras": [{"size": []}], "groups": [{"bytes": 1, "frames": 2, "form": "draco", "key": None}]},
    )
    assert read_rows(tmp_path / "rows.jsonl")[0]["d2_psnr_paper"] == -3.0


def test_lines_end_where_json_lines_do(tmp_path):
    """Other programs write texts as they are, a mark of the encoding, or lines without anything."""
    text = json.dumps(row("a", failed="two\u2028lines\u0085"), ensure_ascii=False)
    (tmp_path / "rows.jsonl").write_text(f"\ufeff{text}\r\n\n{as_line('b')}", encoding="utf-8", newline="")
    assert [each["point"] for each in read_rows(tmp_path / "rows.jsonl")] == ["a", "b"]


def test_a_row_that_was_not_written_to_its_end_is_passed_over_and_replaced(tmp_path):
    path = tmp_path / "rows.jsonl"
    path.write_text(as_line("a") + as_line("b")[:20])  # as a process leaves it that is killed
    assert read_rows(path) == [row("a")]
    append_row(path, row("c"))
    assert path.read_text() == as_line("a") + as_line("c")
    path.write_text(as_line("a").rstrip())  # whole, as editors may leave it
    append_row(path, row("c"))
    assert read_rows(path) == [row("a"), row("c")]


def test_rows_of_runs_that_write_one_file_at_once_are_all_there(tmp_path):
    path, points = tmp_path / "rows.jsonl", [f"{number:03}" for number in range(150)]
    with ThreadPoolExecutor(3) as executor:
        list(executor.map(lambda point: append_row(path, row(point, source="x" * 20_000)), points))
    assert sorted(each["point"] for each in read_rows(path)) == points


def test_a_row_waits_while_another_run_writes(tmp_path):
    path = tmp_path / "rows.jsonl"
    with ThreadPoolExecutor(1) as executor:
        with path.open("ab") as file, locked(file):
            waiting = executor.submit(append_row, path, row("b"))
            time.sleep(0.3)
            file.write(as_line("a").encode())
        waiting.result()
    assert [each["point"] for each in read_rows(path)] == ["a", "b"]


def test_where_rows_cannot_be_written_nothing_is_measured(folder, tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel_bench.runner.measure_point", lambda *_: pytest.fail("measured"))
    (tmp_path / "file").write_text("")
    with pytest.raises(
        InputError, match=r"rows.jsonl: cannot be written .*a part of that path is a file.*choose another"
    ):
        run_points([Point("ball", "draco", {})], tmp_path / "file" / "rows.jsonl", Bench(folder), lambda *_: None)


@pytest.mark.parametrize("ending", [".pictures", ".cache"])
def test_where_pictures_or_sequences_cannot_be_kept_nothing_is_measured(folder, tmp_path, monkeypatch, ending):
    monkeypatch.setattr("meshreel_bench.runner.measure_point", lambda *_: pytest.fail("measured"))
    (tmp_path / f"rows{ending}").write_text("")
    bench = Bench(folder, cache=tmp_path / "rows.cache")
    with pytest.raises(InputError, match=f"rows{ending}: cannot be written .*choose another"):
        run_points([Point("ball", "draco", {})], tmp_path / "rows.jsonl", bench, lambda *_: None)


@pytest.mark.parametrize("spoil", ["remove", "replace"])
def test_a_sequence_that_changes_under_a_sweep_fails_from_there_on(tmp_path, spoil):
    path = tmp_path / "ball.npz"
    np.savez(path, vertices=np.stack([mesh.vertices for mesh in BALLS]), faces=BALLS[0].faces)
    bench = Bench(tmp_path, comparison=QUICK, limit_s=60)
    points = [Point("ball", "draco", {"qp": qp}, kind="curve") for qp in (7, 8)]

    def tell(*_):
        path.unlink(missing_ok=True)
        if spoil == "replace":
            np.savez(path, vertices=[BALLS[0].vertices], faces=BALLS[0].faces)

    rows = run_points(points, tmp_path / "rows.jsonl", bench, tell)
    assert rows[0]["bytes"] > 0 and "the sequence has changed since the sweep began" in rows[1]["failed"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in folders")
def test_rows_are_not_kept_in_a_pipe(folder, tmp_path):
    os.mkfifo(tmp_path / "rows.jsonl")
    with pytest.raises(InputError, match=r"rows\.jsonl: is a pipe"):
        run_points([Point("ball", "draco", {})], tmp_path / "rows.jsonl", Bench(folder), lambda *_: None)


@pytest.mark.parametrize("name", [".", os.devnull])
def test_what_is_no_file_has_no_rows(tmp_path, name):
    with pytest.raises(InputError, match="is no file"):
        read_rows(tmp_path / name)


def test_halves_of_characters_are_question_marks(tmp_path):
    append_row(tmp_path / "rows.jsonl", row("a", failed="no file \udcff \U0001f600"))
    assert read_rows(tmp_path / "rows.jsonl") == [row("a", failed="no file ? \U0001f600")]


def test_rows_that_cannot_be_written_are_told_with_the_file(tmp_path):
    with pytest.raises(InputError, match=f"{tmp_path}: cannot be written .*choose another file"):
        append_row(tmp_path, {})


def two_balls(gap):
    """Two balls side by side, `gap` apart, as one mesh."""
    ball = BALLS[0]
    other = ball.vertices + [2 + gap, 0, 0]
    return Mesh.of([*ball.vertices, *other], [*ball.faces, *(ball.faces + len(ball.vertices))])


def test_a_triangle_between_two_bodies_is_a_bridge():
    apart = two_balls(0.5)
    assert count_bridges(apart, apart) == 0
    count = len(BALLS[0].vertices)
    bridged = Mesh.of(apart.vertices, [*apart.faces, [0, 1, count], [0, count, count + 1]])
    assert count_bridges(apart, bridged) == 2


def test_one_body_and_nothing_have_no_bridges():
    assert count_bridges(BALLS[0], BALLS[1]) == 0
    assert count_bridges(Mesh.empty(), BALLS[0]) == count_bridges(two_balls(1), Mesh.empty()) == 0
