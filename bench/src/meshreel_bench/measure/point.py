"""Measurement of a point: rate of all bytes, metrics of decoded frames, times of both directions.

Bodies are judged by all frames, long ones and scenes by some. A codec is given all, or those of a sampled point; the
rate is then theirs.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import msgspec
import numpy as np

from meshreel.analysis.scene.segmentation import segment
from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource
from meshreel.errors import InputError
from meshreel.format.layout import MAGIC, ChunkKind
from meshreel.geometry.derived_sequences import digest, picked
from meshreel.types import Mesh, MeshSequence, evenly

from ..codec import BackgroundCodec, Codec, ColorCodec, TwoStepCodec
from ..codecs import codec_version, make_codec
from ..datasets import Dataset, Store
from ..datasets.scenes import FOUND, TRUE, SceneFrames
from ..datasets.solid import coloured, in_colours
from ..experiments.headset import AARCH64, ENCODED
from ..experiments.study import FLOOR, HEADSET, TRACKER
from ..experiments.study import FOUND as SEGMENTATION
from ..names import FLOOR_RATIO, FOUND_NAME
from ..rows import Encoding, Group, Point, Row, Stream, checked
from .color import color_bytes
from .headset import aarch64_values, headset_values
from .metrics import Labels, Measured, measure_frames, score_labels
from .splats import splat_values
from .tracker import tracker_values
from .worker import StageTimer, cost_of, decode_timed, in_fresh_process, maker

TRUTH_NAME, UNCOMPRESSED = "the truth itself", "uncompressed"
LONG = 60  # frames: half as many of a longer sequence are compared
SOME = 10  # frames of a scene that a sampled point has; of all other points every second of these is measured
KEYS = "key_frames"  # of a file's metadata: numbers of the frames that others are predicted from


def measure_points(points: Sequence[Point], store: Store) -> Iterator[Row]:
    """Yield the row of each point; those that share an analysis should come together."""
    return (checked(measure_point(point, store)) for point in points)


@dataclass(frozen=True, slots=True)
class _Case:
    """A point, opened."""

    row: Row  # so far without what is measured
    known: Dataset
    store: Store
    some: Sequence[int]  # numbers of the frames that a sampled point has
    painted: Callable[[int], Mesh] | None = None  # of a point that splats judge: its frames in colours


def measure_point(point: Point, store: Store) -> Row:
    """Return the row of a point. Raises InputError where it cannot be measured, and whatever its codec raises."""
    known = _opened(point.sequence, point.frames, store)
    painted = coloured(point.sequence, store, point.frames) if point.metrics == "splats" else None
    if painted is not None:  # colours tell where the surface slides
        known = replace(known, sequence=in_colours(known.sequence, painted))
    count = len(known.sequence)
    is_long = count > LONG and point.metrics in ("views", "distances")
    some = evenly(count, SOME if known.cameras else LONG // 2 if is_long else count)
    whole = not known.cameras or point.sampled or point.metrics == "regions"
    numbers = list(range(count)) if point.metrics == "depth" else some if whole else some[::2]
    about = {"frames": count, "measured_frames": numbers, "data": digest([known.sequence[0]])}
    row = empty_row(point, store, frame_rate=known.sequence.frame_rate, **about)
    return STAND_INS.get(point.codec, _coded)(_Case(row, known, store, some, painted))


def _coded(case: _Case) -> Row:
    """Return the row of a codec: what it needs, and what its decoder makes of the bytes in a fresh process."""
    row, known, point = case.row, case.known, case.row.point
    codec = make_codec(point.codec, point.options)
    decoder = pickle.dumps(codec)  # before it has seen a frame, so that it can keep none
    source: MeshSequence = known.sequence
    if point.sampled:
        source = picked(source, case.some) if known.scene is None else SceneFrames(known.scene, case.some)
    data, encoding = _encoded(codec, source, (point.sequence, point.frames, point.sampled))
    numbers = row.measured_frames
    wanted = list(range(len(case.some))) if point.sampled else numbers
    decoding, *meshes = in_fresh_process(decode_timed, decoder, data, tuple(wanted), len(source))
    if case.painted is None:
        metrics, per_frame = measure_frames(Measured(known, numbers, meshes, data), point.metrics)
    else:
        metrics, per_frame = dict(splat_values(known, case.painted, meshes, numbers, data)), {}
    costs = {"stream": _stream(codec, data, len(source)), "encoding": encoding, "decoding": decoding}
    found = costs | {"metrics": metrics, "per_frame": per_frame}
    return msgspec.structs.replace(row, name=codec.name, options=codec.options, **found)


def _truth(case: _Case) -> Row:
    """Return the row of what nobody coded: meshes under splats, clean ones of a scene, or what a recording moves."""
    row, known = case.row, case.known
    if case.painted is not None:  # the meshes as they are: float32 places and int32 corners
        meshes = list(known.sequence)
        size = sum(12 * (len(mesh.vertices) + len(mesh.faces)) for mesh in meshes)
        splats = dict[str, float | None](splat_values(known, case.painted, meshes, range(len(meshes)), b""))
        return msgspec.structs.replace(row, name=UNCOMPRESSED, stream=Stream(size, len(meshes)), metrics=splats)
    if known.scene is None and not known.cameras:
        raise InputError("the truth itself is known of simulated scenes, and what moves of those with cameras")
    if known.scene is None:
        found = segment(known.sequence)  # by what the encoder finds to move
        ratio = dynamic_ratio((mesh, found.moving(number, mesh)) for number, mesh in enumerate(known.sequence))
        return msgspec.structs.replace(row, name=FOUND_NAME, metrics={FLOOR_RATIO: ratio})
    scene, numbers = known.scene, row.measured_frames
    clean = [scene.truth[number].mesh for number in numbers]
    metrics, per_frame = measure_frames(Measured(known, numbers, clean), row.point.metrics)
    metrics[FLOOR_RATIO] = dynamic_ratio((scene.meshes[number], scene.labels(number)) for number in numbers)
    return msgspec.structs.replace(row, name=TRUTH_NAME, metrics=metrics, per_frame=per_frame)


def _tracked(case: _Case) -> Row:
    method = str(case.row.point.options["method"])
    return msgspec.structs.replace(case.row, metrics=tracker_values(case.known.sequence, method))


def _played(case: _Case) -> Row:
    """Return the row of a file of `best` that is played in a browser, or decoded for another processor."""
    row, point = case.row, case.row.point
    data, options = _file(point.sequence, point.frames, case.store), point.options
    row = msgspec.structs.replace(row, options=ENCODED | options, measured_frames=list(range(row.frames)))
    if options.get("machine") == AARCH64:
        return msgspec.structs.replace(row, metrics=aarch64_values(data))
    level, throttle, rate = (int(str(options[name])) for name in ("level", "throttle", "rate"))
    layers = [chunk.layers[: level + 1] for chunk in ReelReader(BytesSource(data)).chunks]
    stream = Stream(sum(layer.size for several in layers for layer in several), row.frames)
    values = headset_values(data, level, throttle, rate) | {"throttle": throttle}
    return msgspec.structs.replace(row, name=f"level {level}, {rate} Hz", stream=stream, metrics=values)


def dynamic_ratio(frames: Iterable[tuple[Mesh, Labels]]) -> float:
    """Return the share of vertices of faces that move, which labels say (the paper's table 1)."""
    counts = [(len(np.unique(mesh.faces[moves])), len(np.unique(mesh.faces))) for mesh, moves in frames]
    moving, every = (sum(numbers) for numbers in zip(*counts, strict=True))
    return moving / max(every, 1)


def empty_row(point: Point, store: Store, **known: Any) -> Row:
    """Return the row of a point without what is measured of it."""
    known |= {"made_by": maker(), "source": store.digest(point.sequence), "codec_version": codec_version(point.codec)}
    return Row(point=point, name=point.codec, options=point.options, **known)


@lru_cache(maxsize=1)
def _opened(name: str, frames: int | None, store: Store) -> Dataset:
    return store.open(name, frames)


@lru_cache(maxsize=1)
def _file(name: str, frames: int | None, store: Store) -> bytes:
    """Return the file that is played; all points of a sequence share it."""
    return make_codec("meshreel", ENCODED).encode(_opened(name, frames, store).sequence)


_LAST = dict[object, tuple[Any, list[StageTimer]]]()  # the last analysis, for points that share it


def _encoded(codec: Codec, source: MeshSequence, what: object) -> tuple[bytes, Encoding]:
    """Return the bytes and what they cost; a shared analysis counts in each of its points."""
    analysis, before = None, list[StageTimer]()
    if isinstance(codec, TwoStepCodec):
        if (key := (what, str(codec.analysis_key))) not in _LAST:
            _LAST.clear()  # one in memory is enough
            with StageTimer() as timer:
                analysis = codec.analyse(source, timer)
            _LAST[key] = analysis, [timer]
        analysis, before = _LAST[key]
    with StageTimer() as timer:
        data = codec.code(analysis, timer) if isinstance(codec, TwoStepCodec) else codec.encode(source, timer)
    if type(data) is not bytes or not data:
        found = "no byte" if data == b"" else type(data).__name__
        raise InputError(f"{codec.name} encodes to {found}; give bytes, one at least")
    return data, cost_of([*before, timer], len(source))


def _stream(codec: Codec, data: bytes, frames: int) -> Stream:
    """Return size, groups and what is sent once; no groups of bytes that are no .reel file."""
    once = codec.background_bytes(data) if isinstance(codec, BackgroundCodec) else 0
    if not data.startswith(MAGIC):
        colors = codec.color_bytes(data) if isinstance(codec, ColorCodec) else None
        return Stream(len(data), frames, once, colors=colors)
    reader = ReelReader(BytesSource(data))
    keys = {int(key) for key in reader.metadata.get(KEYS, ())}
    groups = list[Group]()
    for chunk in reader.groups:
        own = keys & set(range(chunk.first_frame, chunk.first_frame + chunk.frame_count))
        groups.append(Group(chunk.first_frame, chunk.frame_count, chunk.form_name, chunk.size, min(own, default=None)))
    once = once or sum(chunk.size for chunk in reader.chunks if chunk.kind == ChunkKind.STATIC)
    canonical = reader.metadata.get("canonical_references", 0)
    return Stream(len(data), frames, once, groups, color_bytes(reader), canonical, len(reader.tracks))


def _segmented(case: _Case) -> Row:
    """Return the row of how well the encoder's labels of what moves fit the true ones, over all frames."""
    if case.known.scene is None:
        raise InputError("a segmentation is judged on simulated scenes only, whose labels are known")
    scene, numbers = case.known.scene, range(len(case.known.sequence))
    scores = score_labels((scene.judged(i, FOUND) for i in numbers), (scene.judged(i, TRUE) for i in numbers))
    return msgspec.structs.replace(case.row, metrics=scores)


STAND_INS = {SEGMENTATION: _segmented, TRACKER: _tracked, HEADSET: _played, FLOOR: _truth}
