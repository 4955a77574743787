"""Background once, as meshreel codes it, then what moves as decimated Draco per frame: an anchor without tracking."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from meshreel.analysis.survey import survey_sequence
from meshreel.encoder.scene.static import Static, encode_static
from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.options import EncoderOptions, SceneOptions
from meshreel.geometry.topology import part_of
from meshreel.types import MeshSequence

from ..codec import Progress, TwoSteps, of_encoder
from .draco import Frames, check_point, decimated, write_frames

Still = tuple[Sequence[Static], Frames]  # states of the background of a scene, and its moving faces by frame


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
        if (parts := Encoder(sequence, progress=of_encoder(progress)).parts(EncoderOptions())) is None:
            survey = survey_sequence(sequence)
            return (), Frames(sequence.frame_rate, survey, [survey.normalise(mesh) for mesh in sequence])
        states = encode_static(parts, len(sequence), sequence.frame_rate, SceneOptions())
        pairs = ((mesh, parts.segmentation.moving(number, mesh)) for number, mesh in enumerate(sequence))
        moving = [parts.survey.normalise(part_of(mesh, moves)) for mesh, moves in pairs]
        return states, Frames(sequence.frame_rate, parts.survey, moving)

    def code(self, analysis: Still, progress: Progress | None = None) -> bytes:
        background, (frame_rate, survey, meshes) = analysis
        small = Frames(frame_rate, survey, (decimated(mesh, self.fraction) for mesh in meshes))
        points = [(self.qp, self.levels)] * len(survey.diagonals)
        return write_frames(small, points, progress, background)
