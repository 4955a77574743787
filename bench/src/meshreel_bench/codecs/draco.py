"""The anchors: Draco on every frame, and decimation + Draco on every frame (A2), with free subdivision (A2s).

Both write .reel files whose groups are single `draco` frames, so their rate counts the same kind of container.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from meshreel.analysis.survey import Survey, survey
from meshreel.coding.intra import encode_empty, encode_intra
from meshreel.container.writer import ReelWriter
from meshreel.decoder.video import open as open_video
from meshreel.encoder.sequence import make_header
from meshreel.errors import InputError
from meshreel.geometry.decimate import decimate, decimate_faces
from meshreel.types import Mesh, MeshSequence

from ..codec import Progress

LARGE = 100_000  # faces; what has more is decimated in two steps: a number of vertices takes some rounds
ON_THE_WAY = 3  # times the vertices that are wanted, after the first step


@dataclass(frozen=True, slots=True)
class Head:
    """What a file of single frames says of all of them."""

    frame_rate: float
    seen: Survey
    count: int


@dataclass(frozen=True, slots=True)
class DracoCodec:
    """Draco per frame, compression level 7, `qp` bits along each frame's longest side."""

    qp: int = 10

    def __post_init__(self) -> None:
        check_qp(self.qp)

    @property
    def name(self) -> str:
        """What rows and plots call it."""
        return "draco"

    @property
    def options(self) -> dict[str, Any]:
        """The operating point, ready for JSON."""
        return asdict(self)

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """A .reel file of single frames."""
        seen = survey(sequence)
        frames = (seen.normalise(frame) for frame in sequence)
        return _written(frames, Head(sequence.frame_rate, seen, len(sequence)), (self.qp, 0), progress)

    def decode(self, data: bytes) -> Sequence[Mesh]:
        """The frames, from the bytes alone."""
        return open_video(data)


@dataclass(frozen=True, slots=True)
class Decimated:
    """A sequence with fewer vertices."""

    head: Head
    meshes: list[Mesh]  # normalised


@dataclass(frozen=True, slots=True)
class DecimatedDracoCodec:
    """QEM to `fraction` of the vertices, Draco at `qp` bits, then `levels` midpoint subdivisions in the decoder.

    levels = 0 is anchor A2 and levels = 1 anchor A2s. QEM runs scale-normalised and keeps open borders.
    """

    fraction: float = 0.25
    qp: int = 10
    levels: int = 0

    def __post_init__(self) -> None:
        check_point(self.fraction, self.qp, self.levels)

    @property
    def name(self) -> str:
        """What rows and plots call it."""
        return "decimated_draco" if self.levels == 0 else "decimated_draco_subdivided"

    @property
    def options(self) -> dict[str, Any]:
        """The operating point, ready for JSON."""
        return asdict(self)

    @property
    def analysis_key(self) -> str:
        """The same for all operating points with as many vertices."""
        return f"decimated to {self.fraction!r}"

    def analyse(self, sequence: MeshSequence, progress: Progress | None = None) -> Decimated:
        """The decimated frames."""
        seen, meshes = survey(sequence), list[Mesh]()
        for frame in sequence:
            meshes.append(decimated(seen.normalise(frame), self.fraction))
            if progress is not None:
                progress("decimate", len(meshes), len(sequence))
        return Decimated(Head(sequence.frame_rate, seen, len(sequence)), meshes)

    def code(self, analysis: Decimated, progress: Progress | None = None) -> bytes:
        """A .reel file of single frames."""
        return _written(analysis.meshes, analysis.head, (self.qp, self.levels), progress)

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """A .reel file of single frames."""
        return self.code(self.analyse(sequence, progress), progress)

    def decode(self, data: bytes) -> Sequence[Mesh]:
        """The frames, from the bytes alone."""
        return open_video(data)


def check_point(fraction: float, qp: int, levels: int) -> None:
    check_qp(qp)
    if not 0 < fraction <= 1 or not 0 <= levels <= 4:
        raise InputError(f"fraction {fraction:g}, levels {levels}: give 0 < fraction <= 1, levels 0 to 4")


def check_qp(qp: int) -> None:
    if not 2 <= qp <= 20:
        raise InputError(f"qp {qp}: give 2 to 20 bits")


def lattice_step(extent: float, qp: int) -> float:
    """The spacing at which a mesh `extent` wide takes `qp` bits, wherever the lattice's origin lies."""
    return max(extent, 1e-12) / (2**qp - 3)


def decimated(mesh: Mesh, fraction: float) -> Mesh:
    """The mesh with a fraction of its vertices; large ones in two steps."""
    if fraction == 1 or mesh.is_empty:
        return mesh
    vertices = max(4, round(fraction * len(mesh.vertices)))
    if len(mesh.faces) > max(LARGE, 2 * ON_THE_WAY * vertices):
        mesh = decimate_faces(mesh, 2 * ON_THE_WAY * vertices)
    return decimate(mesh, vertices)


def encode_frame(mesh: Mesh, qp: int, levels: int) -> bytes:
    """The payload of a frame alone."""
    if mesh.is_empty:
        return encode_empty()
    extent = float((mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)).max())
    return encode_intra([mesh], lattice_step(extent, qp), levels)


def _written(meshes: Iterable[Mesh], head: Head, point: tuple[int, int], progress: Progress | None) -> bytes:
    """A .reel file of single normalised frames, at `qp` bits and so many `levels` of subdivision."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "anchor.reel"
        with ReelWriter(path, make_header(head.frame_rate, head.seen, {})) as writer:
            for i, mesh in enumerate(meshes):
                writer.add_group(i, 1, encode_frame(mesh, *point))
                if progress is not None:
                    progress("code", i + 1, head.count)
        return path.read_bytes()
