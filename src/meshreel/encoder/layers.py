"""The recipe of layers: base meshes of key frames follow the frames around them for as long as they fit.

In -> out: an interval, whose frames are read in order -> groups with their fidelity. A window of the next frames is
planned: which templates, of key frames or of the group before, follow which of its frames (`analysis.plan`). Frames
that no template follows are coded one by one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from ..analysis.fit.frame import FrameSurface
from ..analysis.plan import Piece, Plan, best_plan, next_key, rival
from ..format.layout import Form
from .candidates import Candidate, Followed, Window
from .digests import note
from .forms import EncodedGroup, empty_groups, most_for
from .interval import Interval
from .layers_group import GroupCoder
from .options import LayersOptions
from .progress import Stages
from .target import target_of

GOOD = 1.4  # targets: what leaves more is planned anew, though it stands still (guess)
STILL = 1.1  # times its usual residual that a template may leave without a new fit (guess)
NOISY_KEYS = 2  # keys tried at most under noise: the fused template completes them (decision 16)
BY_RATE = 1.33  # the squared error falls with this power of the rate: 4 dB a doubling (decision 0013)
ANGLE_BY_RATE = 0.36  # the normal error falls with this power of the rate (measured on four bodies: decision 0024)
LEAST = 1e-30  # error: its logarithm is finite
Coded = tuple[EncodedGroup, Followed | None]  # a group, and the template that the next may begin with


def encode_interval(interval: Interval, options: LayersOptions, stages: Stages | None = None) -> Iterator[EncodedGroup]:
    """Yield the groups of an interval; only the frames of one window are in memory at a time."""
    frames = interval.frames
    stages = stages or Stages(None, len(frames))
    groups = empty_groups(len(frames)) if frames[0].is_empty else _Planner(interval, options).groups()
    for group in groups:
        stages.add("code", group.frame_count)
        yield group


class _Planner:
    """Plans and codes one window of an interval after the other."""

    def __init__(self, interval: Interval, options: LayersOptions) -> None:
        self._interval, self._options, self._at = interval, options, 0
        self._surfaces = dict[int, FrameSurface]()
        self._candidates, self._tried = list[Candidate](), set[int]()  # of key frames; their numbers
        self._before: Followed | None = None
        self._dearer = 0.0  # bytes a frame for which Draco was no bargain

    def groups(self) -> Iterator[EncodedGroup]:
        """Yield the groups of the interval."""
        while self._at < len(self._interval.frames):
            window = self._window()
            for group, after in self._standing(window) or self._moving(window):
                self._at += group.frame_count
                self._before = after
                if not group.predicted:
                    self._dearer = most_for(group) if group.form == Form.LAYERS else 0.0
                yield group

    def _window(self) -> Window:
        """Return the next frames."""
        numbers = range(self._at, min(self._at + self._options.group_size, len(self._interval.frames)))
        known, digests, noise = self._surfaces, self._interval.digests, self._interval.noise
        self._surfaces = {at: known.get(at) or FrameSurface(self._interval.frames[at]) for at in numbers}
        meshes = [surface.mesh for surface in self._surfaces.values()]
        note(digests, "frames", *(array for mesh in meshes for array in (mesh.vertices, mesh.faces)))
        target = target_of(meshes, self._options.target, noise)
        return Window(self._at, list(self._surfaces.values()), noise, target, digests)

    def _standing(self, window: Window) -> list[Coded]:
        """Code the template where it was, if its residual there is hardly larger than usual: a fit would only slide."""
        before = self._before
        if before is None or not self._options.predict or before.residual > GOOD * window.target.distance:
            return []
        for surface in reversed(window.surfaces):  # most bodies have moved by the last frame
            if before.closeness.of(before.positions, surface) > STILL * before.residual:
                return []
        positions = np.repeat(before.positions[None], len(window), axis=0)
        group, state = self._coder(window, slice(None)).layers(before.reference, positions, before.state)
        return [(group, None if state is None else replace(before, state=state))]

    def _moving(self, window: Window) -> list[Coded]:
        """Code the window by its plan, or by one with other cuts where that costs hardly more and turns out better.

        The last piece may go on beyond the window: it is planned again, with its template, unless it is the only one.
        """
        plan, candidates = self._planned(window)
        is_last, done = window.numbers.stop == len(self._interval.frames), dict[Piece, Coded]()
        other = rival(plan, *_known(window, candidates), self._options.plan)
        note(window.digests, "plans", plan.pieces, other and other.pieces)
        if other is not None:
            tried = [(self._pieces(window, one.pieces, candidates, done), one) for one in (plan, other)]
            noisy = window.noise > 0
            plan = min(tried, key=lambda pair: _cost(pair[0], len(window), noisy))[1]
        goes_on = not is_last and len(plan.pieces) > 1
        self._candidates = [candidates[piece.template] for piece in plan.pieces[-1:] if goes_on and not piece.is_alone]
        return self._pieces(window, plan.pieces[:-1] if goes_on else plan.pieces, candidates, done)

    def _planned(self, window: Window) -> tuple[Plan, list[Candidate]]:
        """Return the plan of a window, and the candidates that its pieces name; keys are tried while they may pay."""
        o, candidates = self._options.plan, list(self._candidates)
        if self._before is not None and self._options.predict:
            candidates.append(Candidate(window, window.first - 1, self._options, self._before))
        for one in candidates:
            one.follow(window)
        plan, misses = best_plan(*_known(window, candidates), o), 0
        for _ in range(min(o.keys, NOISY_KEYS) if window.noise else o.keys):
            tried = {number - window.first for number in self._tried}
            if plan.excess.sum() <= o.settled * o.worth or misses == o.misses or (key := next_key(plan, tried)) is None:
                break
            self._tried.add(window.first + key)
            candidates.append(Candidate(window, window.first + key, self._options))
            candidates[-1].follow(window)
            better = best_plan(*_known(window, candidates), o)
            misses = 0 if plan.cost - better.cost > o.gain * o.worth else misses + 1
            plan = better
        return plan, candidates

    def _pieces(
        self,
        window: Window,
        pieces: Sequence[Piece],
        candidates: Sequence[Candidate],
        done: dict[Piece, Coded],
    ) -> list[Coded]:
        """Code pieces of a plan that are not done; the last group is shorter where a group may not hold more frames."""
        found = list[Coded]()
        for piece in pieces:
            if piece not in done:
                done[piece] = self._piece(window, piece, None if piece.is_alone else candidates[piece.template])
            group, after = done[piece]
            is_short = group.frame_count < piece.stop - piece.first
            found.append((group, after if is_short or piece.stop == len(window) else None))  # else another is better
            if is_short:
                break
        return found

    def _piece(self, window: Window, piece: Piece, candidate: Candidate | None) -> Coded:
        """Code a piece of a plan, or the first of its frames."""
        coder = self._coder(window, slice(piece.first, piece.stop))
        if candidate is None:
            return coder.alone(), None
        numbers = window.numbers[piece.first : piece.stop]
        tried = [candidate, *(one for one in candidate.others(window) if one.follows(window, numbers))]
        coded = [self._with(window, numbers, coder, one) for one in tried]
        return min(coded, key=lambda one: _cost([one], len(numbers), window.noise > 0))

    def _with(self, window: Window, numbers: range, coder: GroupCoder, candidate: Candidate) -> Coded:
        """Code successive frames with a template."""
        positions = candidate.fit(window, numbers)
        note(window.digests, "fit", positions)
        previous = candidate.before.state if candidate.before else None
        group, state = coder.layers(candidate.reference, positions, previous)
        if state is None:
            return group, None
        numbers = numbers[: group.frame_count]
        key = numbers.index(candidate.key) if candidate.key in numbers else None
        return replace(group, key=key), candidate.followed(state, positions[len(numbers) - 1], numbers)

    def _coder(self, window: Window, some: slice) -> GroupCoder:
        chosen, digests = window.surfaces[some], window.digests
        return GroupCoder(chosen, window.target, window.noise, self._options, self._dearer, digests=digests)


def _known(window: Window, candidates: Sequence[Candidate]) -> tuple[Float64[np.ndarray, "C T"], list[bool]]:
    """Return the candidates' residuals on the window's frames, and which of them come from the group before."""
    residuals = np.array([one.residuals(window) for one in candidates]).reshape(-1, len(window))
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
    by_distance = math.log(max(squared, LEAST)) / BY_RATE
    by_angle = by_distance if noisy else math.log(max(angle, LEAST)) / ANGLE_BY_RATE
    return math.log(sum(len(group.payload) for group in groups)) + (by_distance + by_angle) / 2
