"""Decision 16: people cut out of the fused, noisy room2; `layers` against the truth and against decimated Draco."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from meshreel.coding.intra import decode_intra, encode_intra
from meshreel.encoder.interval import Interval
from meshreel.encoder.layers import encode_interval
from meshreel.encoder.presets import layers_options
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.decimate import decimate
from meshreel.geometry.topology import face_normals, part_of
from meshreel.metrics.distance import surface_errors
from meshreel.metrics.ssim import ssim_normals
from meshreel.metrics.viewpoints import Box
from meshreel.types import Mesh

from ..bd_rate import Curve, bd_rate
from ..datasets.rooms import PEOPLE
from ..datasets.scenes import SceneData, open_scene
from ..parallel_views import OrthographicCamera, parallel_views_around
from .rows import PERFORMERS, Row, Sources, decoded, mbps_of

FRAMES, EVERY = 24, 4  # frames that are coded; of these each fourth is measured
VIEW = 512  # pixels a side of a view
QUALITIES, FACTORS = (15, 50, 85), (0.5, 2.0)
FRACTIONS, QP = (0.03, 0.05, 0.1, 0.25), 10  # of decimated Draco: shares of the vertices, bits
MOST_DB = 99.0  # the PSNR of equal meshes


@dataclass(frozen=True, slots=True)
class Body:
    """A person as captured and as it is, in units of `scale`."""

    name: str
    frames: list[Mesh]
    truth: list[Mesh]
    scale: float  # m
    noise: float  # RMS distance from the frames to the truth


def measure(sources: Sources) -> Iterator[Row]:
    """Yield the rows of every person."""
    scene = open_scene("room2", sources.data, sources.cache)
    for name in PEOPLE:
        yield from rows_of(body_of(scene, sources.data, name))


def body_of(scene: SceneData, data: Path, name: str) -> Body:
    """Return the faces nearest to a person's, normalised by the box that the person walks through."""
    frames, truth, share = list[Mesh](), list[Mesh](), _faces_of(data, name)
    for number in range(FRAMES):
        clean, fused = scene.truth[number], scene.meshes[number]
        own = np.zeros(len(clean.mesh.faces), bool)
        own[np.flatnonzero(clean.dynamic)[share]] = True
        near = Surface(clean.mesh).closest(fused.vertices[fused.faces].mean(axis=1)).faces
        frames.append(part_of(fused, own[near]))
        truth.append(part_of(clean.mesh, own))
    corners = np.concatenate([mesh.vertices for mesh in frames])
    low, high = corners.min(axis=0), corners.max(axis=0)
    scale = float(np.linalg.norm(high - low))
    frames, truth = ([Mesh((m.vertices - (low + high) / 2) / scale, m.faces) for m in some] for some in (frames, truth))
    noise = np.mean([surface_errors(a, b).backward.rms for a, b in zip(truth[::EVERY], frames[::EVERY], strict=True)])
    return Body(name, frames, truth, scale, float(noise))


def _faces_of(data: Path, name: str) -> slice:
    """Return where a person's faces are among those of all people."""
    first = 0
    for person in PEOPLE:
        with np.load(data / PERFORMERS / f"{person}.npz") as capture:
            count = len(capture["faces"])
        if person == name:
            break
        first += count
    return slice(first, first + count)


def rows_of(body: Body) -> Iterator[Row]:
    """Yield the rows of one person, then BD-rates between qualities and anchors."""
    yield _row(body, "input", None, body.frames)
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
        row = _row(body, f"decimated Draco {fraction:g}", sum(map(len, payloads)), shown)
        anchors.append(row | {"cpu_s_per_frame": cost})
        yield anchors[-1]
    for metric in ("d2_noisy", "ssim_noisy", "ssim"):
        ours, theirs = (
            Curve(name, [row["mbps"] for row in rows], [row[metric] for row in rows])
            for name, rows in (("layers", layers), ("decimated Draco", anchors))
        )
        yield {"body": body.name, "way": f"BD-rate {metric}", "note": str(bd_rate(theirs, ours))}


def _anchor(frame: Mesh, fraction: float) -> bytes:
    mesh = decimate(frame, round(fraction * len(frame.vertices)))
    return encode_intra([mesh], float(np.ptp(mesh.vertices, axis=0).max()) / 2**QP, 0)


def _coded(body: Body, way: str, quality: float, noise: float) -> Row:
    begin = time.process_time()
    groups = list(encode_interval(Interval(body.frames, noise), layers_options(quality)))
    cost = (time.process_time() - begin) / len(body.frames)
    row = _row(body, way, sum(len(group.payload) for group in groups), list(chain(*decoded(groups))))
    forms = [f"{group.form.name} {group.frame_count}" for group in groups]
    return row | {"cpu_s_per_frame": cost, "groups": forms}


def _row(body: Body, way: str, size: int | None, shown: Sequence[Mesh]) -> Row:
    """Return what frames are against the truth and against the input; lengths in mm."""
    some = slice(None, None, EVERY)
    cameras = parallel_views_around(Box.of(body.truth), VIEW)
    truth, noisy, shown = body.truth[some], body.frames[some], shown[some]
    errors = [surface_errors(a, b) for a, b in zip(truth, shown, strict=True)]
    against = [surface_errors(a, b) for a, b in zip(noisy, shown, strict=True)]
    mm = 1000 * body.scale
    return {
        "body": body.name,
        "way": way,
        "mbps": None if size is None else mbps_of(size, len(body.frames)),
        "median_mm": mm * float(np.mean([median(a, b) for a, b in zip(shown, truth, strict=True)])),
        "angle_deg": float(np.mean([each.backward.angle for each in errors])),
        "ssim": _ssim(truth, shown, cameras),
        "coverage_mm": mm * float(np.mean([each.forward.rms for each in errors])),
        "rms_mm": mm * float(np.mean([each.backward.rms for each in errors])),
        "d2_noisy": min(float(np.mean([min(each.d2_psnr, MOST_DB) for each in against])), MOST_DB),
        "ssim_noisy": _ssim(noisy, shown, cameras),
        "cpu_s_per_frame": 0.0,
    }


def _ssim(truth: Sequence[Mesh], shown: Sequence[Mesh], cameras: Sequence[OrthographicCamera]) -> float:
    return float(np.mean([ssim_normals(a, b, cameras).masked for a, b in zip(truth, shown, strict=True)]))


def median(mesh: Mesh, truth: Mesh) -> float:
    """Return the distance to the truth that half of the mesh's area is below."""
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    distances = np.linalg.norm(Surface(truth).closest(middles).points - middles, axis=1)
    order, areas = np.argsort(distances), face_normals(mesh)[1]
    reached = np.cumsum(areas[order])
    return float(distances[order[np.searchsorted(reached, 0.5 * reached[-1])]])
