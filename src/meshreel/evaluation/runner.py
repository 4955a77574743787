"""The only place that measures: one JSON-ready row for a codec at an operating point on a sequence.

Rate is the length of the bytes; decoding happens in a fresh process from a file; times are processor time, and a row
carries Draco's decoding time of the same body from the same run, so that machines can be compared by ratio.
"""

from __future__ import annotations

import json
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .. import __version__
from ..metrics.report import ComparisonOptions, compare_sequences
from ..types import MeshSequence
from .codec import Codec
from .fresh import peak_rss_mb


def run_point(name: str, sequence: MeshSequence, codec: Codec, options: ComparisonOptions) -> dict[str, Any]:
    """Encodes, decodes and compares; the row has rate, times by stage, memory and every metric."""
    timer = StageTimer()
    data = codec.encode(sequence, timer)
    encode_s = timer.stop() / len(sequence)
    row: dict[str, Any] = {
        "sequence": name,
        "codec": codec.name,
        "options": codec.options,
        "frames": len(sequence),
        "frame_rate": sequence.frame_rate,
        "bytes": len(data),
        "mbps": len(data) * 8 * sequence.frame_rate / len(sequence) / 1e6,
        "encode_s": encode_s,
        "encode_stages_s": {stage: seconds / len(sequence) for stage, seconds in timer.seconds.items()},
        "encode_peak_rss_mb": peak_rss_mb(),
        "decode": decode_in_fresh_process(data),
        "machine": {"platform": platform.platform(), "python": platform.python_version(), "meshreel": __version__},
    }
    return row | compare_sequences(sequence, codec.decode(data), options).to_row()


def run_points(
    points: Iterable[Point], data: Path, rows: Path, options: ComparisonOptions, tell: Callable[[Row], None]
) -> list[Row]:
    """Rows of all points, each appended to the file `rows` (JSON lines) as soon as it is there.

    Points that have a row already are not run again, so an interrupted sweep goes on where it was.
    """
    done = read_rows(rows) if rows.exists() else []
    wanted = []
    for point in points:
        row = next((r for r in done if point_of(r) == point_key(point)), None)
        if row is None:
            sequence = open_dataset(point.sequence, data, point.frames)
            row = run_point(point.sequence, sequence, make_codec(point.codec, point.options), options)
            row |= {"point": point_key(point)}
            with rows.open("a") as file:
                file.write(json.dumps(row) + "\n")
        tell(row)
        wanted.append(row)
    return wanted


def decode_in_fresh_process(data: bytes) -> dict[str, Any]:
    """What `evaluation.fresh` measures on these bytes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "video.reel"
        path.write_bytes(data)
        command = [sys.executable, "-m", "meshreel.evaluation.fresh", str(path)]
        answer = subprocess.run(command, check=True, capture_output=True, text=True)
    return dict(json.loads(answer.stdout))


class StageTimer:
    """A progress callback that charges processor time to the stage that reports."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._start = self._last = time.process_time()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """The time since the last report belongs to `stage`."""
        now = time.process_time()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now

    def stop(self) -> float:
        """Processor time since the start, s."""
        return time.process_time() - self._start
