"""Background once, then decimated Draco per frame: the strongest anchor that needs no tracking. A sequence <-> .reel.

What stands still is what the product finds, coded once as the product codes it; what moves of every frame is decimated
and coded by Draco on its own. A sequence that is no scene is decimated Draco per frame.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from meshreel.analysis.scene.probe import is_scene
from meshreel.analysis.survey import Survey, survey
from meshreel.container.writer import ReelWriter
from meshreel.decoder.video import open as open_video
from meshreel.encoder.parts import take_apart
from meshreel.encoder.presets import preset_options
from meshreel.encoder.progress import Stages
from meshreel.encoder.scene import Static, encode_static
from meshreel.encoder.sequence import make_header
from meshreel.geometry.topology import part_of
from meshreel.types import Mesh, MeshSequence

from ..codec import Progress
from .draco import check_point, decimated, encode_frame


@dataclass(frozen=True, slots=True)
class Still:
    """What stands still, and what is left of the frames."""

    frame_rate: float
    seen: Survey
    states: Sequence[Static]  # of the background
    moving: list[Mesh]  # what moves in each frame, normalised


@dataclass(frozen=True, slots=True)
class BackgroundOnceDracoCodec:
    """A background once, and `fraction` of the vertices of what moves, Draco at `qp` bits, in every frame."""

    fraction: float = 0.25
    qp: int = 10
    levels: int = 0  # midpoint subdivisions in the decoder, of what moves

    def __post_init__(self) -> None:
        check_point(self.fraction, self.qp, self.levels)

    @property
    def name(self) -> str:
        """What rows and plots call it."""
        return "background_once_draco" + ("_subdivided" if self.levels else "")

    @property
    def options(self) -> dict[str, Any]:
        """The operating point, ready for JSON."""
        return asdict(self)

    @property
    def analysis_key(self) -> str:
        """The same for all operating points."""
        return "background once"

    def analyse(self, sequence: MeshSequence, progress: Progress | None = None) -> Still:
        """What stands still. Raises InputError for frames that cannot be used."""
        stages, options = Stages(progress, len(sequence)), preset_options("best")
        if not (len(sequence) and is_scene(sequence)):
            seen = survey(sequence, stages)
            return Still(sequence.frame_rate, seen, (), [seen.normalise(mesh) for mesh in sequence])
        parts = take_apart(sequence, survey(sequence, stages, cleaned=False), options, stages)
        states = encode_static(parts, len(sequence), sequence.frame_rate, options.background)
        moving = list[Mesh]()
        for number, mesh in enumerate(sequence):
            moving.append(parts.seen.normalise(part_of(mesh, parts.segmentation.moving(number, mesh))))
            stages.add("split", 1)
        return Still(sequence.frame_rate, parts.seen, states, moving)

    def code(self, analysis: Still, progress: Progress | None = None) -> bytes:
        """A .reel file of single frames behind a background."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "anchor.reel"
            with ReelWriter(path, make_header(analysis.frame_rate, analysis.seen, {})) as writer:
                for number, static in enumerate(_written(writer, analysis)):
                    data = encode_frame(decimated(analysis.moving[number], self.fraction), self.qp, self.levels)
                    writer.add_group(number, 1, data, (), static)
                    if progress is not None:
                        progress("code", number + 1, len(analysis.moving))
            return path.read_bytes()

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """A .reel file of single frames behind a background. Raises InputError for frames that cannot be used."""
        return self.code(self.analyse(sequence, progress), progress)

    def decode(self, data: bytes) -> Sequence[Mesh]:
        """The frames, from the bytes alone."""
        return open_video(data)


def _written(writer: ReelWriter, still: Still) -> Iterator[tuple[int, ...]]:
    """The numbers of the chunks that each frame is shown with; each state is written before its first frame."""
    states, static = list(still.states), tuple[int, ...]()
    for number in range(len(still.moving)):
        while states and states[0].frame <= number:
            state = states.pop(0)
            static = (writer.add_static(state.payload, depends_on=list(static) if state.is_patch else ()),)
        yield () if still.seen.is_bare(number) else static
