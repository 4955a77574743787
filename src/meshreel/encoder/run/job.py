"""Encoding job: a sequence, its options, and the means to encode it."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

from ...format.layout import Header
from ...geometry.derived_sequences import DerivedSequence
from ..group.progress import Stages
from ..recipe import Recipe
from ..settings.options import EncoderOptions, SceneOptions
from .interval_files import IntervalFiles

NEUTRAL = Header(1.0, (0.0, 0.0, 0.0), 1.0, (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), '{"encode":""}')  # in normalised units


@dataclass(frozen=True, slots=True)
class Job:
    """A sequence to encode, its options, and the means to do it."""

    sequence: DerivedSequence
    options: EncoderOptions
    executor: Executor | None
    stages: Stages
    recipe: Recipe
    files: IntervalFiles | None = None  # of the output, which the encoding of intervals needs
    head: Header = NEUTRAL  # of the files of intervals
    chosen: range | None = None  # the frames that are encoded; None: all

    @property
    def scene(self) -> SceneOptions:
        """The options of a scene, where the sequence is one."""
        assert self.options.scene is not None, "a sequence without scene options is not taken apart"
        return self.options.scene
