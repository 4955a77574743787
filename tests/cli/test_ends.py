"""How an encode may end before its time: no space left, Ctrl-C, SIGTERM, SIGKILL. Nothing is left under the name."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and limits")

# The command line with quick options; it stops in the middle, where the first group is coded, if told to.
SCRIPT = """
import sys, time
import meshreel.cli.encode as command
from meshreel.cli import main
from tests.small_options import quick

real = command.Encoder

def slow(sequence, executor, progress, masker):
    def wait(stage, done, total):
        if stage == "code" and done == 1:
            print("coding", flush=True)
            time.sleep(120)
    return real(sequence, executor, wait, masker)

command.preset_options = quick
if sys.argv.pop(1) == "wait":
    command.Encoder = slow
if __name__ == "__main__":
    main()
"""


def start(folder, balls, mode, limit=None):
    """A process that encodes three single-frame groups into folder/a.reel."""

    def prepare():
        import resource

        signal.signal(signal.SIGINT, signal.SIG_DFL)  # a test run in the background passes on that it is ignored
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    (folder / "script.py").write_text(SCRIPT)
    command = [sys.executable, folder / "script.py", mode, "encode", balls, "-o", folder / "out" / "a.reel"]
    (folder / "out").mkdir()
    return subprocess.Popen(
        [*command, "--group-size", "1"],
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": os.pathsep.join(["src", "."])},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=prepare,
    )


@pytest.mark.parametrize(
    ("number", "code", "said"),
    [
        (signal.SIGINT, 130, "meshreel: interrupted\n"),
        (signal.SIGTERM, 143, "meshreel: terminated\n"),
        (signal.SIGKILL, -9, ""),
    ],
)
def test_a_process_that_is_stopped_leaves_nothing_and_says_so(balls, tmp_path, number, code, said):
    process = start(tmp_path, balls, "wait")
    assert process.stdout.readline() == "coding\n"
    process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (code, said)
    assert list((tmp_path / "out").iterdir()) == []


def test_a_full_disk_leaves_nothing_and_says_so(balls, tmp_path):
    process = start(tmp_path, balls, "run", limit=600)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 2
    assert errors.startswith("meshreel: error: ") and errors.count("\n") == 1
    assert "a.reel" in errors and "too large; free space, or choose another folder" in errors
    assert list((tmp_path / "out").iterdir()) == []


def test_a_whole_run_in_a_process_of_its_own_ends_with_zero(balls, tmp_path):
    process = start(tmp_path, balls, "run")
    begun = time.monotonic()
    out, errors = process.communicate(timeout=300)
    assert (process.returncode, errors) == (0, ""), time.monotonic() - begun
    assert "3 frames" in out
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a.reel"]
