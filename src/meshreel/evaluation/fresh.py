"""Decodes a file in this process and prints times and peak memory as JSON: the runner starts it as a fresh process.

Times are processor time of one thread; decoding starts from bytes. The steady state is the median over the frames of
the second pass, each group's cost spread over its frames.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

from ..decoder import Video
from ..decoder import open as open_video


def main(path: str) -> None:
    """Prints {"first_frame_ms", "frame_ms", "frames", "vertices", "peak_rss_mb"} of decoding the file at `path`."""
    data = Path(path).read_bytes()
    start = time.process_time()
    first = open_video(data)[0]
    first_ms = 1e3 * (time.process_time() - start)
    frame_ms = min(_pass_ms(open_video(data)) for _ in range(3))
    row = {
        "first_frame_ms": first_ms,
        "frame_ms": frame_ms,
        "frames": len(open_video(data)),
        "vertices": len(first.vertices),
        "peak_rss_mb": peak_rss_mb(),
    }
    sys.stdout.write(json.dumps(row) + "\n")


def peak_rss_mb() -> float | None:
    """Largest resident set of this process so far, MB; None where the platform does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def _pass_ms(video: Video) -> float:
    start = time.process_time()
    for _ in video:
        pass
    return 1e3 * (time.process_time() - start) / len(video)


if __name__ == "__main__":
    main(sys.argv[1])
