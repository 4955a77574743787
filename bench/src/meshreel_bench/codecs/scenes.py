"""The anchors of a scene: decimated Draco of the whole of every frame (a), or of what moves beside one background (b).

Both write .reel files whose groups are single `draco` frames. That of anchor b has the background before frame 0 and
the people from then on; its decoder puts them together. QEM keeps open borders.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.analysis.survey import Survey
from meshreel.container.writer import ReelWriter
from meshreel.decoder.video import open as open_video
from meshreel.encoder.sequence import make_header
from meshreel.errors import InputError
from meshreel.geometry.decimate import decimate_faces
from meshreel.geometry.topology import concatenate, drop_unreferenced
from meshreel.types import Mesh, MeshSequence

from ..codec import Progress
from ..datasets.scenes import TRUE, SceneFrames
from .draco import check_qp, encode_frame


@dataclass(frozen=True, slots=True)
class SceneDracoCodec:
    """Anchor a: every frame of the whole scene with this share of its faces, Draco at `qp` bits."""

    share: float = 0.1
    qp: int = 11
    levels: int = 0  # midpoint subdivisions in the decoder

    def __post_init__(self) -> None:
        check_qp(self.qp)
        _check_share(self.share)

    @property
    def name(self) -> str:
        """What rows and plots call it."""
        return "a: decimated Draco" + (", subdivided" if self.levels else "")

    @property
    def options(self) -> dict[str, Any]:
        """The operating point, ready for JSON."""
        return asdict(self)

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """A .reel file of single frames."""
        frames = _scene_frames(sequence)
        meshes = [frames.scene.decimated(number, self.share) for number in frames.numbers]
        return _encode(frames, meshes, [(self.qp, self.levels)] * len(meshes), progress)

    def decode(self, data: bytes) -> Sequence[Mesh]:
        """The frames, from the bytes alone."""
        return open_video(data)


@dataclass(frozen=True, slots=True)
class BackgroundDracoCodec:
    """Anchor b: a background once, fused over time and decimated, and what moves of every frame, decimated."""

    share: float = 0.25  # of the faces that move
    qp: int = 11
    levels: int = 0  # midpoint subdivisions in the decoder, of what moves
    background_share: float = 0.035  # about as many faces as meshreel's has
    background_qp: int = 11
    labels: str = TRUE  # which faces move: see SceneData.labels

    def __post_init__(self) -> None:
        for qp in (self.qp, self.background_qp):
            check_qp(qp)
        for share in (self.share, self.background_share):
            _check_share(share)

    @property
    def name(self) -> str:
        """What rows and plots call it."""
        given = "" if self.labels == TRUE else f", labels {self.labels}"
        return "b: background once, decimated Draco" + (", subdivided" if self.levels else "") + given

    @property
    def options(self) -> dict[str, Any]:
        """The operating point, ready for JSON."""
        return asdict(self)

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """A .reel file whose first frame is the background."""
        frames = _scene_frames(sequence)
        still = frames.scene.background(self.labels)
        meshes = [decimate_faces(still, max(4, round(self.background_share * len(still.faces))))]
        for number in frames.numbers:
            mesh = frames.scene.meshes[number]
            moving = drop_unreferenced(Mesh.of(mesh.vertices, mesh.faces[frames.scene.labels(number, self.labels)]))
            meshes.append(decimate_faces(moving, max(4, round(self.share * len(moving.faces)))))
        points = [(self.background_qp, 0), *[(self.qp, self.levels)] * len(frames)]
        return _encode(frames, meshes, points, progress)

    def decode(self, data: bytes) -> Sequence[Mesh]:
        """The frames, from the bytes alone."""
        still, *frames = open_video(data)
        return [concatenate([still, moving]) for moving in frames]

    def background_bytes(self, data: bytes) -> int:
        """How much of the file is the background."""
        return open_video(data).reader.groups[0].size


def _check_share(share: float) -> None:
    if not 0 < share <= 1:
        raise InputError(f"share {share:g}: give 0 < share <= 1")


def _scene_frames(sequence: MeshSequence) -> SceneFrames:
    if not isinstance(sequence, SceneFrames):
        raise InputError("this anchor is for scenes with labels: give frames of `evaluation.scenes`")
    return sequence


def _encode(
    frames: SceneFrames, meshes: Sequence[Mesh], points: Iterable[tuple[int, int]], progress: Progress | None
) -> bytes:
    """A .reel file of these meshes, each with its bits and subdivisions."""
    corners = np.concatenate([mesh.vertices for mesh in meshes if not mesh.is_empty])
    seen = Survey(corners.min(axis=0), corners.max(axis=0), tuple(mesh.diagonal for mesh in meshes))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "anchor.reel"
        with ReelWriter(path, make_header(frames.frame_rate, seen, {})) as writer:
            for i, (mesh, (qp, levels)) in enumerate(zip(meshes, points, strict=True)):
                writer.add_group(i, 1, encode_frame(seen.normalise(mesh), qp, levels))
                if progress is not None:
                    progress("code", i + 1, len(meshes))
        return path.read_bytes()
