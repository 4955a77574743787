"""The choice of the recipe: an interval becomes groups by the paper's recipe or by that of layers.

In -> out: an interval, the options of a recipe -> groups, in order. An interval needs no other frames, so that
intervals can be encoded side by side.
"""

from __future__ import annotations

from collections.abc import Iterable

from . import layers, paper
from .forms import EncodedGroup
from .interval import Interval
from .options import EncoderOptions, LayersOptions, MethodOptions
from .progress import Stages


def encode_interval(
    interval: Interval, options: MethodOptions, stages: Stages | None = None, find: paper.FindGroups | None = None
) -> Iterable[EncodedGroup]:
    """Encode an interval as groups, in order, by the recipe whose options are given.

    `find` finds the groups of the paper's recipe; pass a store's `find` to reuse an earlier analysis.
    """
    if isinstance(options, LayersOptions):
        return layers.encode_interval(interval, options, stages)
    return paper.encode_interval(interval, options, stages, find)


def encode_apart(interval: Interval, options: MethodOptions) -> list[EncodedGroup]:
    """Encode an interval in a worker process; the result can be pickled."""
    return list(encode_interval(interval, options))


def longest_interval(options: EncoderOptions, frame_rate: float) -> int:
    """Return how many frames an interval has at most: a key interval of layers, or one group of the paper's recipe."""
    if isinstance(options.method, LayersOptions):
        return max(1, round(options.key_interval * frame_rate))
    return options.method.group_size
