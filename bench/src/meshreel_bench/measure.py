"""What is measured of a point (and in peers.py, beside a peer): one JSON-ready row for a codec at an operating point.

Rate is the length of the bytes; decoding happens in a fresh process from a file; times are processor time, and a row
carries DracoPy's decoding time of the same body from the same run, so that machines can be compared by ratio.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from meshreel.coding.mesh import encode_mesh
from meshreel.decoder.video import open as open_video
from meshreel.geometry.derived_sequences import Backwards
from meshreel.metrics.comparison import ComparisonOptions
from meshreel.types import Frames, MeshSequence

from .bench import Bench
from .bridges import count_bridges, count_degenerate
from .checked import check_told, compared, decoded_by, decoder_of
from .codec import Codec, coded_row
from .codecs import make_codec
from .codecs.draco import lattice_step
from .datasets import open_dataset
from .fresh import peak_rss_mb
from .groups import group_records
from .peers import cheapest_forms, confirmed, measure_fresh_decode, measure_pair, run_fresh
from .provenance import made_by
from .rd_rows import KINDS as RATED_KINDS
from .rd_rows import measure_rated
from .rows import Point, Row
from .scene_rows import KINDS as SCENE_KINDS
from .scene_rows import measure_scene
from .timer import StageTimer

PEER_QP = 9  # bits of the Draco meshes whose decoding is the yardstick
CURVE_METRICS = ("d2_psnr_paper", "d2_psnr", "symmetric_psnr", "normal_error_deg", "ssim_masked")  # kept of each frame


def run_point(name: str, sequence: MeshSequence, codec: Codec, options: ComparisonOptions) -> Row:
    """Encodes, decodes and compares; the row has rate, times by stage, memory and every metric."""
    return _measured_codec(name, sequence, codec, options)[0]


def _measured_codec(name: str, sequence: MeshSequence, codec: Codec, options: ComparisonOptions) -> tuple[Row, bytes]:
    """The row of `run_point` and the bytes it is about."""
    decoder, timer = decoder_of(codec), StageTimer()
    data = codec.encode(sequence, timer)
    encode_s = timer.stop() / len(sequence)
    check_told(codec, data)
    decode, video = measure_fresh_decode(data, decoder, decoded_by(decoder, data, codec.name, sequence))
    peer = measure_peer(video)
    row = _rate(name, sequence, codec, data) | {
        "encode_s": encode_s,
        "encode_stages_s": {stage: seconds / len(sequence) for stage, seconds in timer.seconds.items()},
        "encode_peak_rss_mb": peak_rss_mb(),  # of this process and all points before it
        "decode": decode,
        "peer": peer,
        "decode_over_peer": decode["frame_ms"] / peer["frame_ms"] if peer else None,
    }
    row |= compared(sequence, video, options) | {"groups": group_records(data)}
    row |= {"bridges": [count_bridges(a, b) for a, b in zip(sequence, video, strict=True)]}
    return row | {"degenerate_faces": [count_degenerate(mesh) for mesh in video]}, data


def run_curve_point(name: str, sequence: MeshSequence, codec: Codec, options: ComparisonOptions) -> Row:
    """Rate, groups and metrics only: a point of an anchor's sweep, or of an ablation."""
    decoder, start = decoder_of(codec), time.process_time()
    data = codec.encode(sequence)
    encode_s = (time.process_time() - start) / len(sequence)
    check_told(codec, data)
    row = _rate(name, sequence, codec, data) | {"encode_s": encode_s}
    video = confirmed(data, decoder, decoded_by(decoder, data, codec.name, sequence))
    measured = compared(sequence, video, options)
    frames = [{key: frame[key] for key in CURVE_METRICS if key in frame} for frame in measured["per_frame"]]
    return row | measured | {"per_frame": frames, "groups": group_records(data)}


def run_floor_point(name: str, sequence: MeshSequence, codec: Codec, options: ComparisonOptions) -> Row:
    """A row of `run_point` whose groups know the bytes of the cheapest per-frame Draco form that is as good.

    None there: no such form costs less than the group.
    """
    row, data = _measured_codec(name, sequence, codec, options)
    cheapest = cheapest_forms(sequence, open_video(data))
    return row | {"groups": [g | {"draco_bytes": b} for g, b in zip(row["groups"], cheapest, strict=True)]}


def _rate(name: str, sequence: MeshSequence, codec: Codec, data: bytes) -> Row:
    return {"sequence": name, "frames": len(sequence)} | coded_row(codec, sequence, data)


def measure_peer(video: Frames) -> Row:
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


def measure_point(point: Point, bench: Bench, rows: Sequence[Row] = ()) -> Row:
    """The row of a point, by its kind; `rows` are those measured before, for the kinds of `AFTER`."""
    head = {"point": point.key, "kind": point.kind, "experiment": bench.experiment} | made_by()
    if point.kind in RATED_KINDS:
        return head | measure_rated(point, bench)
    if point.kind in SCENE_KINDS:
        return head | measure_scene(point, bench.data, bench.cache)
    sequence = open_dataset(point.sequence, bench.data, point.frames, bench.cache, bench.own)
    if point.kind == "backwards":
        sequence = Backwards(sequence)
    row: Row
    if point.kind == "memory":
        row = _memory(point, str(bench.data), len(sequence))
    elif point.kind == "decode":
        row = measure_pair(point, sequence, rows)
    else:
        codec = make_codec(point.codec, point.options)
        by_kind = {"quality": run_point, "floor": run_floor_point}
        measure = by_kind.get(point.kind, run_curve_point)
        row = measure(point.sequence, sequence, codec, bench.comparison)
    return head | row


def _memory(point: Point, data: str, frames: int) -> Row:
    row = run_fresh("encode", point.sequence, data, str(frames), json.dumps(point.options))
    return row | {"sequence": point.sequence, "codec": point.codec, "options": point.options}
