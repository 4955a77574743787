"""Codecs that misbehave: each costs its row, which says why, and leaves nothing behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
from meshreel_bench.bench import Bench
from meshreel_bench.codecs import make_codec
from meshreel_bench.rd_rows import RATED
from meshreel_bench.row_form import FAILED
from meshreel_bench.rows import Point
from meshreel_bench.runner import run_points, runs_of

from meshreel.capture.procedural import sliding_sphere
from meshreel.errors import InputError
from meshreel.metrics.comparison import ComparisonOptions

BALLS = sliding_sphere(2, levels=1)
QUICK = ComparisonOptions(ssim=False)
PLUGIN = """
import ctypes, os, pathlib, subprocess, sys, tempfile, threading, time
import numpy as np
from meshreel.types import Mesh

KEPT = []
HERE = pathlib.Path(__file__).parent
WAIT = [sys.executable, "-c", "import time; time.sleep(600)"]

class Hostile:
    analysis_key = ""  # all points are one run, in one process

    def __init__(self, how=""):
        if how == "make":
            raise ValueError("not today")
        if how == "leave":
            sys.exit(3)
        self.how, self.name, self.kept = how, 5 if how == "name" else "hostile", []
        self.options = {"how": how} | ({"step": float("nan")} if how == "options" else {})
        if how == "pickle":
            self.lock = threading.Lock()

    def analyse(self, sequence, progress=None):
        return sequence

    def code(self, analysis, progress=None):
        return self.encode(analysis)

    def encode(self, sequence, progress=None):
        if act := getattr(self, "do_" + self.how, None):
            act()
        self.kept[:], KEPT[:] = list(sequence), list(sequence)
        data = b"".join(m.vertices.tobytes() + m.faces.tobytes() for m in sequence)
        return {"text": "0" * 9, "array": np.frombuffer(data), "nothing": b""}.get(self.how, data)

    def decode(self, data):
        if self.how == "prints":
            print("hello", flush=True)
        meshes, size = [], len(data) // 2
        for part in (data[:size], data[size:]):
            faces = np.frombuffer(part[24 * 18 :], np.int32).reshape(-1, 3)
            meshes.append(Mesh(np.frombuffer(part[: 24 * 18]).reshape(-1, 3), faces))
        changed = {
            "keeps": lambda: [*self.kept[:0], self.kept[0], self.kept[1]], "remembers": lambda: [KEPT[0], KEPT[1]],
            "last": lambda: [meshes[0], meshes[1] if KEPT else meshes[0]],
            "more": lambda: meshes if KEPT else [*meshes, meshes[0]],
            "tuples": lambda: [(m.vertices, m.faces) for m in meshes],
            "lists": lambda: [Mesh(m.vertices.tolist(), m.faces.tolist()) for m in meshes],
            "float32": lambda: [Mesh(m.vertices.astype(np.float32), m.faces) for m in meshes],
            "faces": lambda: [Mesh(m.vertices, m.faces + 1) for m in meshes],
            "backwards": lambda: [Mesh(m.vertices, m.faces - 1) for m in meshes],
        }
        return changed.get(self.how, lambda: meshes)()

    def do_exit(self):
        sys.exit(3)

    def do_segfault(self):
        ctypes.string_at(0)

    def do_chatty(self):
        sys.stderr.write("x" * 100_000 + chr(10) + "y" * 1000)
        sys.stderr.flush()
        os._exit(4)

    def do_litter(self):
        tempfile.mkdtemp()
        os._exit(5)

    def do_answers(self):
        for number in range(3, 20):
            try:
                os.write(number, b'{"point": "another"}' + bytes([10]))
            except OSError:
                pass

    def do_walk(self):
        os.chdir("/")

    def do_thread(self):
        threading.Thread(target=time.sleep, args=(600,)).start()

    def do_child(self):
        (HERE / "pid").write_text(str(subprocess.Popen(WAIT).pid))

    def do_hang(self):
        (HERE / "pid").write_text(f"{os.getpid()}")
        time.sleep(600)
"""


@pytest.fixture
def site(tmp_path, monkeypatch):
    """A folder with the codec's package and a sequence `ball`; this process, and those it starts, find the package."""
    (tmp_path / "hostile.py").write_text(PLUGIN)
    (tmp_path / "broken.py").write_text("raise RuntimeError('no license')\n")
    (tmp_path / "leaving.py").write_text("import sys; sys.exit(3)\n")
    (tmp_path / "lacking.py").write_text("FIVE = 5\ndef nothing():\n    pass\n")
    info = tmp_path / "hostile-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hostile\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[meshreel.codecs]\nhostile = hostile:Hostile\nbroken = broken:Broken\n"
        "leaving = leaving:X\nfive = lacking:FIVE\nnothing = lacking:nothing\n"
    )
    np.savez(tmp_path / "ball.npz", vertices=np.stack([mesh.vertices for mesh in BALLS]), faces=BALLS[0].faces)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.chdir(tmp_path)
    sys.modules.pop("hostile", None)
    return tmp_path


def measured(*hows, kind="curve", limit_s=60.0):
    """Rows of the codec in some ways, one after the other."""
    points = [Point("ball", "hostile", {"how": how}, kind=kind) for how in hows]
    return run_points(points, Path("rows.jsonl"), Bench(Path(), comparison=QUICK, limit_s=limit_s), lambda *_: None)


def is_running(pid):
    """Whether a process is there that has not ended; one that nobody has waited for counts as ended."""
    told = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True, check=False).stdout
    return bool(told.strip()) and not told.startswith("Z")


WRONG = {
    "make": "does not take {'how': 'make'}: ValueError: not today",
    "leave": "does not take {'how': 'leave'}: SystemExit: 3",
    "answers": "wrote among the answers of its process",
    "exit": "SystemExit: 3",
    "chatty": "exit code 4: yyy",
    "name": "called 5",
    "options": "not ready for JSON",
    "pickle": "hostile cannot be pickled",
    "text": "hostile encodes to a str; give bytes",
    "array": "hostile encodes to a ndarray; give bytes",
    "nothing": "hostile encodes to no bytes",
    "tuples": "hostile decodes a tuple, which is no meshreel.Mesh, in frame 0",
    "lists": "vertices that are a list",
    "float32": "type float32",
    "faces": "faces of vertices 1 to 18, and 18 vertices, in frame 0",
    "backwards": "faces of vertices -1 to 16",
    "keeps": "IndexError",
    "remembers": "fresh process failed: exit code 1: IndexError",
    "last": "hostile decodes another frame 1 in a fresh process",
    "more": "hostile decodes 3 frames of 2 in a fresh process",
}


@pytest.mark.usefixtures("site")
def test_a_codec_that_misbehaves_has_a_row_that_says_how():
    for row, (how, words) in zip(measured(*WRONG, kind=RATED), WRONG.items(), strict=True):
        assert words in row[FAILED] and len(row[FAILED]) < 400 and row["options"] == {"how": how}


@pytest.mark.usefixtures("site")
@pytest.mark.parametrize("kind", ["quality", "curve"])
def test_no_kind_of_row_believes_what_a_decoder_remembers(kind):
    rows = measured("keeps", "remembers", "last", kind=kind)
    assert ["IndexError" in row[FAILED] for row in rows] == [True, True, False]
    assert "another frame 1" in rows[2][FAILED]


@pytest.mark.skipif(os.name == "nt", reason="signals are POSIX")
@pytest.mark.usefixtures("site")
def test_a_codec_that_takes_its_process_down_fails_alone():
    rows = measured("segfault", "")
    assert rows[0][FAILED].startswith(f"ended by signal {int(signal.SIGSEGV)}") and rows[1]["bytes"] > 0


@pytest.mark.usefixtures("site")
def test_what_a_codec_prints_and_where_it_goes_do_not_matter():
    rows = measured("prints", "walk", "", kind="quality")
    assert [row.get(FAILED) for row in rows] == [None] * 3


@pytest.mark.usefixtures("site")
def test_threads_that_go_on_hold_nobody_up():
    start = time.monotonic()
    [row] = measured("thread")
    assert row["bytes"] > 0 and time.monotonic() - start < 60


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="groups of processes are POSIX")
def test_a_process_that_a_codec_leaves_behind_is_ended(site):
    [row] = measured("child")
    assert row["bytes"] > 0 and not is_running((site / "pid").read_text())


def test_temporary_files_of_a_codec_that_crashes_are_removed(site, monkeypatch):
    (site / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(site / "temporary"))
    monkeypatch.setenv("TMPDIR", str(site / "temporary"))
    [row] = measured("litter")
    assert "exit code 5" in row[FAILED] and not list((site / "temporary").iterdir())


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="groups of processes are POSIX")
def test_who_measures_ends_with_who_asked_for_it(site):
    code = "from pathlib import Path; from bench.tests.test_hostile_codecs import measured; measured('hang')"
    root = str(Path(__file__).parents[2])
    (site / "temporary").mkdir()
    paths = {"PYTHONPATH": os.pathsep.join([str(site), root]), "TMPDIR": str(site / "temporary")}
    process = subprocess.Popen([sys.executable, "-c", code], env=os.environ | paths)
    wait_until(lambda: (site / "pid").exists() and (site / "pid").read_text())
    pid = (site / "pid").read_text()
    assert is_running(pid)
    process.kill()
    process.wait()
    wait_until(lambda: not is_running(pid))
    assert not list((site / "temporary").iterdir())


def wait_until(true, seconds=60):
    """Fails where something is not so in time."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.1)


@pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.usefixtures("site")
def test_a_limit_longer_than_any_clock_is_none():
    [row] = measured("", limit_s=1e300)
    assert row["bytes"] > 0


@pytest.mark.usefixtures("site")
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("leaving", r"'leaving' cannot be loaded \(SystemExit: 3\)"),
        ("five", "'five' is a int; its entry point must name a class or a function"),
        ("nothing", "'nothing' is a NoneType without name, options, encode, decode"),
    ],
)
def test_what_is_no_codec_is_told(name, words):
    with pytest.raises(InputError, match=words):
        make_codec(name, {})


@pytest.mark.usefixtures("site")
def test_a_codec_that_cannot_be_made_does_not_end_the_sweep():
    with pytest.raises(InputError, match=r"'broken' cannot be loaded \(RuntimeError: no license\)"):
        make_codec("broken", {})
    points = [Point("ball", "broken", {}, kind=RATED), Point("ball", "hostile", {"how": "make"}, kind=RATED)]
    assert runs_of(points) == [points[:1], points[1:]]
