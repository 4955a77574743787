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
list(meshreel.open(sys.argv[1]))
idle, start, refused = peak(), time.process_time(), []
with meshreel.open(sys.argv[2]) as video:
    for frame in range(len(video)):
        try:
            for part in video.parts(frame).values():
                part.texture and part.texture.pixels
            video[frame]
        except meshreel.FormatError as error:
            refused = [str(error)]
memory, end = peak() - idle, time.process_time()
line = sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(300, 300))
splu((sparse.kron(line, sparse.eye_array(300)) + sparse.kron(sparse.eye_array(300), line)).tocsc())
print(json.dumps([memory, end - start, time.process_time() - end, refused]))
"""


@dataclass(frozen=True, slots=True)
class Cost:
    """What a file cost."""

    memory: int  # bytes
    seconds: float  # of processor time
    peer: float  # seconds, too: of factors of a grid's Laplacian, just afterwards
    refused: list[str]  # the last message, if a frame was refused


def measured(path: Path, data: bytes) -> Cost:
    """Decode a file in a fresh process; it is written to `path`."""
    path.write_bytes(data)
    arguments = [sys.executable, "-c", CHILD, str(GOLDEN / "mixed.reel"), str(path)]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=300, check=True)
    return Cost(*json.loads(done.stdout))
