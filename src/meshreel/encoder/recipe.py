"""The choice of the recipe: an interval of frames becomes groups by the paper's recipe or by that of layers.

In -> out: frames in normalised coordinates, options -> groups, in order. An interval needs no other frames, so that
intervals can be encoded side by side.
"""

from __future__ import annotations

from collections.abc import Iterable

from ..format.layout import Form
from ..types import Frames, Mesh
from . import layers, paper
from .forms import EncodedGroup
from .options import EncoderOptions
from .progress import Stages


def encode_interval(
    frames: Frames, options: EncoderOptions, stages: Stages | None = None, find: paper.FindGroups | None = None
) -> Iterable[EncodedGroup]:
    """Encode an interval as groups, in order, by the recipe that the options name.

    `find` finds the groups of the paper's recipe; pass a store's to reuse an earlier analysis.
    """
    if options.form == Form.LAYERS:
        return layers.encode_interval(frames, options, stages)
    return paper.encode_interval(frames, options, stages, find)


def encode_apart(task: tuple[list[Mesh], EncoderOptions]) -> list[EncodedGroup]:
    """Encode an interval in a worker process; the result can be pickled."""
    return list(encode_interval(*task))
