"""Decision 25: bodies that never touch, coded as one track, as a track each, and each alone.

In: the benchmark data. Out: three rows for each sequence.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from meshreel.analysis.pieces import piece_of_faces, pieces_of
from meshreel.analysis.survey import Survey, survey
from meshreel.capture.procedural import deforming_sphere
from meshreel.encoder.interval import Interval
from meshreel.encoder.presets import preset_options
from meshreel.encoder.recipe import encode_interval
from meshreel.encoder.sequence import Encoder
from meshreel.geometry.topology import clean, concatenate, part_of, weld
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh, MeshList, MeshSequence, Placement

from ..datasets import Store
from ..datasets.side_by_side import SideBySide
from .rows import FRAME_RATE, Row, Sources, decoded, mbps_of

BALL = "dancer and a ball"  # of the fewest faces that make a piece
CASES = {"synthetic4": (10, 35.0), "gears": (12, 50.0), BALL: (10, 50.0)}  # frames and quality
RADIUS, PLACE, STEP = 0.15, (1.2, 0.5, 0.0), (0.0, 0.05, 0.0)  # m, of the ball; a frame


@dataclass(frozen=True, slots=True)
class Coded:
    """Frames that were coded, in metres."""

    frames: list[Mesh]
    size: int  # bytes
    seconds: float  # processor time


def measure(sources: Sources) -> Iterator[Row]:
    """Yield a row for each way of each case."""
    for name, (count, quality) in CASES.items():
        whole = [clean(weld(mesh)) for mesh in _sequence(name, count, sources)]
        start = time.process_time()
        pieces = [pieces_of(mesh) for mesh in whole]
        found = {"bodies": len(pieces[0]), "pieces_ms": 1000 * (time.process_time() - start) / count}
        for way, coded in _ways(whole, quality):
            errors = [surface_errors(a, b) for a, b in zip(whole, coded.frames, strict=True)]
            yield {
                "sequence": f"{name}, quality {quality:g}",
                "way": way,
                **found,
                "mbps": mbps_of(coded.size, count),
                "d2_psnr_paper": float(np.mean([each.d2_psnr_paper for each in errors])),
                "symmetric_psnr": float(np.mean([each.symmetric_psnr for each in errors])),
                "normal_error_deg": float(np.mean([each.angle for each in errors])),
                "cpu_s_per_frame": coded.seconds / count,
            }


def _sequence(name: str, count: int, sources: Sources) -> MeshSequence:
    store = Store(sources.data)
    if name != BALL:
        return store.open(name, count).sequence
    ball = deforming_sphere(1).meshes[0]
    at = [np.add(PLACE, number * np.array(STEP)) for number in range(count)]
    balls = MeshList(tuple(Mesh(RADIUS * ball.vertices + place, ball.faces) for place in at))
    return SideBySide([(store.open("dancer", count).sequence, (0.0, 0.0, 0.0)), (balls, (0.0, 0.0, 0.0))])


def _ways(whole: Sequence[Mesh], quality: float) -> Iterator[tuple[str, Coded]]:
    """Yield what the frames become in each way."""
    seen = survey(MeshList(tuple(whole), FRAME_RATE))
    yield "one track", _one_track(whole, seen, quality)
    yield "a track each", _tracks(whole, seen, quality)
    labels = [piece_of_faces(mesh) for mesh in whole]
    alone = list[Coded]()
    for body in range(len(seen.pieces[0])):
        own = [part_of(mesh, label == body) for mesh, label in zip(whole, labels, strict=True)]
        of_body = survey(MeshList(tuple(own), FRAME_RATE))
        alone.append(_one_track(own, of_body, quality - 25 * math.log2(seen.unit / of_body.unit)))  # the same step, m
    frames = [concatenate(meshes) for meshes in zip(*(one.frames for one in alone), strict=True)]
    size, seconds = sum(one.size for one in alone), sum(one.seconds for one in alone)
    yield "each alone, its step as among all", Coded(frames, size, seconds)


def _one_track(frames: Sequence[Mesh], seen: Survey, quality: float) -> Coded:
    return _coded([Interval([seen.normalise(mesh) for mesh in frames])], seen, quality)


def _tracks(frames: Sequence[Mesh], seen: Survey, quality: float) -> Coded:
    options = replace(preset_options(quality=quality), scene=None)
    return _coded(Encoder(MeshList(tuple(frames), FRAME_RATE)).intervals(options), seen, quality)


def _coded(intervals: Iterator[Interval] | Sequence[Interval], seen: Survey, quality: float) -> Coded:
    """Code the intervals of all bodies, each of which has all frames."""
    place, bodies, size, start = Placement(seen.unit, tuple(seen.center)), list[list[Mesh]](), 0, time.process_time()
    coded = [list(encode_interval(interval, preset_options(quality=quality).method)) for interval in intervals]
    seconds = time.process_time() - start
    for groups in coded:
        size += sum(len(group.payload) for group in groups)
        bodies.append([place.of(mesh) for mesh in chain.from_iterable(decoded(groups))])
    return Coded([concatenate(meshes) for meshes in zip(*bodies, strict=True)], size, seconds)
