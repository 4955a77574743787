"""Encoding job: a sequence, its options, and the means to encode it."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

from ...geometry.derived_sequences import DerivedSequence
from ..group.digests import WriteLines, line_of
from ..group.progress import Stages
from ..recipe import Recipe
from ..settings.options import EncoderOptions, SceneOptions
from .excerpt import Excerpt
from .journal import Journal


@dataclass(frozen=True, slots=True)
class Job:
    """A sequence to encode, its options, and the means to do it."""

    sequence: DerivedSequence
    options: EncoderOptions
    executor: Executor | None
    stages: Stages
    recipe: Recipe
    journal: Journal | None = None  # of the output; None where groups are not kept
    digests: WriteLines | None = None  # of what the stages compute; None where nobody asks
    excerpt: Excerpt | None = None  # the frames that are encoded; None: all

    def note(self, stage: str, *values: object) -> None:
        """Write the line of a stage where digests are wanted."""
        if self.digests is not None:
            self.digests(line_of(stage, *values))

    @property
    def scene(self) -> SceneOptions:
        """The options of a scene, where the sequence is one."""
        assert self.options.scene is not None, "a sequence without scene options is not taken apart"
        return self.options.scene
