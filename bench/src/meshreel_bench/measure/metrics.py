"""Metrics of decoded frames: against the input (`input_`) and, of simulated scenes, against the truth (`truth_`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64

from meshreel.decoder.video import BACKGROUND, Video
from meshreel.decoder.video import open as open_video
from meshreel.errors import InputError
from meshreel.format.layout import MAGIC, ChunkKind
from meshreel.geometry.closest_points import Surface, distances
from meshreel.geometry.derived_sequences import captured, picked
from meshreel.geometry.drawing import Viewer
from meshreel.geometry.topology import components, drop_unreferenced, face_normals, weld
from meshreel.metrics.comparison import ComparisonOptions, OriginalFrame, compare_sequences, finite
from meshreel.metrics.depth import DepthJudge, judge
from meshreel.metrics.mpeg import MpegOptions
from meshreel.metrics.scene_accuracy import Scene, people_flicker, scene_means, scene_row, visible
from meshreel.metrics.surface_samples import scatter
from meshreel.metrics.viewpoints import Box
from meshreel.types import UP_AXES, Frames, Mesh, evenly

from ..datasets import Dataset
from ..datasets.rooms import NAMES, PEOPLE, THINGS, Parts, moving_parts
from ..datasets.scenes import SceneData
from ..parallel_views import parallel_views_around
from ..rows import Metrics
from .color import (
    dark_shares,
    near_truth,
    picture_psnrs,
    picture_squares,
    swimming,
    texel_products,
    texel_psnr,
)
from .pcqm import pcqm

KEPT = ("d2_psnr_paper", "normal_error_deg", "ssim", "ssim_masked")  # of each frame
NO_METRICS = ("frames_compared", "frames_missing", "key_frames", "per_frame", "cameras")  # of a comparison's record
JUDGED = 3  # frames of which PCQM is taken, at most: a person takes 15 s
PIXELS = 512  # side of IBSM's pictures; mmetric's 2048 take three times as long (dancer: 52.5 dB instead of 52.2)
Values = dict[str, float | None]
PerFrame = dict[str, list[float | None]]


@dataclass(frozen=True, slots=True)
class Measured:
    """Original and decoded frames of a sequence."""

    known: Dataset
    numbers: Sequence[int]
    decoded: Sequence[Mesh]
    data: bytes = b""  # that was decoded; none: the decoded frames are the truth


def measure_frames(frames: Measured, metrics: Metrics) -> tuple[Values, PerFrame]:
    """Return values over all frames, and some for each of them. Raises InputError where nothing has surface."""
    if metrics == "regions":
        return _regions(frames), {}
    values, per_frame = _to_input(frames, metrics)
    if metrics == "colors":
        return values | finite(_colors(frames)), per_frame
    if metrics == "depth":
        return values | _depth(frames), per_frame
    if frames.known.scene is not None:
        values |= _means("truth", [(_true(frames.known.scene, number)) for number in frames.numbers], frames.decoded)
    return values, per_frame


def _to_input(frames: Measured, metrics: Metrics) -> tuple[Values, PerFrame]:
    known = frames.known
    originals = picked(known.sequence, frames.numbers)
    prepared = None if known.scene is None else [_original(known.scene, number) for number in frames.numbers]
    cameras: Sequence[Viewer] | None = known.cameras or None
    if cameras is None and metrics in ("parallel views", "colors"):
        cameras = parallel_views_around(Box.of(originals))
    mpeg = MpegOptions(PIXELS, edge=known.edge) if metrics == "mpeg" else None
    options = ComparisonOptions(cameras, ssim=metrics not in ("distances", "depth", "mpeg"), mpeg=mpeg)
    row: dict[str, Any] = compare_sequences(prepared or originals, frames.decoded, options).to_row()
    if row.pop("frames_empty") == row["frames_compared"]:
        raise InputError("no frame has a face with an area; give a sequence with surface")
    per_frame = {key: [frame[key] for frame in row["per_frame"]] for key in KEPT if key in row["per_frame"][0]}
    values: Values = {key: value for key, value in row.items() if key not in NO_METRICS}
    if not known.cameras:  # scans of scenes are many pieces from the start
        values["bridges"] = sum(count_bridges(a, b) for a, b in zip(originals, frames.decoded, strict=True))
        values["degenerate_faces"] = sum(map(count_degenerate, frames.decoded))
    return values, per_frame


def _colors(frames: Measured) -> dict[str, float]:
    """Return PCQM, PSNRs beside the pictures of cameras, where there are any, and of a file's successive textures."""
    video = open_video(frames.data) if frames.data.startswith(MAGIC) else None
    pictures, originals = frames.known.pictures, frames.known.sequence
    found = picture_psnrs(
        picture_squares(picture, originals[k], mesh, 0 if video is None else len(video.background(k).faces))
        for k, mesh in zip(frames.numbers, frames.decoded, strict=True)
        for picture in (pictures[k] if pictures else ())
        if picture is not None
    )
    judged = evenly(len(frames.numbers), JUDGED)
    scores = [pcqm(originals[frames.numbers[k]], frames.decoded[k]) for k in judged]
    found["pcqm"] = float(np.mean(scores))
    truth = frames.known.truth
    if truth is not None:
        found |= texel_psnr(texel_products(truth, *pair) for pair in zip(frames.numbers, frames.decoded, strict=True))
    if video is None:
        return found
    if (painted := frames.known.painted) is not None and pictures is not None:
        counts = {"background": list[np.ndarray](), "people": list[np.ndarray]()}
        for k in frames.numbers:
            parts = {name: mesh for name, mesh in video.parts(k).items() if not mesh.is_empty}
            near = {name: near_truth(painted(k), k, pictures[k], mesh) for name, mesh in parts.items()}
            counts["background"].append(near.pop(BACKGROUND, np.zeros(2)))
            counts["people"].append(sum(near.values(), np.zeros(2)))
        shares = {
            name: [alike / (alike + other) for alike, other in each if alike + other] for name, each in counts.items()
        }
        found |= {f"{name}_near_truth": float(min(each)) for name, each in shares.items() if each}
        found |= dark_shares(video.background(0))
    return found | swimming(video, originals)


def _depth(frames: Measured) -> Values:
    """Return values of all frames of a recording against its depth pictures, and the flicker of bodies in the input."""
    source = captured(frames.known.sequence)
    if source.depth is None:
        raise InputError("only recordings have depth pictures; measure others without them")
    judged = DepthJudge(source.depth, len(source), UP_AXES[source.up])
    chunks = open_video(frames.data).reader.chunks if frames.data.startswith(MAGIC) else ()
    refreshes = {chunk.first_frame for chunk in chunks if chunk.kind == ChunkKind.STATIC}
    values: Values = judge(judged, frames.decoded, frames.numbers, refreshes)
    flicker = judge(judged, source, frames.numbers)["body_flicker_deg"]
    return {name: value for name, value in values.items() if name != "per_frame"} | {"input_body_flicker_deg": flicker}


def _regions(frames: Measured) -> Values:
    """Return means of people, background and all of it, and values of parts."""
    scene = frames.known.scene
    if scene is None:
        raise InputError("regions are those of simulated scenes, whose truth is known")
    clean = [_true(scene, number) for number in frames.numbers]
    if not frames.data:  # the noise floor: the input against the truth
        return _means("truth", clean, [scene.meshes[number] for number in frames.numbers])
    noisy = [_noisy(scene, number) for number in frames.numbers]
    values = _means("truth", clean, frames.decoded) | _means("input", noisy, frames.decoded, clean)
    values["truth_people_missed"] = float(np.mean([missed(*pair) for pair in zip(clean, frames.decoded, strict=True)]))
    if not frames.data.startswith(MAGIC) or len(video := open_video(frames.data)) != len(scene.meshes):
        return values
    values |= _flicker(scene, frames.numbers, video)
    return values | ({} if scene.parts is None else part_values(scene.true, scene.parts, video))


def _means(against: str, references: Sequence[Scene], decoded: Sequence[Mesh], clean: Sequence[Scene] = ()) -> Values:
    """Return means over frames by name; what moves is what is nearest to what moves in the truth."""
    pairs = zip(references, clean or references, decoded, strict=True)
    rows = [scene_row(reference, true.labelled(mesh)) for reference, true, mesh in pairs]
    return {f"{against}_{name}": value for name, value in finite(scene_means(rows)).items()}


def _flicker(scene: SceneData, numbers: Sequence[int], video: Frames) -> Values:
    """Return the change of people's normals between frames beyond the truth, degrees, and its ratio to the input's."""
    found = dict[str, list[float]](truth=[], input=[])
    for number in numbers[:-1]:
        clean = (_true(scene, number), scene.true(number + 1))
        for name, meshes in (("truth", video), ("input", scene.meshes)):
            shown = (clean[0].labelled(meshes[number]), clean[1].labelled(meshes[number + 1]))
            found[name].append(people_flicker(clean, shown) or 0.0)
    own, noisy = (float(np.mean(values or [0.0])) for values in found.values())
    names = ("truth_people_flicker_deg", "input_people_flicker_deg", "people_flicker_of_input")
    return dict(zip(names, (own, noisy, own / noisy if noisy else None), strict=True))


@lru_cache(maxsize=10)  # 3 GB of large scenes: what is prepared for one point serves the next
def _original(scene: SceneData, number: int) -> OriginalFrame:
    return OriginalFrame(scene.meshes[number])


@lru_cache(maxsize=10)  # 2 GB
def _true(scene: SceneData, number: int) -> Scene:
    return scene.true(number)


@lru_cache(maxsize=10)
def _noisy(scene: SceneData, number: int) -> Scene:
    clean, mesh = _true(scene, number), scene.meshes[number]
    if scene.parts is not None:
        return clean.labelled(mesh)
    return Scene(mesh, scene.labels(number), clean.sights, clean.options)


def count_degenerate(mesh: Mesh) -> int:
    """Faces with less than a thousandth of the median area."""
    areas = face_normals(mesh)[1]
    return int((areas < 1e-3 * np.median(areas)).sum()) if len(areas) else 0


def count_bridges(original: Mesh, decoded: Mesh) -> int:
    """Faces of `decoded` that join vertices nearest to different connected components of `original`."""
    whole = drop_unreferenced(weld(original))
    if whole.is_empty or decoded.is_empty:
        return 0
    bodies = components(whole.faces, len(whole.vertices))
    if bodies.max() == 0:
        return 0
    middle = whole.vertices.mean(axis=0)  # closest points are found in float32
    nearest = Surface(Mesh.of(whole.vertices - middle, whole.faces)).closest(decoded.vertices - middle).faces
    corners = bodies[whole.faces[nearest, 0]][decoded.faces]
    return int((corners != corners[:, :1]).any(axis=1).sum())


FAR = 0.03  # m: surface that the decoded one is farther from is missed
SHOWN = 0.9  # share of a thing's visible surface that is the background's where the thing is room (guess)
SAMPLES = 500  # points on a thing


def missed(clean: Scene, decoded: Mesh) -> float:
    """Return the share of people's visible surface that the decoded mesh misses."""
    away = _away(clean.points["people"].points, decoded)
    return float((away > FAR).mean()) if len(away) else 0.0


def part_values(true: Callable[[int], Scene], parts: Parts, video: Video) -> dict[str, float | None]:
    """Return the bytes of each part, of people together, and how long after it rests each thing is room, s."""
    sizes = _part_bytes(true, parts, video)
    people = sum(sizes[name] for name in PEOPLE)
    values: dict[str, float | None] = {f"{name}_bytes": size for name, size in sizes.items()}
    values |= {"people_bytes": people, "door_bytes_of_people": sizes["door"] / people if people else None}
    return values | {f"{name}_room_s": _room_after_s(true, parts, video, name) for name in THINGS}


def _part_bytes(true: Callable[[int], Scene], parts: Parts, video: Video) -> dict[str, float]:
    """Return the bytes of the tracks by part: those of a group are shared by its faces in three of its frames."""
    sizes = np.zeros(len(NAMES))
    for chunk in video.reader.groups:
        shares = np.zeros(len(NAMES))
        for frame in {chunk.first_frame + k for k in (0, chunk.frame_count // 2, chunk.frame_count - 1)}:
            clean, mesh = true(frame), video.tracks[chunk.track][frame]
            faces = clean.surface.closest(mesh.vertices[mesh.faces].mean(axis=1)).faces
            shares += np.bincount(parts.of_faces(frame)[faces], minlength=len(NAMES))
        sizes += chunk.size * shares / max(shares.sum(), 1)
    return dict(zip(NAMES, sizes.tolist(), strict=True))


def _room_after_s(true: Callable[[int], Scene], parts: Parts, video: Video, name: str) -> float:
    """Return the time from a thing's last motion until it stays room, s; the rest of the video if it never does."""
    which = NAMES.index(name)
    rest, frame = int(np.flatnonzero(moving_parts(parts.poses)[:, which])[-1]) + 1, len(video)
    while frame > rest and _is_room(true(frame - 1), parts.of_faces(frame - 1) == which, video, frame - 1):
        frame -= 1
    return (frame - rest) / video.frame_rate


def _is_room(clean: Scene, own: Bool[np.ndarray, " F"], video: Video, frame: int) -> bool:
    points = scatter(clean.mesh, own, SAMPLES)
    places = points.points[visible(clean, points)]
    still, moving = (_away(places, mesh) for mesh in (video.background(frame), video.moving(frame)))
    return bool(((still <= FAR) & (still <= moving)).mean() >= SHOWN) if len(places) else True


def _away(points: Float64[np.ndarray, "N 3"], mesh: Mesh) -> Float64[np.ndarray, " N"]:
    return np.full(len(points), np.inf) if mesh.is_empty else distances(points, mesh)


Labels = Bool[np.ndarray, " _"]  # True: the face moves; one a face of the frame


def score_labels(found: Iterable[Labels], true: Iterable[Labels]) -> dict[str, float | None]:
    """Return scores of labels frame by frame: 1, 1 and 0 are perfect. InputError where frames do not fit."""
    overlaps, called, static = list[float](), 0, 0
    try:
        for number, (a, b) in enumerate(zip(found, true, strict=True)):
            if a.shape != b.shape:
                raise InputError(f"frame {number}: {len(a)} labels for {len(b)} faces; label every face once")
            either = int((a | b).sum())
            overlaps.append(float((a & b).sum()) / either if either else 1.0)
            called, static = called + int((a & ~b).sum()), static + int((~b).sum())
    except ValueError:  # of zip: InputError is none
        raise InputError(f"only {len(overlaps)} frames have labels both found and true; label every frame") from None
    if not overlaps:
        raise InputError("labels of 0 frames; give one frame at least")
    mean, worst = float(np.mean(overlaps)), min(overlaps)
    return {"iou_mean": mean, "iou_worst": worst, "static_called_dynamic": called / max(static, 1)}
