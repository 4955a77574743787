"""What decoding all of a file costs in a fresh process: memory, and processor time beside that of a peer."""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from tests.golden import GOLDEN

# The golden file loads all that decoding needs. On Linux, ru_maxrss begins with the parent's; VmHWM is the child's own.
CHILD = """
import json, resource, sys, time
from contextlib import suppress
import meshreel
import scipy.sparse as sparse
from scipy.sparse.linalg import splu
def peak():
    with suppress(OSError), open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmHWM")) << 10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << (0 if sys.platform == "darwin" else 10)
def spent(work):
    start = time.process_time()
    work()
    return time.process_time() - start
def decode():
    with meshreel.open(sys.argv[2]) as video:
        for frame in range(len(video)):
            try:
                for part in video.parts(frame).values():
                    part.texture and part.texture.pixels
                video[frame]
            except meshreel.FormatError as error:
                refused[:] = [str(error)]
list(meshreel.open(sys.argv[1]))
idle, refused = peak(), []
own = spent(decode)
memory = peak() - idle
line = sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(300, 300))
grid = (sparse.kron(line, sparse.eye_array(300)) + sparse.kron(sparse.eye_array(300), line)).tocsc()
def peer():
    return min(spent(lambda: splu(grid)) for _ in range(2))
times = [own / peer()]
while len(times) < 6 and times[-1] > float(sys.argv[3]):
    times.append(spent(decode) / peer())
print(json.dumps([memory, min(times), refused]))
"""


# Reads each track of each frame, its splats, and the whole frame, by Python or by the C library.
BY_TRACKS = """
import json, sys
from contextlib import suppress
from pathlib import Path
import meshreel
from tests.decoder.c_abi import CError, CVideo
def peak():
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM")) << 10
def read(path):
    video = CVideo(Path(path).read_bytes()) if sys.argv[1] == "C" else meshreel.open(path)
    tracks = range(video.info.tracks if sys.argv[1] == "C" else len(video.tracks))
    for track in tracks:
        if sys.argv[1] == "C":
            shown, splats = video.decode(0, track), video.splats(0, track)
        else:
            shown, splats = video.tracks[track][0], video.tracks[track].splats(0)
    with suppress(meshreel.FormatError, CError):
        video.decode(0) if sys.argv[1] == "C" else video[0]
read(sys.argv[2])
idle = peak()
read(sys.argv[3])
print(json.dumps(peak() - idle))
"""


def memory_by_tracks(way: str, path: Path, data: bytes) -> int:
    """Return the bytes that reading the tracks of a file one by one takes, by Python or by the "C" library."""
    path.write_bytes(data)
    arguments = [sys.executable, "-c", BY_TRACKS, way, str(GOLDEN / "splats/splats.reel"), str(path)]
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=300, check=True, cwd=root)
    return int(json.loads(done.stdout))


@dataclass(frozen=True, slots=True)
class Cost:
    """What a file cost."""

    memory: int  # bytes
    time: float  # of the processor, over that of a peer: the factors of a grid's Laplacian
    refused: list[str]  # the last message, if a frame was refused


def measured(path: Path, data: bytes, enough: float) -> Cost:
    """Decode a file, written to `path`, in a fresh process; again where it takes over `enough` times a peer."""
    path.write_bytes(data)
    arguments = [sys.executable, "-c", CHILD, str(GOLDEN / "mixed.reel"), str(path), str(enough)]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=300, check=True)
    return Cost(*json.loads(done.stdout))
