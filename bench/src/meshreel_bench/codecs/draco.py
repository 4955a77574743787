"""Draco per frame, as it is or decimated first (QEM that keeps borders): anchors A1, A2 and A2s. <-> a .reel file.

Every frame is a group of its own, so that the rate counts an index as other codecs' rates do.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import DracoPy
import msgspec
import numpy as np

from meshreel.analysis.survey import Survey, survey_sequence
from meshreel.coding.mesh import encode_empty, encode_intra
from meshreel.container.writer import ReelWriter
from meshreel.encoder.file.summary import make_header
from meshreel.encoder.scene.static import Static
from meshreel.errors import InputError
from meshreel.geometry.decimate import decimate, decimate_faces
from meshreel.types import Mesh, MeshSequence

from ..codec import Options, Progress, TwoSteps, reported

LARGE = 100_000  # faces; a larger mesh is decimated in two steps, as QEM to a number of vertices takes some rounds
LEVEL = 7  # of compression, that of this project's own streams
ALONE = "DracoPy"  # in place of this project's own decoder
ON_THE_WAY = 3  # vertices after the first step, in those that are wanted
Point = tuple[int, int]  # of a frame: bits along its longest side, and midpoint subdivisions in the decoder


@dataclass(frozen=True, slots=True)
class DracoCodec(Options):
    """Draco per frame."""

    qp: int = 10  # bits along each frame's longest side
    level: int = LEVEL  # of compression, 0 to 10: ten less Draco's speed; others than 7 are meshes without a file

    def __post_init__(self) -> None:
        check_qp(self.qp)
        if not 0 <= self.level <= 10:
            raise InputError(f"level {self.level}: give 0 to 10")

    @property
    def name(self) -> str:
        return "draco" if self.level == LEVEL else "draco, other levels"

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        if self.level != LEVEL:
            return encode_alone(((mesh.vertices, mesh.faces) for mesh in sequence), self.qp, self.level)
        survey = survey_sequence(sequence)
        frames = Frames(sequence.frame_rate, survey, (survey.normalise(frame) for frame in sequence))
        return write_frames(frames, [(self.qp, 0)] * len(sequence), progress)

    def decode(self, data: bytes) -> Sequence[Mesh]:
        return Options.decode(self, data) if self.level == LEVEL else decode_alone(data)


class Frames(NamedTuple):
    """Normalised frames of a file."""

    frame_rate: float  # 1/s
    survey: Survey
    meshes: Iterable[Mesh]


@dataclass(frozen=True, slots=True)
class DecimatedDracoCodec(TwoSteps):
    """QEM to `fraction` of the vertices, Draco, then midpoint subdivision; A2 has no levels, A2s has one."""

    fraction: float = 0.25
    qp: int = 10  # bits along each frame's longest side
    levels: int = 0  # midpoint subdivisions in the decoder
    decoder: str | None = None  # "DracoPy": meshes without a file around them, for what that package alone costs

    def __post_init__(self) -> None:
        check_point(self.fraction, self.qp, self.levels)
        if self.decoder not in (None, ALONE) or (self.decoder and self.levels):
            raise InputError(f"decoder {self.decoder}, levels {self.levels}: give {ALONE} and no levels, or no decoder")

    @property
    def name(self) -> str:
        return "decimated_draco" + ("_subdivided" if self.levels else f", {ALONE}" if self.decoder else "")

    @property
    def analysis_key(self) -> str:
        return f"decimated to {self.fraction!r}"

    def analyse(self, sequence: MeshSequence, progress: Progress | None = None) -> Frames:
        survey, frames = survey_sequence(sequence), reported(sequence, progress, "decimate", len(sequence))
        meshes = [decimated(survey.normalise(frame), self.fraction) for frame in frames]
        return Frames(sequence.frame_rate, survey, meshes)

    def code(self, analysis: Frames, progress: Progress | None = None) -> bytes:
        if self.decoder:
            unit, center = analysis.survey.unit, analysis.survey.center
            return encode_alone(((unit * mesh.vertices + center, mesh.faces) for mesh in analysis.meshes), self.qp)
        points = [(self.qp, self.levels)] * len(analysis.survey.diagonals)
        return write_frames(analysis, points, progress)

    def decode(self, data: bytes) -> Sequence[Mesh]:
        return decode_alone(data) if self.decoder else Options.decode(self, data)


def encode_alone(meshes: Iterable[tuple[np.ndarray, np.ndarray]], qp: int, level: int = LEVEL) -> bytes:
    """Return meshes, of vertices and faces, by DracoPy without a file around them; an empty one has no bytes."""
    how = {"quantization_bits": qp, "compression_level": level}
    return msgspec.msgpack.encode([bytes(DracoPy.encode(*mesh, **how)) if len(mesh[1]) else b"" for mesh in meshes])


def decode_alone(data: bytes) -> list[Mesh]:
    """Return the meshes of `encode_alone`."""
    found = [DracoPy.decode(each) if each else None for each in msgspec.msgpack.decode(data, type=list[bytes])]
    return [Mesh.empty() if mesh is None else Mesh.of(mesh.points, mesh.faces) for mesh in found]


def check_point(fraction: float, qp: int, levels: int) -> None:
    """Raise InputError where decimated Draco cannot be at this point."""
    check_qp(qp)
    if not 0 < fraction <= 1 or not 0 <= levels <= 4:
        raise InputError(f"fraction {fraction:g}, levels {levels}: give 0 < fraction <= 1, levels 0 to 4")


def check_qp(qp: int) -> None:
    """Raise InputError where Draco's lattice would be too coarse or too fine."""
    if not 2 <= qp <= 20:
        raise InputError(f"qp {qp}: give 2 to 20 bits")


def decimated(mesh: Mesh, fraction: float) -> Mesh:
    """Return the mesh with a fraction of its vertices; large meshes take two steps."""
    if fraction == 1 or mesh.is_empty:
        return mesh
    vertices = max(4, round(fraction * len(mesh.vertices)))
    if len(mesh.faces) > max(LARGE, 2 * ON_THE_WAY * vertices):
        mesh = decimate_faces(mesh, 2 * ON_THE_WAY * vertices)
    return decimate(mesh, vertices)


def _encoded(mesh: Mesh, qp: int, levels: int) -> bytes:
    if mesh.is_empty:
        return encode_empty()
    extent = max(float(np.ptp(mesh.vertices, axis=0).max()), 1e-12)
    return encode_intra([mesh], extent / (2**qp - 3), levels)  # wherever the lattice's origin lies


def write_frames(
    frames: Frames, points: Sequence[Point], progress: Progress | None, background: Sequence[Static] = ()
) -> bytes:
    """Return a .reel file of single frames, each at its point, shown with the state of the background of its time."""
    states, shown_with = list(background), tuple[int, ...]()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "anchor.reel"
        with ReelWriter(path, make_header(frames.frame_rate, frames.survey, {})) as writer:
            pairs = reported(zip(frames.meshes, points, strict=True), progress, "code", len(points))
            for number, (mesh, point) in enumerate(pairs):
                while states and states[0].frame <= number:
                    state = states.pop(0)
                    shown_with = (writer.add_static(state.payload, depends_on=shown_with if state.is_patch else ()),)
                depends_on = () if frames.survey.is_bare(number) else shown_with
                writer.add_group(number, 1, _encoded(mesh, *point), (), depends_on)
        return path.read_bytes()
