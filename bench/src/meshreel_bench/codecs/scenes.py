"""Anchors of a scene with labels: decimated Draco of whole frames (a), or of what moves (b). Frames <-> .reel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from meshreel.analysis.survey import Survey
from meshreel.decoder.video import open as open_video
from meshreel.errors import InputError
from meshreel.geometry.decimate import decimate_faces
from meshreel.geometry.topology import concatenate, drop_unreferenced
from meshreel.types import Mesh, MeshSequence

from ..codec import Options, Progress
from ..datasets.scenes import FOUND, TRUE, SceneFrames
from .draco import Frames, Point, check_qp, write_frames


@dataclass(frozen=True, slots=True)
class SceneDracoCodec(Options):
    """Anchor a: the whole of every frame with a share of its faces."""

    share: float = 0.1
    qp: int = 11  # bits along the frame's longest side
    levels: int = 0  # midpoint subdivisions in the decoder

    def __post_init__(self) -> None:
        _check(self.qp, self.share)

    @property
    def name(self) -> str:
        return "a: decimated Draco" + (", subdivided" if self.levels else "")

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        frames = _scene_frames(sequence)
        meshes = [frames.scene.decimated(number, self.share) for number in frames.in_scene]
        return _written(frames.frame_rate, meshes, [(self.qp, self.levels)] * len(meshes), progress)


@dataclass(frozen=True, slots=True)
class BackgroundDracoCodec(Options):
    """Anchor b: a background once, fused over time and decimated, and what moves in every frame, decimated."""

    share: float = 0.25  # of the faces that move
    qp: int = 11  # bits along the longest side of what moves
    levels: int = 0  # midpoint subdivisions in the decoder, of what moves
    background_share: float = 0.035  # of its faces: about as many as meshreel's background has
    background_qp: int = 11
    labels: str = TRUE  # which faces move: see SceneData.labels

    def __post_init__(self) -> None:
        _check(self.qp, self.share)
        _check(self.background_qp, self.background_share)
        if self.labels not in (TRUE, FOUND):
            raise InputError(f"labels {self.labels!r}: give {TRUE} or {FOUND}")

    @property
    def name(self) -> str:
        given = "" if self.labels == TRUE else f", labels {self.labels}"
        return "b: background once, decimated Draco" + (", subdivided" if self.levels else "") + given

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """Return a .reel file whose first frame is the background."""
        frames = _scene_frames(sequence)
        meshes = [_with_share(frames.scene.background(self.labels), self.background_share)]
        for number in frames.in_scene:
            mesh = frames.scene.meshes[number]
            moving = drop_unreferenced(Mesh.of(mesh.vertices, mesh.faces[frames.scene.labels(number, self.labels)]))
            meshes.append(_with_share(moving, self.share))
        points = [(self.background_qp, 0), *[(self.qp, self.levels)] * len(frames)]
        return _written(frames.frame_rate, meshes, points, progress)

    def decode(self, data: bytes) -> Sequence[Mesh]:
        still, *frames = open_video(data)
        return [concatenate([still, moving]) for moving in frames]

    def background_bytes(self, data: bytes) -> int:
        return open_video(data).reader.groups[0].size


def _check(qp: int, share: float) -> None:
    check_qp(qp)
    if not 0 < share <= 1:
        raise InputError(f"share {share:g}: give 0 < share <= 1")


def _with_share(mesh: Mesh, share: float) -> Mesh:
    return decimate_faces(mesh, max(4, round(share * len(mesh.faces))))


def _scene_frames(sequence: MeshSequence) -> SceneFrames:
    if not isinstance(sequence, SceneFrames):
        raise InputError("this anchor is for scenes with labels: give frames of `meshreel_bench.datasets.scenes`")
    return sequence


def _written(frame_rate: float, meshes: Sequence[Mesh], points: Sequence[Point], progress: Progress | None) -> bytes:
    """Return a .reel file of meshes in metres."""
    corners = np.concatenate([mesh.vertices for mesh in meshes if not mesh.is_empty])
    survey = Survey(corners.min(axis=0), corners.max(axis=0), tuple(mesh.diagonal for mesh in meshes))
    return write_frames(Frames(frame_rate, survey, map(survey.normalise, meshes)), points, progress)
