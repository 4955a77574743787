"""Templates that may follow the next frames: of a key frame or of the group before, followed outward until lost.

In: the next frames. Out: for each candidate its residual on each frame that it follows, and its fit to those of a
group. What is known of a candidate stays with it, so that no frame is tracked or fitted twice with one template.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, repeat

import numpy as np
from jaxtyping import Float64

from ...analysis.fit.frame import Closeness, FrameSurface
from ...analysis.fit.slide import Slide
from ...analysis.fit.surface_fit import Fitting, strongest_components
from ...analysis.follow.embedded import Painter, Tracker
from ...analysis.follow.template import LEVELS, base_mesh, fused_mesh, shared_detail
from ...coding.layers.coder import LayersState
from ...coding.mesh import CodedReference, code_on_lattice
from ...geometry.color_views import Paint
from ...geometry.threads import mapped
from ...types import Mesh, offset
from ..group.digests import note
from ..group.forms import Target
from .options import LayersOptions

LATTICE = 0.33  # spacing of the base's lattice, in steps: the motion codes what it rounds away (decision 14)
LATTICE_ALONE = 0.8  # the same for a single frame, whose base need not move (decision 14)
MOTIONS = 18.0  # 1/s: components of a noisy body's motion that are kept; weaker ones are noise (decision 28)
LATER, EARLIER = 1, -1  # sides of a key
TOGETHER = 4  # frames that are tracked before they are fitted side by side; beyond a lost one in vain (guess)


@dataclass(frozen=True, slots=True)
class Ahead:
    """The frames that the next group may have, prepared for matching."""

    first: int  # number of the first of them in its interval
    surfaces: list[FrameSurface]
    noise: float  # RMS distance of the frames from the truth, normalised
    target: Target  # that the frames should reach, normalised
    paint: Callable[[int, Mesh], Paint | None] = lambda *_: None  # as `Interval.paint`
    frame_rate: float = 30.0  # 1/s

    def __len__(self) -> int:
        return len(self.surfaces)

    @property
    def numbers(self) -> range:
        """Numbers of the frames in their interval."""
        return range(self.first, self.first + len(self))

    def at(self, number: int) -> FrameSurface:
        """Return the frame with a number. Raises IndexError for a frame that is not ahead."""
        return self.surfaces[offset(number, self.numbers)]

    def painter(self, number: int) -> Painter:
        """Return a callable that opens the colour source of frame `number`."""
        return partial(self.paint, number, self.at(number).mesh)


@dataclass(frozen=True, slots=True)
class Followed:
    """The template at the end of a group, from which the next group may be predicted."""

    reference: CodedReference
    state: LayersState  # as decoded
    positions: Float64[np.ndarray, "V 3"]  # its fit to the last frame
    closeness: Closeness
    residual: float  # usual residual of its fits, RMS
    slide: Slide | None = None  # to where its colours were; None: it has none
    paint: Painter | None = None  # opens the colour source of the last frame


class Candidate:
    """A template that is followed outward from its key, the frame on which it lies, for as long as it fits."""

    def __init__(
        self, ahead: Ahead, key: int, options: LayersOptions, tracker: Tracker, before: Followed | None = None
    ) -> None:
        """Follow the surface of a tracker that begins at the key; `of_key` and `of_group` also give it a template."""
        self.key, self.before, self._options, self._noise = key, before, options, ahead.noise
        self._paint = before.paint if before else ahead.painter(key)  # later frames ahead do not have the key
        self._tolerated = options.tolerance * ahead.noise
        self._target, self._tracker = ahead.target.distance, tracker
        self._fits: dict[int, Float64[np.ndarray, "V 3"]] = {}
        self._residuals = dict[int, float]()
        self.slide: Slide | None = None
        self._closeness: Closeness
        self._ends = dict[int, int]()  # by side, the frame where the template is lost

    @classmethod
    def of_key(cls, ahead: Ahead, key: int, options: LayersOptions, tracker: Tracker | None = None) -> Candidate:
        """Return the template of a key frame ahead; `tracker` is that of another template of the same key."""
        if tracker is None:
            tracker = Tracker(ahead.at(key).mesh, key, options.embedded, ahead.noise, ahead.painter(key))
        found = cls(ahead, key, options, tracker)
        if ahead.noise == 0 or not found._lay_fused(ahead):
            found._lay(ahead)
        return found

    @classmethod
    def of_group(cls, ahead: Ahead, before: Followed, options: LayersOptions) -> Candidate:
        """Return the template at the end of the group before, whose last frame is its key."""
        surface, key = Mesh(before.positions, before.reference.base.faces), ahead.first - 1
        tracker = Tracker(surface, key, options.embedded, ahead.noise, before.paint)
        found = cls(ahead, key, options, tracker, before)
        found._take(before.reference, before.positions, before.closeness)
        found._rest, found._usual, found.slide = before.positions, before.residual, before.slide
        found._fits[key] = before.positions
        return found

    def others(self, ahead: Ahead) -> list[Candidate]:
        """Return templates of the same key with other errors, already followed, where these are tried."""
        if self.key not in ahead.numbers:
            return []  # of an earlier frame, or of the group before
        o, found = self._options, list[Candidate]()
        for error in o.errors:
            options = replace(o, template_error=error * o.template_error, errors=())
            found.append(Candidate.of_key(ahead, self.key, options, self._tracker))
            found[-1].follow(ahead)
        return found

    def follow(self, ahead: Ahead) -> None:
        """Track and fit the frames ahead on both sides of the key, up to one that is lost."""
        if self._usual == np.inf:
            return  # nothing is left of the key's surface as it would be coded
        next(self._tracked(ahead, LATER), None)  # the other side goes on from the motion of the first step
        sides = [copy(self._closeness) for _ in (LATER, EARLIER)]
        mapped(self._follow, repeat(ahead), (LATER, EARLIER), sides)
        self._closeness = min(sides, key=lambda closeness: closeness.usual)

    def _follow(self, ahead: Ahead, side: int, closeness: Closeness) -> None:
        """Track and fit the frames on a side of the key, up to one that is lost."""
        tracked, is_lost = self._tracked(ahead, side), False
        while not is_lost and (some := list(islice(tracked, TOGETHER))):
            new = [number for number in some if number not in self._residuals]
            fitted = dict(zip(new, mapped(self._fitted, repeat(ahead), new), strict=True))
            for number in some:
                if number in fitted:
                    self._take_fit(ahead, number, fitted[number], closeness)
                if is_lost := self._residuals[number] > self._limit(ahead):
                    self._ends[side] = number
                    break

    def residuals(self, ahead: Ahead) -> Float64[np.ndarray, " T"]:
        """Return the residuals on the frames ahead, in units of the distance to reach; infinite where it is lost."""
        found = np.array([self._residuals.get(number, np.inf) for number in ahead.numbers])
        return np.where(found <= self._limit(ahead), found / ahead.target.distance, np.inf)

    def follows(self, ahead: Ahead, numbers: range) -> bool:
        """Return whether none of these frames is lost."""
        first = offset(numbers.start, ahead.numbers)
        return bool(np.isfinite(self.residuals(ahead)[first : first + len(numbers)]).all())

    def fit(self, ahead: Ahead, numbers: range) -> Float64[np.ndarray, "T V 3"]:
        """Return the final fits to successive frames that it follows: near what one shape explains."""
        if len(numbers) > 1 and (rigid := self._tracker.rigid(numbers)) is not None:
            return np.stack([motion.of(self._points) for motion in rigid])
        first = np.stack([self._fits[number] for number in numbers])
        if not self._options.fit.components or len(numbers) == 1:
            return first
        first = self._slid(ahead, numbers, first)
        count = len(self.reference.mesh.vertices)
        usual = first.copy()
        if self._noise > 0:  # what the base does beyond its strongest motions is noise
            most = math.ceil(MOTIONS * len(first) / ahead.frame_rate)
            usual[:, :count] = strongest_components(first[:, :count], len(first) // 2, most)
        detail = shared_detail(self.reference.mesh.faces, count, self.reference.levels)
        surfaces = [ahead.at(number) for number in numbers]
        return np.stack(mapped(self._fitting.second, surfaces, detail(usual), first))

    def _slid(
        self, ahead: Ahead, numbers: range, positions: Float64[np.ndarray, "T V 3"]
    ) -> Float64[np.ndarray, "T V 3"]:
        """Return fits to frames, slid to where these have the colours of the key, or of the first that has colours."""
        others = [number for number in numbers if number != self.key]
        paints = dict(zip(others, mapped(lambda number: ahead.painter(number)(), others), strict=True))
        if self.slide is None:
            starts = {self.key: self._paint() if self._paint else None, **paints}.items()
            faces = self.reference.base.faces
            slides = (Slide(faces, self._fits[number], paint) for number, paint in starts if paint is not None)
            self.slide = next(slides, None)
        if self.slide is None:
            return positions
        found, known = positions.copy(), [number for number, paint in paints.items() if paint is not None]
        fits = [positions[number - numbers.start] for number in known]
        for number, slid in zip(known, mapped(self.slide.to, fits, map(paints.get, known)), strict=True):
            found[number - numbers.start] = slid
        return found

    def followed(
        self, ahead: Ahead, state: LayersState, positions: Float64[np.ndarray, "V 3"], numbers: range
    ) -> Followed:
        """Return the template at the end of a group of these frames, for the group after it."""
        usual = self._usual if self.before else float(np.median([self._residuals[number] for number in numbers]))
        slide, paint = self.slide, ahead.painter(numbers[-1])
        return Followed(self.reference, state, positions, self._closeness, usual, slide, paint)

    def _limit(self, ahead: Ahead) -> float:
        """Return the residual beyond which a frame is lost: there is none below a key that is lost itself."""
        limit, target = self._options.plan_for(ahead.noise).limit, ahead.target.distance
        return 0.0 if self._usual > limit * target and self.before is None else limit * max(target, self._usual)

    def _tracked(self, ahead: Ahead, side: int) -> Iterator[int]:
        """Yield frames outward from the key for as long as the key's surface is tracked."""
        numbers = ahead.numbers
        later, earlier = range(self.key + 1, numbers.stop), range(self.key - 1, numbers.start - 1, -1)
        for number in later if side == LATER else earlier:
            if number == self._ends.get(side):
                return
            residual = self._tracker.residuals.get(number)
            if residual is None:
                residual = self._tracker.step(number, ahead.at(number), ahead.painter(number))
            if residual > self._tracker.lost:
                self._ends[side] = number
                return
            yield number

    def _lay_fused(self, ahead: Ahead) -> bool:
        """Make the template of what all tracked frames have in common; return False where nothing is left of it."""
        tracked = sorted([self.key, *(number for side in (LATER, EARLIER) for number in self._tracked(ahead, side))])
        surfaces = [ahead.at(number) for number in tracked]
        fused = fused_mesh(self._tracker.motion(tracked), surfaces, self._noise)
        if fused.is_empty or (reference := self._coded(ahead, fused)) is None:
            return False
        placed = reference.base.vertices
        fitting = Fitting(reference.base.faces, len(placed), self._options.fit, self._tolerated)
        self._rest = fitting.first(FrameSurface(fused), placed, placed)
        self._take(reference, self._rest)
        self._fit(ahead, self.key)
        self._usual = self._residuals[self.key]
        return True

    def _lay(self, ahead: Ahead) -> None:
        """Make the template of the key frame's surface."""
        self._usual = np.inf
        if (reference := self._coded(ahead, ahead.at(self.key).mesh)) is not None:
            self._rest = reference.base.vertices
            self._take(reference, self._rest)
            self._fit(ahead, self.key)
            self._rest, self._usual = self._fits[self.key], self._residuals[self.key]

    def _coded(self, ahead: Ahead, surface: Mesh) -> CodedReference | None:
        """Return a base mesh of a surface as decoded; None where nothing is left of it."""
        o = self._options
        lattice = o.layers.step_above(self._tolerated) * (LATTICE if len(ahead) > 1 else LATTICE_ALONE)
        reference = code_on_lattice(base_mesh(surface, o.template_error, self._tolerated), lattice, LEVELS)
        note("template, coded", reference.base.vertices, reference.base.faces)
        return None if reference.mesh.is_empty else reference

    def _take(
        self, reference: CodedReference, points: Float64[np.ndarray, "V 3"], closeness: Closeness | None = None
    ) -> None:
        """Let the template's vertices at the key be carried by the tracked surface."""
        faces = reference.base.faces
        self.reference, self._points, self._binding = reference, points, self._tracker.bound(Mesh(points, faces))
        self._fitting = Fitting(faces, len(points), self._options.fit, self._tolerated)
        self._closeness = closeness or Closeness(Mesh(points, faces), self._target, self._noise)

    def _fit(self, ahead: Ahead, number: int) -> None:
        self._take_fit(ahead, number, self._fitted(ahead, number), self._closeness)

    def _fitted(self, ahead: Ahead, number: int) -> Float64[np.ndarray, "V 3"]:
        prediction = self._tracker.placed(number, self._points, self._binding)
        return self._fitting.first(ahead.at(number), self._rest, prediction)

    def _take_fit(self, ahead: Ahead, number: int, positions: Float64[np.ndarray, "V 3"], closeness: Closeness) -> None:
        self._fits[number], self._residuals[number] = positions, closeness.of(positions, ahead.at(number))
        note("first fit", self.key, number, positions)
