"""Rows of scenes: a codec, or the noisy input alone, against the input and against the truth.

Means over every sixth frame (`MEASURED_EVERY`); names begin with what stands in the original's place: `input_` or
`truth_`. Anchors code these frames only, each on its own, and their rate is that of these. A background that is sent
once counts as sent every ten seconds (`BACKGROUND_S`), whatever the length of the scene.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from meshreel.decoder.video import open as open_video
from meshreel.errors import InputError
from meshreel.format.layout import ChunkKind
from meshreel.metrics.scene_accuracy import Scene, scene_means, scene_row
from meshreel.metrics.scene_comparison import finite, true_scene
from meshreel.metrics.seams import measure_seam, seam_row
from meshreel.types import Mesh

from .checked import Checked, decoder_of
from .codec import Codec
from .codecs import make_codec
from .codecs.scenes import BackgroundDracoCodec
from .datasets.scenes import SceneData, SceneFrames, open_scene
from .peers import measure_fresh_decode, run_fresh
from .rows import Point, Row
from .segmentation import score_labels

MEASURED_EVERY = 6  # frames: metrics of half a million faces take seconds
BACKGROUND_S = 10.0  # seconds in which a background is sent once
FLOOR, SCENE, SEGMENTATION, MEMORY = "scene floor", "scene", "segmentation", "scene memory"
KINDS = (FLOOR, SCENE, SEGMENTATION, MEMORY)
INTRA = ("scene_draco", "background_draco", "labelled_draco")  # codecs of single frames
NOISE_FLOOR = "noise floor"


@runtime_checkable
class Apart(Protocol):
    """A decoded scene, part by part."""

    def background(self, index: int) -> Mesh:
        """What does not move in a frame."""
        ...

    def moving(self, index: int) -> Mesh:
        """The rest of it."""
        ...


def measure_scene(point: Point, data: Path, cache: Path | None) -> Row:
    """The row of a point of one of `KINDS`. Raises InputError where there is no folder to keep a scene in."""
    if cache is None:
        raise InputError("scenes are captured into a folder that is kept: give one")
    head: Row = {"sequence": point.sequence, "options": point.options}
    if point.kind == MEMORY:
        return head | {"codec": point.codec} | _memory(point, data, cache)
    scene = _opened(point.sequence, data, cache, point.frames)
    head |= {"frames": len(scene.meshes), "frame_rate": scene.meshes.frame_rate}
    numbers = range(0, len(scene.meshes), MEASURED_EVERY)
    if point.kind == SEGMENTATION:
        return head | {"codec": point.codec} | _segmentation(scene, str(point.options["labels"]))
    if point.kind == FLOOR:
        return head | {"codec": NOISE_FLOOR} | _metrics(scene, numbers, None)
    codec = make_codec(point.codec, point.options)
    head |= {"codec": codec.name, "options": codec.options}
    return head | (_intra if point.codec in INTRA else _stream)(scene, numbers, codec)


def _intra(scene: SceneData, numbers: Sequence[int], codec: Codec) -> Row:
    """An anchor's row: the frames that are measured are those that are coded. No times: what it decimates is kept."""
    data = codec.encode(SceneFrames(scene, numbers))
    once = codec.background_bytes(data) if isinstance(codec, BackgroundDracoCodec) else 0
    rate = _rate(len(data), once, len(numbers), scene.meshes.frame_rate)
    return rate | _metrics(scene, numbers, codec.decode(data))


def _stream(scene: SceneData, numbers: Sequence[int], codec: Codec) -> Row:
    """A codec's row: the whole scene is coded, some of its frames are measured; decoding is in a fresh process."""
    decoder, start = decoder_of(codec), time.process_time()
    data = codec.encode(scene.meshes)
    seconds = (time.process_time() - start) / len(scene.meshes)
    video = open_video(data)
    once = sum(chunk.size for chunk in video.reader.chunks if chunk.kind == ChunkKind.STATIC)
    row = _rate(len(data), once, len(scene.meshes), scene.meshes.frame_rate)
    decode, decoded = measure_fresh_decode(data, decoder, Checked(video, codec.name, scene.meshes))
    row |= {"encode_s": seconds, "decode": decode} | seams_of(scene, numbers, video)
    return row | _metrics(scene, numbers, [decoded[number] for number in numbers])


def seams_of(scene: SceneData, numbers: Sequence[int], video: Apart) -> Row:
    """Means over frames of the seam between bodies and what they touch, where the input's labels have one."""
    labelled = ((number, scene.meshes[number], scene.labels(number)) for number in numbers)
    parts = ((mesh, moves, video.background(number), video.moving(number)) for number, mesh, moves in labelled)
    return finite(scene_means([seam_row(measure_seam(*each)) for each in parts]))


def _rate(size: int, once: int, frames: int, frame_rate: float) -> Row:
    moving = (size - once) * 8 * frame_rate / frames
    mbps = (moving + once * 8 / BACKGROUND_S) / 1e6
    return {"bytes": size, "background_bytes": once, "coded_frames": frames, "mbps": mbps}


def _metrics(scene: SceneData, numbers: Sequence[int], decoded: Sequence[Mesh] | None) -> Row:
    """Means against the truth, and against the input; of the input alone, and only against the truth, for None."""
    rows: dict[str, list[Row]] = {"truth": [], "input": []}
    for index, number in enumerate(numbers):
        clean, noisy = _references(scene, number)
        found = noisy if decoded is None else clean.labelled(decoded[index])
        rows["truth"].append(scene_row(clean, found))
        if decoded is not None:
            rows["input"].append(scene_row(noisy, found))
    means: Row = {"measured_frames": list(numbers)}
    for against, frames in rows.items():
        means |= {f"{against}_{name}": value for name, value in finite(scene_means(frames)).items()}
    return means


@lru_cache(maxsize=1)
def _opened(name: str, data: Path, cache: Path, frames: int | None) -> SceneData:
    """The scene that the last point was about, too."""
    return open_scene(name, data, cache, frames)


@lru_cache(maxsize=10)  # 2 GB: what is prepared for one point serves the next
def _references(scene: SceneData, number: int) -> tuple[Scene, Scene]:
    """The clean frame and the noisy one."""
    clean = true_scene(scene.truth, number)
    return clean, Scene(scene.meshes[number], scene.labels(number), clean.sights, clean.options)


def _segmentation(scene: SceneData, source: str) -> Row:
    """Labels of every frame, as stored in the scene's folder, against the true ones."""
    numbers = range(len(scene.meshes))
    score = score_labels((scene.labels(i, source) for i in numbers), (scene.labels(i) for i in numbers))
    return {"iou_mean": score.mean, "iou_worst": score.worst, "static_called_dynamic": score.static_called_dynamic}


def _memory(point: Point, data: Path, cache: Path) -> Row:
    """Peak memory of an encode in a fresh process; longer than the scene, it is played forth and back."""
    open_scene(point.sequence, data, cache)
    options: dict[str, Any] = point.options
    return run_fresh("scene", point.sequence, str(data), str(cache), str(point.frames), str(options["quality"]))
