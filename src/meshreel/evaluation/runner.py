"""The only place that measures: one JSON-ready row for a codec at an operating point on a sequence.

Rate is the length of the bytes; decoding happens in a fresh process from a file; times are processor time, and a row
carries DracoPy's decoding time of the same body from the same run, so that machines can be compared by ratio.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..coding.mesh import encode_mesh
from ..metrics.report import ComparisonOptions, compare_sequences
from ..types import Mesh, MeshSequence
from .bridges import count_bridges, count_degenerate
from .codec import Codec
from .codecs import make_codec
from .codecs.draco import lattice_step
from .datasets import open_dataset
from .fresh import peak_rss_mb
from .rows import Point, Row, append_row, read_rows

PEER_QP = 9  # bits of the Draco meshes whose decoding is the yardstick


def run_points(
    points: Iterable[Point], data: Path, file: Path, options: ComparisonOptions, tell: Callable[[Row, bool], None]
) -> list[Row]:
    """Rows of all points, each appended to `file` as soon as it is there; `tell` hears each and whether it is new.

    Points that have a row in the file already are not run again, so an interrupted sweep goes on where it was.
    """
    known = {row["point"]: row for row in read_rows(file)} if file.exists() else {}
    rows = []
    for point in points:
        row = known.get(point.key)
        if row is None:
            row = _run(point, data, options)
            append_row(file, row)
        tell(row, point.key not in known)
        rows.append(row)
    return rows


def run_point(name: str, sequence: MeshSequence, codec: Codec, options: ComparisonOptions) -> Row:
    """Encodes, decodes and compares; the row has rate, times by stage, memory and every metric."""
    timer = StageTimer()
    data = codec.encode(sequence, timer)
    encode_s = timer.stop() / len(sequence)
    video = codec.decode(data)
    decode = measure_fresh_decode(data)
    peer = measure_peer(video)
    row: Row = {
        "sequence": name,
        "codec": codec.name,
        "options": codec.options,
        "frames": len(sequence),
        "frame_rate": sequence.frame_rate,
        "bytes": len(data),
        "mbps": len(data) * 8 * sequence.frame_rate / len(sequence) / 1e6,
        "encode_s": encode_s,
        "encode_stages_s": {stage: seconds / len(sequence) for stage, seconds in timer.seconds.items()},
        "encode_peak_rss_mb": peak_rss_mb(),  # of this process and all points before it
        "decode": decode,
        "peer": peer,
        "decode_over_peer": decode["frame_ms"] / peer["frame_ms"] if peer else None,
        "machine": {"platform": platform.platform(), "python": platform.python_version(), "meshreel": __version__},
    }
    row |= compare_sequences(sequence, video, options).to_row()
    row |= {"bridges": [count_bridges(a, b) for a, b in zip(sequence, video, strict=True)]}
    return row | {"degenerate_faces": [count_degenerate(mesh) for mesh in video]}


def measure_fresh_decode(data: bytes) -> Row:
    """First frame and steady state, ms, and peak memory of decoding these bytes in a fresh process."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "video.reel"
        path.write_bytes(data)
        return run_fresh("decode", str(path))


def measure_peer(video: Sequence[Mesh]) -> Row:
    """The same of DracoPy on the same decoded frames at qp 9, in a fresh process; empty where there is no surface."""
    frames = []
    for mesh in video:
        if not mesh.is_empty:
            extent = float((mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)).max())
            data = encode_mesh(mesh, lattice_step(extent, PEER_QP))
            frames.append(np.frombuffer(data, dtype=np.uint8))
    if not frames:
        return {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frames.npz"
        np.savez(path, *frames)
        return run_fresh("draco", str(path)) | {"qp": PEER_QP}


def run_fresh(task: str, *arguments: str) -> Row:
    """What `evaluation.fresh` measures, on one thread."""
    command = [sys.executable, "-m", "meshreel.evaluation.fresh", task, *arguments]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    answer = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    if answer.returncode != 0:
        raise RuntimeError(f"measuring `{task}` in a fresh process failed: {answer.stderr.strip().splitlines()[-1:]}")
    return dict(json.loads(answer.stdout))


class StageTimer:
    """A progress callback that charges processor time to the stage that reports."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._start = self._last = time.process_time()

    def __call__(self, stage: str, _done: int, _total: int) -> None:
        """The time since the last report belongs to `stage`."""
        now = time.process_time()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now

    def stop(self) -> float:
        """Processor time since the start, s."""
        return time.process_time() - self._start


def _run(point: Point, data: Path, options: ComparisonOptions) -> Row:
    sequence = open_dataset(point.sequence, data, point.frames)
    row: dict[str, Any]
    if point.kind == "memory":
        arguments = (point.sequence, str(data), str(len(sequence)), json.dumps(point.options))
        row = run_fresh("encode", *arguments) | {"sequence": point.sequence, "codec": point.codec}
        row |= {"options": point.options}
    else:
        row = run_point(point.sequence, sequence, make_codec(point.codec, point.options), options)
    return {"point": point.key, "kind": point.kind} | row
