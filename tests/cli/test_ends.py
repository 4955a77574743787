"""How an encode may end before its time: no space left, Ctrl-C, SIGTERM, SIGKILL. Nothing is left under the name, no
process lives, and the next run takes over what is left beside it.
"""

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
from tests.small_options import resolve_small

real = command.Encoder

def slow(sequence, executor, progress, *rest):
    def wait(now):
        if now.stage == "code" and now.done == 1:
            print("coding", flush=True)
            time.sleep(120)
    return real(sequence, executor, wait, *rest)

resolve_small()
if sys.argv.pop(1) == "wait":
    command.Encoder = slow
if __name__ == "__main__":
    main()
"""


def start(folder, balls, mode, limit=None, flags=()):
    """A process that encodes three single-frame groups into folder/a.reel."""

    def prepare():
        import resource

        signal.signal(signal.SIGINT, signal.SIG_DFL)  # a test run in the background passes on that it is ignored
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    (folder / "script.py").write_text(SCRIPT)
    command = [sys.executable, folder / "script.py", mode, "encode", balls, "-o", folder / "out" / "a.reel"]
    (folder / "out").mkdir(exist_ok=True)
    return subprocess.Popen(
        [*command, "--group-size", "1", *flags],
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": "."},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=prepare,
    )


@pytest.mark.parametrize(
    ("number", "code", "said", "left"),
    [
        (signal.SIGINT, 130, "meshreel: interrupted\n", []),
        (signal.SIGTERM, 143, "meshreel: terminated\n", []),
        (signal.SIGKILL, -9, "", [".a.reel.part", "a.reel.part"]),
    ],
)
def test_a_process_that_is_stopped_says_so_and_only_a_killed_one_leaves_what_the_next_takes_over(
    balls, tmp_path, number, code, said, left
):
    process = start(tmp_path, balls, "wait")
    assert process.stdout.readline() == "coding\n"
    process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (code, said)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == left
    if left:
        assert start(tmp_path, balls, "run").wait() == 0
        assert [path.name for path in (tmp_path / "out").iterdir()] == ["a.reel"]


def test_a_full_disk_leaves_nothing_and_says_so(balls, tmp_path):
    process = start(tmp_path, balls, "run", limit=600)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 2
    [error] = [line for line in errors.splitlines() if " so far" not in line]  # progress, on a busy machine
    assert error.startswith("meshreel: error: ")
    assert "a.reel" in error and "too large); free space, or choose another folder" in error
    assert list((tmp_path / "out").iterdir()) == []


def test_a_whole_run_in_a_process_of_its_own_ends_with_zero(balls, tmp_path):
    process = start(tmp_path, balls, "run")
    out, errors = process.communicate(timeout=300)
    assert (process.returncode, errors) == (0, "")
    assert "3 frames" in out
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a.reel"]


WORKERS = """
import sys, time
from multiprocessing import active_children
from meshreel.cli.workers import workers

def lives(seconds):
    time.sleep(seconds)

if __name__ == "__main__":
    with workers(2) as executor:
        for _ in range(2):
            executor.submit(lives, 0.5)
        executor.submit(lives, 0.0).result()  # both have started
        print(*(child.pid for child in active_children()), flush=True)
        for _ in range(2):
            executor.submit(lives, 60.0)
        time.sleep(60)
"""


PLAIN = """
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from meshreel.encoder.run.worker import end_with_parent

def workers(jobs):
    return ProcessPoolExecutor(jobs, get_context("spawn"), end_with_parent)
"""


OWN = "from meshreel.cli.workers import workers"


@pytest.mark.clock
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
@pytest.mark.parametrize("of", [OWN, PLAIN], ids=["of the command line", "of a Python user"])
def test_no_worker_lives_two_seconds_after_its_parent(tmp_path, number, of):
    (tmp_path / "script.py").write_text(WORKERS.replace(OWN, of))
    process = subprocess.Popen([sys.executable, tmp_path / "script.py"], stdout=subprocess.PIPE, text=True)
    pids = [int(pid) for pid in process.stdout.readline().split()]
    assert len(pids) == 2 and all(map(lives, pids))
    process.send_signal(number)
    process.wait()
    until = time.monotonic() + 2
    while any(map(lives, pids)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(map(lives, pids))


def lives(pid):
    """Whether a process lives: one that has ended, but for which nobody has waited, does not."""
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True).stdout
    return state != "" and not state.startswith("Z")


# The command line as the script of an installation runs it, with a signal when a module is about to be loaded.
LOADING = """
import os, signal, sys
name, number, *sys.argv[1:] = sys.argv[1:]

class Press:
    def find_spec(self, loaded, path, target=None):
        if loaded == name:
            os.kill(os.getpid(), int(number))

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell has jobs in the background ignore it
sys.meta_path.insert(0, Press())
from meshreel.cli import main
main()
"""


@pytest.mark.parametrize("module", ["cyclopts", "numpy", "rich", "scipy", "meshreel.encoder.sequence"])
@pytest.mark.parametrize(("number", "code", "said"), [(2, 130, "interrupted"), (15, 143, "terminated")])
def test_a_signal_while_the_program_is_loaded_ends_it_without_a_traceback(module, number, code, said):
    command = [sys.executable, "-c", LOADING, module, str(number), "encode", "none", "-o", "a.reel"]
    answer = subprocess.run(command, capture_output=True, text=True)
    assert (answer.returncode, answer.stdout, answer.stderr) == (code, "", f"meshreel: {said}\n")
