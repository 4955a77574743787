"""The recipe of layers: base meshes of key frames follow the frames around them for as long as they fit.

In -> out: an interval, whose frames are read in order -> groups with their fidelity. A window of the next frames is
planned: which templates, of key frames or of the group before, follow which of its frames (`analysis.plan`). Frames that
no template follows are coded one by one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..analysis.fit.frame import FrameSurface
from ..analysis.plan import NOBODY, Piece, Plan, best_plan, next_key
from .candidates import Candidate, Followed, Window
from .digests import note
from .forms import EncodedGroup, empty_groups
from .interval import Interval
from .layers_group import GroupCoder
from .options import LayersOptions
from .progress import Stages
from .target import target_of

STILL = 1.1  # times its usual residual that a template may leave without a new fit (guess)
NOISY_KEYS = 2  # keys tried at most under noise: the fused template completes them (decision 16)


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

    def groups(self) -> Iterator[EncodedGroup]:
        """Yield the groups of the interval."""
        end = len(self._interval.frames)
        while self._at < end:
            window = self._window()
            if (still := self._standing(window)) is not None:
                yield still
                continue
            plan, candidates = self._planned(window)
            pieces = plan.pieces if window.numbers.stop == end else plan.pieces[:-1] or plan.pieces
            for piece in pieces:  # the last one may go on beyond the window: it is planned again
                group = self._coded(window, piece, None if piece.template == NOBODY else candidates[piece.template])
                if piece is not plan.pieces[-1]:
                    self._before = None  # another template is better
                yield group
                if group.frame_count < piece.stop - piece.first:
                    break

    def _window(self) -> Window:
        """Return the next frames."""
        numbers = range(self._at, min(self._at + self._options.group_size, len(self._interval.frames)))
        known, digests, noise = self._surfaces, self._interval.digests, self._interval.noise
        self._surfaces = {at: known.get(at) or FrameSurface(self._interval.frames[at]) for at in numbers}
        meshes = [surface.mesh for surface in self._surfaces.values()]
        note(digests, "frames", *(array for mesh in meshes for array in (mesh.vertices, mesh.faces)))
        target = target_of(meshes, self._options.target, noise)
        return Window(self._at, list(self._surfaces.values()), noise, target, digests)

    def _planned(self, window: Window) -> tuple[Plan, list[Candidate]]:
        """Return the plan of a window, and the candidates that its pieces name; keys are tried while they may pay."""
        o, candidates = self._options.plan, [one for one in self._candidates if one.key >= window.first]
        if self._before is not None and self._options.predict:
            candidates.append(Candidate(window, window.first - 1, self._options, self._before))
        for one in candidates:
            one.follow(window)
        plan, misses = self._best(window, candidates), 0
        for _ in range(min(o.keys, NOISY_KEYS) if window.noise else o.keys):
            tried = {number - window.first for number in self._tried}
            if plan.excess.sum() <= o.worth or misses == o.misses or (key := next_key(plan, tried)) is None:
                break
            self._tried.add(window.first + key)
            candidates.append(Candidate(window, window.first + key, self._options))
            candidates[-1].follow(window)
            better = self._best(window, candidates)
            misses = 0 if plan.cost - better.cost > o.gain * o.worth else misses + 1
            plan = better
        used = {piece.template for piece in plan.pieces}
        self._candidates = [one for k, one in enumerate(candidates) if k in used and one.before is None]
        note(window.digests, "plan", plan.pieces, plan.squares)
        return plan, candidates

    def _best(self, window: Window, candidates: list[Candidate]) -> Plan:
        residuals = np.array([one.residuals(window) for one in candidates]).reshape(-1, len(window))
        return best_plan(residuals, [one.before is not None for one in candidates], self._options.plan)

    def _standing(self, window: Window) -> EncodedGroup | None:
        """Code the template where it was, if its residual there is hardly larger than usual: a fit would only slide."""
        before = self._before
        if before is None or not self._options.predict:
            return None
        for surface in reversed(window.surfaces):  # most bodies have moved by the last frame
            if before.closeness.of(before.positions, surface) > STILL * before.residual:
                return None
        positions = np.repeat(before.positions[None], len(window), axis=0)
        group, state = self._coder(window, 0, len(window)).layers(before.reference, positions, before.state)
        self._at += group.frame_count
        self._before = None if state is None else replace(before, state=state)
        return group

    def _coded(self, window: Window, piece: Piece, candidate: Candidate | None) -> EncodedGroup:
        """Code a piece of the plan, or the first of its frames where a group may not hold more."""
        coder, self._before = self._coder(window, piece.first, piece.stop), None
        if candidate is None:
            group = coder.alone()
            self._at += group.frame_count
            return group
        numbers = window.numbers[piece.first : piece.stop]
        positions = candidate.fit(window, numbers)
        note(window.digests, "fit", positions)
        previous = candidate.before.state if candidate.before else None
        group, state = coder.layers(candidate.reference, positions, previous)
        self._at += group.frame_count
        numbers = numbers[: group.frame_count]
        if state is not None:
            self._before = candidate.followed(state, positions[: len(numbers)], numbers)
            if candidate.key in numbers:
                group = replace(group, key=numbers.index(candidate.key))
        return group

    def _coder(self, window: Window, first: int, stop: int) -> GroupCoder:
        meshes = [surface.mesh for surface in window.surfaces[first:stop]]
        return GroupCoder(meshes, window.target, window.noise, self._options, digests=window.digests)
