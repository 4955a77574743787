"""Sweeps and fresh processes: rows come as soon as they are measured; a codec that misbehaves costs its own row."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from meshreel_bench import codecs
from meshreel_bench.datasets import Store
from meshreel_bench.measure.runner import Measuring, run_points, runs_of
from meshreel_bench.measure.worker import WorkerError, in_fresh_process
from meshreel_bench.rows import Point, read_rows

from meshreel.errors import InputError
from tests.spheres import sliding_sphere

PLUGIN = """
import os, time
import numpy as np
from meshreel.types import Mesh

class Odd:
    name = "odd"

    def __init__(self, how="well"):
        self.how, self.options = how, {"how": how}

    def encode(self, sequence, progress=None):
        if self.how == "hang":
            time.sleep(600)
        if self.how == "crash":
            os.abort()
        return b"" if self.how == "no bytes" else self.how.encode()

    def decode(self, data):
        triangle = Mesh.of(np.eye(3), [[0, 1, 2]])
        wrong = {
            "nan": Mesh(np.full((3, 3), np.nan), triangle.faces),
            "faces": Mesh(triangle.vertices, triangle.faces + 7),
            "text": "a mesh",
        }
        frames = [wrong.get(data.decode(), triangle)] * 2
        return frames[:1] if data == b"few" else frames
"""


@pytest.fixture
def store(tmp_path, monkeypatch):
    """Sequences of two balls, and a plug-in codec that misbehaves where it is asked to."""
    balls = sliding_sphere(2, levels=1)
    np.savez(tmp_path / "ball.npz", vertices=np.stack([mesh.vertices for mesh in balls]), faces=balls[0].faces)
    (tmp_path / "odd_codec.py").write_text(PLUGIN)
    info = tmp_path / "odd_codec-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: odd-codec\nVersion: 1\n")
    (info / "entry_points.txt").write_text(f"[{codecs.GROUP}]\nodd = odd_codec:Odd\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert codecs._entry("odd").value == "odd_codec:Odd"
    return Store(tmp_path)


def odd(how):
    return Point("ball", "odd", {"how": how}, metrics="distances")


def test_a_timeout_a_crash_and_a_wrong_answer_cost_their_own_rows(store, tmp_path):
    reasons = {
        "hang": "longer than 45 s",
        "crash": "SIGABRT",
        "no bytes": "give bytes",
        "few": "decodes 1 frames of 2",
        "nan": "not finite",
        "faces": "vertices that are not there",
        "text": "no meshreel.Mesh",
    }
    points = [odd(how) for how in (*reasons, "well")]
    rows = run_points(points, tmp_path / "rows.jsonl", Measuring(store, limit_s=45, jobs=2))
    assert [row.point for row in rows] == points and rows[-1].failed is None and rows[-1].stream.bytes == 4
    for row, reason in zip(rows, reasons.values(), strict=False):
        assert reason in row.failed and row.made_by is not None and row.codec_version == "odd-codec 1"


def test_rows_that_are_there_are_not_measured_again_unless_they_failed_and_it_is_asked_for(store, tmp_path):
    file, points, heard = tmp_path / "rows.jsonl", [odd("well"), odd("no bytes")], []

    def run(**how):
        heard.clear()
        told = lambda row, new: heard.append((row.point.options["how"], new))  # noqa: E731
        run_points(points, file, Measuring(store, **how), told)
        return heard

    assert run() == [("well", True), ("no bytes", True)]
    assert run() == [("well", False), ("no bytes", False)]
    assert run(retry=True) == [("well", False), ("no bytes", True)]
    np.savez(tmp_path / "ball.npz", vertices=[np.eye(3)] * 2, faces=[[0, 1, 2]])  # another sequence of that name
    assert run() == [("well", True), ("no bytes", True)]
    assert len(read_rows(file)) == 2


def test_a_row_has_rate_times_and_metrics_of_what_a_fresh_process_decodes_of_a_sequence_that_is_there(store, tmp_path):
    options = {"qp": 9, "level": 7}
    point = Point("ball", "draco", options, metrics="distances")
    [row] = run_points([point], tmp_path / "rows.jsonl", Measuring(store))
    assert row.name == "draco" and row.options == options and row.frames == 2 and row.measured_frames == [0, 1]
    assert row.stream.bytes > 100 and [group.form for group in row.stream.groups] == ["draco"] * 2
    assert row.encoding.reference_s > 0 and row.decoding.reference_s > 0 and row.encoding.work == {}
    assert row.encoding.s > 0 and row.decoding.vertices == 18 and row.decoding.frame_ms > 0
    assert row.metrics["d2_psnr_paper"] > 55 and row.metrics["bridges"] == row.metrics["degenerate_faces"] == 0
    assert "ssim" not in row.metrics and len(row.per_frame["d2_psnr_paper"]) == 2
    with pytest.raises(InputError, match="no sequence 'nobody'"):
        run_points([Point("nobody", "draco")], tmp_path / "rows.jsonl", Measuring(store))


def test_points_that_share_an_analysis_are_one_run():
    points = [Point("a", "decimated_draco", {"fraction": f, "qp": qp}) for f, qp in ((0.5, 8), (0.2, 8), (0.5, 9))]
    assert runs_of([*points, Point("a", "unknown")]) == [[points[0], points[2]], [points[1]], [Point("a", "unknown")]]


def numbers(count):
    yield from range(count)


def ending(how):
    """Yield once, then end in some way."""
    yield os.getpid()
    if how == "crash":
        os.abort()
    if how == "exit":
        os._exit(3)
    if how == "raise":
        raise ValueError("not\ntoday")
    time.sleep(600)


def threads():
    print("codecs may print")
    yield os.environ["OMP_NUM_THREADS"]


def test_values_come_from_another_process_with_one_thread():
    assert list(in_fresh_process(numbers, 3, limit_s=60)) == [0, 1, 2]
    assert list(in_fresh_process(threads)) == ["1"]


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("crash", "ended by signal SIGABRT"),
        ("exit", "ended by exit code 3"),
        ("raise", "^ValueError: not today$"),
        pytest.param("hang", "longer than 5 s of wall time", marks=pytest.mark.clock),  # or it starts for longer
    ],
)
def test_a_process_that_ends_or_takes_too_long_says_why(how, reason):
    values = in_fresh_process(ending, how, limit_s=60 if how != "hang" else 5)
    pid = next(values)
    with pytest.raises(WorkerError, match=reason):
        next(values)
    with pytest.raises(OSError, match="No such process"):
        os.kill(pid, 0)


def starting():
    """Yield the process that it has started and leaves."""
    yield subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"]).pid


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("whole", [True, False])
def test_what_a_codec_has_started_ends_with_its_process(whole):
    values = in_fresh_process(starting, limit_s=60)
    pid = next(values)
    assert list(values) == [] if whole else values.close() is None
    deadline = time.monotonic() + 30
    while _runs(pid):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def _runs(pid):
    """Return whether a process runs; one that has ended may wait for its adopter."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
