"""Masks by SAM3 in the paper's two stages (section 3.2): one view over time, then all views of each frame.

In: pictures of the views, from colour cameras or of normals. Out: masks, and the object that each pixel sees. Stage 1
tracks the prompted objects through a reference view and keeps those that move; stage 2 tracks them through the views of
a frame as if these were a video, and keeps those found in stage 1. Needs the extra `sam3`; the user supplies weights.

Differs from the paper: it does not state its prompts; ours are words, by default `AUTOMATIC`, or motion as in its
release.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float32, Int32, UInt8

from ...errors import InputError
from ...geometry.cameras import Camera
from ...geometry.drawing import Seen
from .color_looks import ColorLooks
from .hypotheses import OVERLAP, VARIATION, Hypotheses, hypotheses, moving_in_views, reference_view, thinned, tour
from .masks import Masker, Picture, normal_picture
from .sam3_trackers import PointTracker, WordTracker

AUTOMATIC = ("person", "animal", "vehicle", "object")  # default prompts: things that may move; a guess
PromptBy = Literal["words", "motion"]


@dataclass(frozen=True, slots=True)
class Sam3Options:
    """Options of masks by SAM3."""

    reference: int | None = None  # number of the view that is tracked over time; None: the one with most changes
    prompt_by: PromptBy = "words"  # prompts of objects: words, or points at which the reference view sees motion
    device: str = "cpu"  # torch's name of a device: cpu, cuda, cuda:1 ...
    variation: float = VARIATION  # smallest variation over time of a moving object's mask
    overlap: float = OVERLAP  # smallest intersection over union of two masks of one object


class Sam3Masks(Masker):
    """Masker that observes the reference view in every frame before it makes masks: two passes over the frames.

    Masks are kept, one bit per pixel, so that further encodes of the same sequence do not run the model again.
    """

    observes = True

    def __init__(self, path: Path, prompts: Sequence[str] | None = None, options: Sam3Options = Sam3Options()) -> None:
        """Load the weights in the folder `path`. Raises InputError if they or the extra `sam3` are missing."""
        self._tracker: WordTracker | PointTracker
        if options.prompt_by == "words":
            self._tracker = WordTracker(path, tuple(prompts or AUTOMATIC), options.device)
        else:
            self._tracker = PointTracker(path, options.device)
        self._options = options
        self._chosen = options.reference
        self._colors: ColorLooks | None = None
        self._pictures: list[Picture] = []
        self._depths: list[Float32[np.ndarray, "h w"]] = []
        self._moving: Hypotheses | None = None
        self._known: dict[int, UInt8[np.ndarray, " B"]] = {}

    @property
    def reference(self) -> int:
        """Number of the view that is tracked over time."""
        return self._chosen or 0

    def foresee(self, moments: Sequence[Sequence[Seen]], colors: ColorLooks | None = None) -> None:
        """Choose the reference view by the motion between a few moments; without this call it is the first view."""
        self._colors = colors
        if self._chosen is None:
            self._chosen = reference_view(moments)

    def observe(self, frame: int, seen: Sequence[Seen], views: Sequence[Camera]) -> None:
        """Keep the reference view's picture of a frame; frames must come in order from 0 on, before the first masks."""
        if self._moving is not None or frame < len(self._pictures):
            return
        assert frame == len(self._pictures), "frames are observed in order, before masks"
        number = self._reference(views)
        self._pictures.append(self._picture(frame, number, seen, views))
        self._depths.append(thinned(seen[number].depth))

    def masks(self, frame: int, seen: Sequence[Seen], views: Sequence[Camera]) -> Bool[np.ndarray, "X H W"]:
        """Return the masks of an observed frame; True: moving."""
        shape = (len(views), views[0].height, views[0].width)
        if frame not in self._known:
            self._known[frame] = np.packbits(self.objects(frame, seen, views) > 0)
        return np.unpackbits(self._known[frame], count=math.prod(shape)).astype(bool).reshape(shape)

    def objects(self, frame: int, seen: Sequence[Seen], views: Sequence[Camera]) -> Int32[np.ndarray, "X H W"]:
        """Return the number, the same in all frames, of the moving object that each pixel sees; 0: none."""
        if self._moving is None:  # stage 1, at the first call
            assert self._pictures, "observe the frames first"
            over_time = self._tracker.over_time(self._pictures, self._depths)
            self._moving = hypotheses(over_time, self._options.variation)
            self._pictures, self._depths = [], []
        moving = self._moving
        if not moving.objects.any():
            return np.zeros((len(views), views[0].height, views[0].width), np.int32)
        order = tour(views, self._reference(views))
        pictures = [self._picture(frame, number, seen, views) for number in order]
        tracked = self._tracker.through_views(pictures, moving.objects[frame])
        return moving_in_views(tracked, moving, frame, self._options.overlap)[np.argsort(order)]

    def _picture(self, frame: int, number: int, seen: Sequence[Seen], views: Sequence[Camera]) -> Picture:
        photo = None if self._colors is None else self._colors.at(frame, number)
        return normal_picture(seen[number], views[number]) if photo is None else photo

    def _reference(self, views: Sequence[Camera]) -> int:
        number = self.reference
        if not 0 <= number < len(views):
            raise InputError(f"reference view {number} of {len(views)}: give 0 to {len(views) - 1}")
        return number
