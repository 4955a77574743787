"""Campaign against encodes: they are killed, run out of disk, and are interrupted at seeded random moments.

After each, the output must be as before, no process may live, and the next run with --resume must give the bytes of an
encode that was left in peace, and leave nothing else behind. Run it by ./scripts/faults.
"""

from __future__ import annotations

import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import reliability

sys.path.insert(0, str(reliability.ROOT))  # of `tests`; what is heavy is imported by functions, as workers load this

SEED = 21
GRACE = 2.0  # s that workers have to end after their parent, as promised
STARTING = 0.5  # s, the first moments, in which Ctrl-C is pressed
TOKEN = "MESHREEL_CAMPAIGN"  # in the environment of all processes of a run
ALONE = ("--key-interval", "0.05", "--group-size", "1", "--quiet")  # each frame is an interval


class Encode:
    """An encode of one input with some flags, run again and again over an old output."""

    def __init__(self, folder: Path, name: str, source: Path, flags: tuple[str, ...] = ()) -> None:
        self.folder, self.temporary = folder / name, folder / f"{name}-temporary"
        self.folder.mkdir()
        self.temporary.mkdir()
        self.output = self.folder / "out.reel"
        self.program = [__file__]
        self._flags = ["encode", str(source), "-o", str(self.output), *flags, *ALONE]
        begun = time.monotonic()
        answer = self.run()
        assert answer.returncode == 0, answer.stderr
        self.seconds, self.whole = time.monotonic() - begun, self.output.read_bytes()

    def start(self, *flags: str, limit: int | None = None) -> subprocess.Popen[str]:
        """Start an encode whose files may have `limit` bytes."""

        def prepare() -> None:
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            if limit is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        self.output.write_bytes(b"old")
        environment = os.environ | {TOKEN: str(self.folder), "TMPDIR": str(self.temporary)}
        pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
        command = [sys.executable, *self.program, *self._flags, *flags]
        return subprocess.Popen(command, env=environment, preexec_fn=prepare, **pipes)

    def run(self, *flags: str, limit: int | None = None) -> subprocess.CompletedProcess[str]:
        """Run an encode to its end."""
        process = self.start(*flags, limit=limit)
        _, errors = process.communicate()
        return subprocess.CompletedProcess(process.args, process.returncode, "", errors)

    def orphans(self) -> list[int]:
        """Return the processes of this encode that live, and end them."""
        token, found = f"{TOKEN}={self.folder}\0".encode(), []
        for entry in Path("/proc").iterdir():
            try:
                if entry.name.isdigit() and token in (entry / "environ").read_bytes():
                    os.kill(int(entry.name), signal.SIGKILL)
                    found.append(int(entry.name))
            except OSError:
                continue  # it has ended
        return found

    def judged(self) -> Counter[str]:
        """Return the faults after an encode that was stopped, and after the next run."""
        found = Counter[str]()
        found["output torn"] += self.output.read_bytes() not in (b"old", self.whole)  # complete: killed as it ended
        found["left for resume"] += (self.folder / "out.reel.part").exists()
        found["next run failed"] += self.run("--resume").returncode != 0
        found["other bytes"] += self.output.read_bytes() != self.whole
        found["left over"] += len(list(self.folder.iterdir())) - 1 + len(list(self.temporary.iterdir()))
        return found


def meshreel() -> None:
    """Be the command line with options that suit small bodies, so that loading it is not all that is interrupted."""
    from meshreel.cli import main as program
    from tests.small_options import resolve_small

    resolve_small()
    program()


def killed(encode: Encode, count: int, moments: random.Random) -> Counter[str]:
    """Kill an encode `count` times."""
    found, longest = Counter[str](), encode.seconds
    while found["kills"] < count:
        process = encode.start()
        time.sleep(moments.uniform(0, longest))
        process.kill()
        if process.wait() != -signal.SIGKILL:  # it was ready before
            longest *= 0.9
            continue
        time.sleep(GRACE)
        found += Counter({"kills": 1, "orphans": len(encode.orphans())}) + encode.judged()
        print(f"{encode.folder.name}: {dict(found)}", file=sys.stderr, flush=True)
    return found


def filled(encode: Encode, count: int, moments: random.Random) -> Counter[str]:
    """Let an encode run out of disk `count` times."""
    found = Counter[str]()
    while found["full disks"] < count:
        answer = encode.run(limit=moments.randrange(2 * len(encode.whole)))
        if answer.returncode == 0:
            continue
        told = "out.reel" in answer.stderr and "free space" in answer.stderr and answer.stderr.count("\n") == 1
        found += Counter({"full disks": 1, "unclear errors": not told}) + encode.judged()
    return found


def interrupted(encode: Encode, count: int, moments: random.Random) -> Counter[str]:
    """Press Ctrl-C `count` times while an encode starts; Python's own start, before it runs meshreel, is told apart."""
    found = Counter[str]()
    encode.program[:] = ["-m", "meshreel"]
    for _ in range(count):
        process = encode.start()
        time.sleep(moments.uniform(0, STARTING))
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
        ours = f"{os.sep}meshreel{os.sep}" in errors
        found += Counter({"interrupts": 1, "tracebacks": "Traceback" in errors and ours})
        found["in Python's own start"] += process.returncode in (-signal.SIGINT, 1) and not ours
        found["output changed"] += encode.output.read_bytes() != b"old"
    return found


def told(promise: str, unit: str, found: Counter[str], seconds: float, command: str) -> int:
    """Print what was found and append it as a row; return the number of faults."""
    known = (unit, "left for resume", "in Python's own start")
    faults = sum(number for what, number in found.items() if what not in known)
    note = ", ".join(
        f"{found[what]} {what}" for what in (*known[1:], "orphans", "output torn", "left over") if what in found
    )
    print(f"{promise}: {found[unit]} {unit}, {faults} faults ({dict(found)}), {seconds:.0f} s", flush=True)
    reliability.add_row(promise, command, (found[unit], unit), faults, seconds, note)
    return faults


PLAIN = ("--dynamic-only", "--fps", "20")
KILLED = "A killed encode{} leaves no process, and continues to the same bytes"
STOPS = {  # each promise: its unit, how it is tried, the input, flags
    KILLED.format(""): ("kills", killed, "meshes", PLAIN),
    KILLED.format(" with --jobs 2"): ("kills", killed, "meshes", (*PLAIN, "--jobs", "2")),
    KILLED.format(" that fuses the frames of a rig"): ("kills", killed, "rig", ()),
    "An encode whose disk is full says so, and continues to the same bytes": ("full disks", filled, "meshes", PLAIN),
    "Ctrl-C in the first half second gives no traceback": ("interrupts", interrupted, "meshes", PLAIN),
}


def make_inputs(folder: Path) -> None:
    """Write the meshes of a ball that slides, and the recording of one before a wall."""
    from meshreel.io.write import write_mesh
    from tests.capture.depth_scenes import camera, record
    from tests.spheres import sliding_sphere

    (folder / "meshes").mkdir()
    for number, mesh in enumerate(sliding_sphere(8, levels=2)):
        write_mesh(mesh, folder / "meshes" / f"frame_{number}.ply")
    cameras = [camera("front"), camera("left", 20)]
    record(folder / "rig", cameras, [(0.1 * k, 0, 0) for k in range(4)])


def main() -> int:
    """Run the campaign, two kinds of stops at a time; return 1 where a promise was broken."""
    count, command = int(sys.argv[1]) if len(sys.argv) > 1 else 20, " ".join(["./scripts/faults", *sys.argv[1:]])
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(2) as pool:
        folder = Path(name)
        make_inputs(folder)

        def tried(number: int, promise: str) -> int:
            unit, stop, source, flags = STOPS[promise]
            begun, encode = time.monotonic(), Encode(folder, str(number), folder / source, flags)
            found = stop(encode, count, random.Random(SEED + number))
            return told(promise, unit, found, time.monotonic() - begun, command)

        return 1 if sum(pool.map(tried, range(len(STOPS)), STOPS)) else 0


if __name__ == "__main__":
    meshreel() if sys.argv[1:2] == ["encode"] else sys.exit(main())
