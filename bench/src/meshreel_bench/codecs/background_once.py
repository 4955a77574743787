"""Background once, as meshreel codes it, then what moves as decimated Draco per frame: an anchor without tracking."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from meshreel.analysis.scene.standing import is_scene
from meshreel.analysis.survey import survey_sequence
from meshreel.encoder.group.progress import Stages
from meshreel.encoder.scene.parts import take_apart
from meshreel.encoder.scene.static import Static, encode_static
from meshreel.encoder.settings.options import SceneOptions
from meshreel.geometry.derived_sequences import captured
from meshreel.geometry.topology import part_of
from meshreel.types import Mesh, MeshSequence

from ..codec import Progress, TwoSteps
from .draco import Frames, check_point, decimated, write_frames


@dataclass(frozen=True, slots=True)
class Still:
    """States of the background of a scene, and its moving faces by frame."""

    background: Sequence[Static]
    moving: Frames


@dataclass(frozen=True, slots=True)
class BackgroundOnceDracoCodec(TwoSteps):
    """A background once, and in every frame `fraction` of the vertices that move."""

    analysis_key: ClassVar[str] = "background once"  # equal for all operating points
    fraction: float = 0.25
    qp: int = 10  # bits along the longest side of what moves
    levels: int = 0  # midpoint subdivisions in the decoder, of what moves

    def __post_init__(self) -> None:
        check_point(self.fraction, self.qp, self.levels)

    @property
    def name(self) -> str:
        return "background_once_draco" + ("_subdivided" if self.levels else "")

    def analyse(self, sequence: MeshSequence, progress: Progress | None = None) -> Still:
        """Return the background and what moves. Raises InputError for frames that cannot be used."""
        stages, options = Stages(progress, len(sequence)), SceneOptions()
        if not (len(sequence) and is_scene(sequence)):
            survey = survey_sequence(sequence, stages.add)
            return Still((), Frames(sequence.frame_rate, survey, [survey.normalise(mesh) for mesh in sequence]))
        parts = take_apart(captured(sequence), survey_sequence(sequence, stages.add, cleaned=False), options, stages)
        states = encode_static(parts, len(sequence), sequence.frame_rate, options)
        moving = list[Mesh]()
        for number, mesh in enumerate(sequence):
            moving.append(parts.survey.normalise(part_of(mesh, parts.segmentation.moving(number, mesh))))
            stages.add("split", 1)
        return Still(states, Frames(sequence.frame_rate, parts.survey, moving))

    def code(self, analysis: Still, progress: Progress | None = None) -> bytes:
        frame_rate, survey, meshes = analysis.moving
        small = Frames(frame_rate, survey, (decimated(mesh, self.fraction) for mesh in meshes))
        points = [(self.qp, self.levels)] * len(survey.diagonals)
        return write_frames(small, points, progress, analysis.background)
