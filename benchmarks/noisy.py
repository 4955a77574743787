"""Moving bodies cut out of a fused, noisy room: the layered encoder against the truth, and against decimated Draco.

python benchmarks/noisy.py --rig build/room2 --meshes build/room2-meshes      # half an hour; `crane` for one body

In: a rig's folder of benchmarks/rooms.py with its truth, and what `meshreel capture` made of it. Out: the rows `fused`
of docs/decisions/measured.jsonl.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from captured import Row, keep
from meshreel_bench.datasets.rooms import PEOPLE

from meshreel.coding.intra import decode_intra, encode_intra
from meshreel.coding.layers.coder import LayersState, place_layers, read_layers
from meshreel.coding.layers.patches import decode_patches
from meshreel.encoder.forms import EncodedGroup
from meshreel.encoder.layers import encode_interval
from meshreel.encoder.presets import preset_options
from meshreel.format.layout import Form, LayersPatches
from meshreel.format.records import unpack_all
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.decimate import decimate
from meshreel.geometry.topology import face_normals, part_of
from meshreel.io.meshes import read_mesh
from meshreel.metrics.bd_rate import Curve, bd_rate
from meshreel.metrics.distance import surface_errors
from meshreel.metrics.ssim import ssim_normals
from meshreel.metrics.viewpoints import Box, parallel_views_around
from meshreel.types import Mesh

DECISION, FRAME_RATE, EVERY, VIEW = "fused", 30.0, 4, 512
QUALITIES, FACTORS, FRACTIONS, QP = (15, 50, 85), (0.5, 2.0), (0.03, 0.05, 0.1, 0.25), 10


@dataclass(frozen=True, slots=True)
class Body:
    """A person as captured and as it is, in units of `scale`."""

    name: str
    frames: list[Mesh]
    truth: list[Mesh]
    scale: float  # m
    noise: float  # RMS distance from the frames to the truth


def main() -> int:
    """Measures every body that was asked for and puts its rows in the place of older ones."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rig", type=Path, required=True)
    parser.add_argument("--meshes", type=Path, required=True)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("bodies", nargs="*", help="all if none is named")
    given = parser.parse_args()
    for name in given.bodies or PEOPLE:
        keep(rows_of(body_of(given, name)), "body", "way")
    return 0


def body_of(given: argparse.Namespace, name: str) -> Body:
    """The faces of each frame that are nearest to a person's, normalised by the box they walk through."""
    frames, truth = [], []
    with np.load(given.rig / "truth" / "dynamic.npz") as labels:
        for number in range(given.frames):
            clean = read_mesh(given.rig / "truth" / f"frame_{number:05}.ply").mesh
            moving = np.flatnonzero(np.unpackbits(labels[f"frame_{number:05}"])[: len(clean.faces)])
            own = np.zeros(len(clean.faces), bool)
            own[moving[_own(given.data, name)]] = True
            fused = read_mesh(given.meshes / f"frame_{number:05}.ply").mesh
            near = Surface(clean).closest(fused.vertices[fused.faces].mean(axis=1)).faces
            frames.append(part_of(fused, own[near]))
            truth.append(part_of(clean, own))
    corners = np.concatenate([mesh.vertices for mesh in frames])
    low, high = corners.min(axis=0), corners.max(axis=0)
    scale = float(np.linalg.norm(high - low))
    frames, truth = ([Mesh((m.vertices - (low + high) / 2) / scale, m.faces) for m in some] for some in (frames, truth))
    noise = np.mean([surface_errors(a, b).backward.rms for a, b in zip(truth[::EVERY], frames[::EVERY], strict=True)])
    return Body(name, frames, truth, scale, float(noise))


def _own(data: Path, name: str) -> slice:
    """Where a person's faces are among those of all."""
    first = 0
    for person in PEOPLE:
        with np.load(data / "performers" / f"{person}.npz") as capture:
            count = len(capture["faces"])
        if person == name:
            return slice(first, first + count)
        first += count
    raise SystemExit(f"no person is called {name}; known: {', '.join(PEOPLE)}")


def rows_of(body: Body) -> Iterator[Row]:
    """The input, the encoder at some qualities and with a wrong noise, the anchors, and what they give."""
    yield _row(body, "input", None, 0.0, body.frames)
    layers, anchors = list[Row](), list[Row]()
    for quality in QUALITIES:
        layers.append(_coded(body, f"quality {quality}", quality, body.noise))
        yield layers[-1]
    for factor in FACTORS:
        yield _coded(body, f"quality 50, noise x {factor:g}", 50, factor * body.noise)
    for fraction in FRACTIONS:
        begin = time.process_time()
        payloads = [_anchor(frame, fraction) for frame in body.frames]
        cost = (time.process_time() - begin) / len(payloads)
        shown = [decode_intra(payload)[0] for payload in payloads]
        anchors.append(_row(body, f"decimated Draco {fraction:g}", sum(map(len, payloads)), cost, shown))
        yield anchors[-1]
    for metric in ("d2_noisy", "ssim_noisy", "ssim"):
        curves = (
            Curve(name, [row["mbps"] for row in rows], [row[metric] for row in rows])
            for name, rows in (("decimated Draco", anchors), ("layers", layers))
        )
        yield {"decision": DECISION, "body": body.name, "way": f"BD-rate {metric}", "note": str(bd_rate(*curves))}


def _anchor(frame: Mesh, fraction: float) -> bytes:
    mesh = decimate(frame, round(fraction * len(frame.vertices)))
    return encode_intra([mesh], float(np.ptp(mesh.vertices, axis=0).max()) / 2**QP, 0)


def _coded(body: Body, way: str, quality: float, noise: float) -> Row:
    begin = time.process_time()
    groups = list(encode_interval(body.frames, replace(preset_options("best", quality), noise=noise)))
    cost = (time.process_time() - begin) / len(body.frames)
    row = _row(body, way, sum(len(group.payload) for group in groups), cost, decoded(groups))
    return row | {"groups": [f"{group.form.name} {group.frame_count}" for group in groups]}


def _row(body: Body, way: str, size: int | None, cost: float, shown: Sequence[Mesh]) -> Row:
    some = slice(None, None, EVERY)
    cameras = parallel_views_around(Box.of(body.truth), VIEW)
    truth, noisy, shown = body.truth[some], body.frames[some], shown[some]
    errors = [surface_errors(a, b) for a, b in zip(truth, shown, strict=True)]
    against = [surface_errors(a, b) for a, b in zip(noisy, shown, strict=True)]
    mm = 1000 * body.scale
    return {
        "decision": DECISION,
        "body": body.name,
        "way": way,
        "mbps": None if size is None else size * 8 * FRAME_RATE / len(body.frames) / 1e6,
        "median_mm": mm * float(np.mean([median(a, b) for a, b in zip(shown, truth, strict=True)])),
        "angle_deg": float(np.mean([e.backward.angle for e in errors])),
        "ssim": _ssim(truth, shown, cameras),
        "coverage_mm": mm * float(np.mean([e.forward.rms for e in errors])),
        "rms_mm": mm * float(np.mean([e.backward.rms for e in errors])),
        "d2_noisy": min(float(np.mean([min(e.d2_psnr, 99.0) for e in against])), 99.0),
        "ssim_noisy": _ssim(noisy, shown, cameras),
        "cpu_s_per_frame": cost,
    }


def _ssim(truth: Sequence[Mesh], shown: Sequence[Mesh], cameras: Sequence) -> float:  # type: ignore[type-arg]
    return float(np.mean([ssim_normals(a, b, cameras).masked for a, b in zip(truth, shown, strict=True)]))


def median(mesh: Mesh, truth: Mesh) -> float:
    """The distance to the truth that half of the mesh's area is below."""
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    distances = np.linalg.norm(Surface(truth).closest(middles).points - middles, axis=1)
    order, areas = np.argsort(distances), face_normals(mesh)[1]
    reached = np.cumsum(areas[order])
    return float(distances[order[np.searchsorted(reached, 0.5 * reached[-1])]])


def decoded(groups: Sequence[EncodedGroup]) -> list[Mesh]:
    """The frames of all groups."""
    state: LayersState | None = None
    shown = list[Mesh]()
    for group in groups:
        if group.form != Form.LAYERS:
            shown += decode_intra(group.payload)
            continue
        records = read_layers(group.payload)
        placed = place_layers(records, state)
        state = placed.state
        if records.end == len(group.payload):
            shown += [Mesh(positions, placed.faces) for positions in placed.positions]
            continue
        record = unpack_all(LayersPatches, group.payload[records.end :])
        shown += decode_patches(record, group.frame_count, len(placed.faces)).apply(placed.positions, placed.faces)
    return shown


if __name__ == "__main__":
    sys.exit(main())
