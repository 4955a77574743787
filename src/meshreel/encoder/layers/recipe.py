"""The recipe of layers: base meshes of key frames follow the frames around them for as long as they fit.

In -> out: an interval, whose frames are read in order -> groups with their fidelity. The next frames are
planned together: which templates, of key frames or of the group before, follow which of them (`analysis.plan`). Frames
that no template follows are coded one by one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from ...analysis.fit.frame import FrameSurface
from ...analysis.plan import Plan, PlannedGroup, best_plan, next_key, rival
from ...coding.layers.coder import layers_bytes_by_purpose
from ...format.layout import Form
from ...geometry.threads import mapped
from ..group.digests import note
from ..group.forms import EncodedGroup, empty_groups, most_for, target_of
from ..group.interval import Interval, frames_in
from .candidates import Ahead, Candidate, Followed
from .group_coder import GroupCoder
from .options import LayersOptions
from .tails import EXCHANGE

GOOD = 1.4  # targets: a template with a larger residual is replaced, even where the body stands still (guess)
STILL = 1.1  # times its usual residual that a template may leave without a new fit (guess)
ANGLE_BY_RATE = 0.36  # the normal error falls with this power of the rate (measured on four bodies: decision 24)
PATCHED = 0.5  # share of the bytes of a predicted group from which on a template of its own is tried (guess)
FINER = 4  # times a template is nearer to its key where one did not hold (guess)
LEAST = 1e-30  # error: its logarithm is finite
Coded = tuple[EncodedGroup, Followed | None]  # a group, and the template that may predict the next


@dataclass(frozen=True, slots=True)
class LayersRecipe:
    """The recipe of preset `best`: templates that follow the surface, coded in layers."""

    options: LayersOptions
    key_interval: float = 4.0  # s, at most, from one random-access point to the next
    colored: bool = True  # the file keeps colours, which then also tell where the surface is

    name: ClassVar[str] = "best"
    bodies_apart: ClassVar[bool] = True  # bodies that never touch become separate tracks
    judged: ClassVar[bool] = True  # what does not hold is encoded again

    def longest(self, frame_rate: float) -> int:
        """Return the number of frames in a key interval."""
        return frames_in(self.key_interval, frame_rate)

    def finer(self) -> LayersRecipe:
        """Return the same with templates that are nearer to their keys, each for fewer frames."""
        o = self.options
        small = max(1, o.group_size // FINER)
        return replace(self, options=replace(o, template_error=o.template_error / FINER, group_size=small, errors=()))

    def encode(self, interval: Interval) -> Iterator[EncodedGroup]:
        """Yield the groups of an interval; only the frames of one plan are in memory at a time."""
        frames = interval.frames
        yield from empty_groups(len(frames)) if frames[0].is_empty else _Planner(interval, self).groups()


class _Planner:
    """Plans the next frames of an interval and codes them, until none is left."""

    def __init__(self, interval: Interval, recipe: LayersRecipe) -> None:
        self._interval, self._options, self._at = interval, recipe.options, 0
        self._colored = recipe.colored
        self._target = recipe.options.target.scaled(interval.larger)
        # A frame in the `draco` form has no pictures, and codes noise.
        self._draco = recipe.options.floor and not (interval.noise or interval.pictured)
        self._surfaces = dict[int, FrameSurface]()
        self._candidates, self._tried = list[Candidate](), set[int]()  # of key frames; their numbers
        self._before: Followed | None = None
        self._dearer = 0.0  # bytes a frame for which Draco was no bargain

    def groups(self) -> Iterator[EncodedGroup]:
        """Yield the groups of the interval."""
        while self._at < len(self._interval.frames):
            ahead = self._next_frames()
            for group, after in self._standing(ahead) or self._moving(ahead):
                self._at += group.frame_count
                self._before = after
                if not group.predicted:
                    self._dearer = most_for(group) if group.form == Form.LAYERS else 0.0
                yield group

    def _next_frames(self) -> Ahead:
        """Return the next frames."""
        numbers = range(self._at, min(self._at + self._options.group_size, len(self._interval.frames)))
        known, noise = self._surfaces, self._interval.noise
        self._surfaces = dict(zip(numbers, mapped(lambda at: known.get(at) or self._surface(at), numbers), strict=True))
        meshes = [surface.mesh for surface in self._surfaces.values()]
        note("frames", *(array for mesh in meshes for array in (mesh.vertices, mesh.faces)))
        target = target_of(meshes, self._target, noise)
        ahead = Ahead(self._at, list(self._surfaces.values()), noise, target, frame_rate=self._interval.frame_rate)
        return replace(ahead, paint=self._interval.paint) if self._colored else ahead

    def _surface(self, number: int) -> FrameSurface:
        interval, mesh = self._interval, self._interval.frames[number]
        free = interval.free(number) if self._options.tails else None
        return FrameSurface(mesh, free, interval.unevenness(mesh.vertices))

    def _standing(self, ahead: Ahead) -> list[Coded]:
        """Code the template where it was, if its residual there is hardly larger than usual: a fit would only slide."""
        before = self._before
        if before is None or not self._options.predict or before.residual > GOOD * ahead.target.distance:
            return []
        for surface in reversed(ahead.surfaces):  # most bodies have moved by the last frame
            if before.closeness.of(before.positions, surface) > STILL * before.residual:
                return []
        positions = np.repeat(before.positions[None], len(ahead), axis=0)
        group, state = self._coder(ahead, slice(None)).layers(before.reference, positions, before.state)
        return [(group, None if state is None else replace(before, state=state))]

    def _moving(self, ahead: Ahead) -> list[Coded]:
        """Code the frames ahead by their plan, or by another one that costs hardly more and turns out better.

        The last group may go on beyond these frames: it is planned again, with its template, unless it is the only one.
        """
        plan, candidates = self._planned(ahead)
        is_last, done = ahead.numbers.stop == len(self._interval.frames), dict[PlannedGroup, Coded]()
        other = rival(plan, *_known(ahead, candidates), self._options.plan_for(ahead.noise))
        note("plans", plan.groups, other and other.groups)
        if other is not None:
            tried = [(self._all(ahead, one.groups, candidates, done), one) for one in (plan, other)]
            plan = min(tried, key=lambda pair: _cost(pair[0], len(ahead), ahead.noise > 0))[1]
        goes_on = not is_last and len(plan.groups) > 1
        self._candidates = [candidates[each.template] for each in plan.groups[-1:] if goes_on and not each.is_alone]
        return self._all(ahead, plan.groups[:-1] if goes_on else plan.groups, candidates, done)

    def _planned(self, ahead: Ahead) -> tuple[Plan, list[Candidate]]:
        """Return the plan of the frames ahead and the candidates that it names; keys are tried while they may pay."""
        o, candidates = self._options.plan_for(ahead.noise), list(self._candidates)
        if self._before is not None and self._options.predict:
            candidates.append(Candidate.of_group(ahead, self._before, self._options))
        for one in candidates:
            one.follow(ahead)
        plan, misses = best_plan(*_known(ahead, candidates), o), 0
        for _ in range(o.keys):
            tried = {number - ahead.first for number in self._tried}
            if plan.excess.sum() <= o.settled * o.worth or misses == o.misses or (key := next_key(plan, tried)) is None:
                break
            self._tried.add(ahead.first + key)
            candidates.append(Candidate.of_key(ahead, ahead.first + key, self._options))
            candidates[-1].follow(ahead)
            better = best_plan(*_known(ahead, candidates), o)
            misses = 0 if plan.cost - better.cost > o.gain * o.worth else misses + 1
            plan = better
        return plan, candidates

    def _all(
        self,
        ahead: Ahead,
        planned: Sequence[PlannedGroup],
        candidates: Sequence[Candidate],
        done: dict[PlannedGroup, Coded],
    ) -> list[Coded]:
        """Code groups of a plan that are not done; the last group is shorter where a group may not hold more frames."""
        found = list[Coded]()
        for each in planned:
            if each not in done:
                done[each] = self._one(ahead, each, None if each.is_alone else candidates[each.template])
            group, after = done[each]
            is_short = group.frame_count < each.stop - each.first
            found.append((group, after if is_short or each.stop == len(ahead) else None))  # else another is better
            if is_short:
                break
        return found

    def _one(self, ahead: Ahead, each: PlannedGroup, candidate: Candidate | None) -> Coded:
        """Code a group of a plan, or the first of its frames."""
        coder = self._coder(ahead, slice(each.first, each.stop))
        if candidate is None:
            return coder.alone(), None
        numbers = ahead.numbers[each.first : each.stop]
        tried = [candidate, *(one for one in candidate.others(ahead) if one.follows(ahead, numbers))]
        coded = [self._with(ahead, numbers, coder, one) for one in tried]
        if candidate.before is not None and ahead.noise > 0 and _is_patched(coded[0][0]):
            fresh = Candidate.of_key(ahead, numbers[len(numbers) // 2], self._options)
            fresh.follow(ahead)
            coded += [self._with(ahead, numbers, coder, fresh)] if fresh.follows(ahead, numbers) else []
        return min(coded, key=lambda one: _cost([one], len(numbers), ahead.noise > 0))

    def _with(self, ahead: Ahead, numbers: range, coder: GroupCoder, candidate: Candidate) -> Coded:
        """Code successive frames with a template."""
        positions = candidate.fit(ahead, numbers)
        note("fit", positions)
        previous = candidate.before.state if candidate.before else None
        group, state = coder.layers(candidate.reference, positions, previous)
        if state is None:
            return group, None
        numbers = numbers[: group.frame_count]
        key = numbers.index(candidate.key) if candidate.key in numbers else None
        return replace(group, key=key), candidate.followed(ahead, state, positions[len(numbers) - 1], numbers)

    def _coder(self, ahead: Ahead, some: slice) -> GroupCoder:
        return GroupCoder(ahead.surfaces[some], ahead.target, ahead.noise, self._options, self._draco, self._dearer)


def _is_patched(group: EncodedGroup) -> bool:
    """Return whether most of a group's bytes repeat, frame by frame, surface that its template lacks.

    Noisy bodies show sides of themselves that the template's frames did not have: a door that opens.
    """
    if group.form != Form.LAYERS:
        return False
    return layers_bytes_by_purpose(group.payload).get("patches", 0) > PATCHED * len(group.payload)


def _known(ahead: Ahead, candidates: Sequence[Candidate]) -> tuple[Float64[np.ndarray, "C T"], list[bool]]:
    """Return the candidates' residuals on the frames ahead, and which of them come from the group before."""
    residuals = np.array([one.residuals(ahead) for one in candidates]).reshape(-1, len(ahead))
    return residuals, [one.before is not None for one in candidates]


def _cost(coded: Sequence[Coded], frames: int, noisy: bool) -> float:
    """Return the logarithm of the rate at equal errors; infinite where groups hold not all of the frames.

    Distances and normals count half each: both fall when the rate rises. Under noise, normals say nothing.
    """
    groups = [group for group, _ in coded]
    if sum(group.frame_count for group in groups) < frames:
        return math.inf
    squared = sum(group.frame_count * group.fidelity.distance**2 for group in groups) / frames
    angle = sum(group.frame_count * group.fidelity.angle for group in groups) / frames
    by_distance = math.log(max(squared, LEAST)) / EXCHANGE
    by_angle = by_distance if noisy else math.log(max(angle, LEAST)) / ANGLE_BY_RATE
    return math.log(sum(len(group.payload) for group in groups)) + (by_distance + by_angle) / 2
