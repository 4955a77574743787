"""Parts of a scene in a file: labels of what moves, bytes of each part, people missed, things that become room.

In: labels, or a decoded video and the truth by part. A decoded face is of the part of the nearest clean face.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from jaxtyping import Bool, Float64

from meshreel.decoder.video import Video
from meshreel.errors import InputError
from meshreel.geometry.closest_points import distances
from meshreel.metrics.scene_accuracy import Scene, visible
from meshreel.metrics.surface_samples import scatter
from meshreel.types import Mesh

from ..datasets.rooms import NAMES, PEOPLE, THINGS, Parts, moving_parts

FAR = 0.03  # m: surface that the decoded one is farther from is missed
SHOWN = 0.9  # share of a thing's visible surface that is the background's where the thing is room (guess)
SAMPLES = 500  # points on a thing


def missed(clean: Scene, decoded: Mesh) -> float:
    """Return the share of people's visible surface that the decoded mesh misses."""
    away = _away(clean.points["people"].points + clean.origin, decoded)
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
            faces = clean.surface.closest(mesh.vertices[mesh.faces].mean(axis=1) - clean.origin).faces
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
    places = points.points[visible(clean, points)] + clean.origin
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
