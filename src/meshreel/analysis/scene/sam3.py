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
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float32, Int32, UInt8

from ...geometry.cameras import Camera
from ...geometry.drawing import Seen
from .color_looks import ColorLooks
from .hypotheses import Hypotheses, hypotheses, moving_in_views, reference_view, thinned, tour
from .masks import Masker, Picture, normal_picture
from .sam3_trackers import PointTracker, WordTracker

AUTOMATIC = ("person", "animal", "vehicle", "object")  # default prompts: things that may move; a guess
PromptBy = Literal["words", "motion"]


class Sam3Masks(Masker):
    """Masker that observes the reference view in every frame before it makes masks: two passes over the frames.

    Masks are kept, one bit per pixel, so that further encodes of the same sequence do not run the model again.
    """

    observes = True

    def __init__(
        self, path: Path, prompts: Sequence[str] | None = None, prompt_by: PromptBy = "words", device: str = "cpu"
    ) -> None:
        """Load the weights in the folder `path` to a torch device, as cuda:1.

        Objects are prompted for by words, or by points at which the reference view sees motion. Raises InputError if
        the weights or the extra `sam3` are missing.
        """
        self._tracker: WordTracker | PointTracker
        if prompt_by == "words":
            self._tracker = WordTracker(path, tuple(prompts or AUTOMATIC), device)
        else:
            self._tracker = PointTracker(path, device)
        self._chosen: int | None = None
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
        self._pictures.append(self._picture(frame, self.reference, seen, views))
        self._depths.append(thinned(seen[self.reference].depth))

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
            self._moving = hypotheses(over_time)
            self._pictures, self._depths = [], []
        moving = self._moving
        if not moving.objects.any():
            return np.zeros((len(views), views[0].height, views[0].width), np.int32)
        order = tour(views, self.reference)
        pictures = [self._picture(frame, number, seen, views) for number in order]
        tracked = self._tracker.through_views(pictures, moving.objects[frame])
        return moving_in_views(tracked, moving, frame)[np.argsort(order)]

    def _picture(self, frame: int, number: int, seen: Sequence[Seen], views: Sequence[Camera]) -> Picture:
        photo = None if self._colors is None else self._colors.at(frame, number)
        return normal_picture(seen[number], views[number]) if photo is None else photo
