"""Rigid motion of a whole body, such as a door, a crate or a chair: one pose for each frame.

In: the key frame's surface, another frame, an initial motion. Out: the rigid motion that aligns both, by point-to-plane
steps in both directions, and the distance of the worst part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from ...geometry.closest_points import MovingSurface, area_samples
from ...geometry.rigid import fit_rigid
from ...geometry.strict import inverse, products, rotations_of
from ...geometry.topology import vertex_normals
from ...types import Mesh
from ..fit.frame import ON_BORDER, STRAY, FrameSurface, shared_distance
from .embedded_graph import farthest_first

ROUNDS = 20  # largest number of point-to-plane steps (guess)
SETTLED = 1e-5  # diagonals; a step that moves no point by more is the last (guess)
GATE, SHRINKS = 0.03, 0.75  # diagonals, largest distance of a pair in the first round; factor for each round (guess)
NEAREST = 4.0  # RMS noise, smallest such limit (guess)
ALIKE = 0.5  # least cosine between the normals of a pair (guess)
ALONG = 0.1  # weight of frame surface past the body's border, which reveals sliding (guess)
WHOLE, WORST = 1.6, 3.25  # RMS noise, largest residual of the body and of its worst part (doors of room3: decision 28)
BENDS = 1.75  # times the residual of a motion that bends (people: 2.5 and more; decision 28)
EXACT = 1e-4  # diagonals, in place of the noise of clean frames (guess)
SAMPLES = 1500  # of each surface (guess)
FEWEST = 8  # samples of a part that say something of it (guess)
MISSED = 0.25  # share of a part that may be where only a motion that bends brings it (guess)
BLOCKS = 24  # parts of a surface that are judged separately, so that a moving arm is not lost in a mean (guess)


@dataclass(frozen=True, slots=True)
class RigidMotion:
    """The motion x -> turn x + shift."""

    turn: Float64[np.ndarray, "3 3"]
    shift: Float64[np.ndarray, "3"]

    @staticmethod
    def between(source: Float64[np.ndarray, "N 3"], target: Float64[np.ndarray, "N 3"]) -> RigidMotion:
        """Return the rigid motion nearest to that of the points (Kabsch)."""
        turns, shifts = fit_rigid(source[None], target[None], np.ones((1, len(source))))
        return RigidMotion(turns[0], shifts[0])

    def of(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
        """Return the moved points."""
        return products(points, self.turn.T) + self.shift

    def after(self, angles: Float64[np.ndarray, "3"], step: Float64[np.ndarray, "3"]) -> RigidMotion:
        """Return this motion followed by a small turn (half its angles make a quaternion) and a step."""
        turn = rotations_of(np.concatenate([[1.0], angles / 2])[None])[0]
        return RigidMotion(products(turn, self.turn), products(turn, self.shift[:, None])[:, 0] + step)


class RigidBody:
    """A key frame's surface, prepared for rigid alignment with other frames."""

    def __init__(self, mesh: Mesh, noise: float) -> None:
        """`noise` is the RMS distance of the frames from the truth."""
        self._surface, self._noise = MovingSurface(mesh), noise
        self._vertices, self._chosen = mesh.vertices, area_samples(mesh, SAMPLES)
        self._normals = vertex_normals(mesh)[self._chosen]
        centers = mesh.vertices[farthest_first(mesh, self._chosen, BLOCKS)]
        away = ((mesh.vertices[self._chosen][:, None] - centers) ** 2).sum(axis=2)
        self._block = away.argmin(axis=1)

    def brought(self, frame: FrameSurface, motion: RigidMotion) -> RigidMotion:
        """Return the motion that aligns the body with a frame, starting from a motion near it."""
        gate, least = GATE, NEAREST * self._noise
        for _ in range(ROUNDS):
            rows, gaps = self._pairs(frame, motion, max(gate, least))
            if len(rows) < 6:
                break
            normal = products(rows.T, rows) + 1e-9 * np.eye(6)
            step = products(inverse(normal), products(rows.T, gaps[:, None]))[:, 0]
            motion, gate = motion.after(step[:3], step[3:]), SHRINKS * gate
            if np.abs(step).max() < SETTLED:
                break
        return motion

    def holds(self, frame: FrameSurface, motion: RigidMotion, bent: Float64[np.ndarray, "V 3"], free: float) -> bool:
        """Return whether a rigid motion fits a frame about as well as one that bends the body.

        `bent` are the vertices by the latter, `free` is its residual. No part may go where only bending brings it: a
        waving hand is far from the frame, as surface that the frame lacks is.
        """
        overall, worst, found = self.residual(frame, motion)
        noise = max(self._noise, EXACT, free)  # a body may be noisier than the rest
        if overall > min(WHOLE * noise, BENDS * max(free, EXACT)) or worst > WORST * noise:
            return False
        hits = frame.surface.closest(bent[self._chosen])
        near = ((hits.points - bent[self._chosen]) ** 2).sum(axis=1) <= (STRAY * max(self._noise, EXACT)) ** 2
        reached = near & (frame.inside_at(hits) > ON_BORDER)
        missed = np.bincount(self._block[reached & ~found], minlength=BLOCKS)
        return bool((missed <= np.maximum(MISSED * np.bincount(self._block, minlength=BLOCKS), FEWEST)).all())

    def residual(self, frame: FrameSurface, motion: RigidMotion) -> tuple[float, float, Bool[np.ndarray, " S"]]:
        """Return the body's RMS distance from a frame, that of its worst part, and which samples the frame has."""
        vertices, frame_points = motion.of(self._vertices), frame.mesh.vertices[frame.samples(SAMPLES)]
        body = vertices[self._chosen]
        ahead = frame.surface.closest(body)
        with self._surface.at(vertices) as moved:
            back = moved.closest(frame_points)
            over = frame.inside_at(ahead) > ON_BORDER, ~moved.past_border(back)
        squares = frame.gaps(ahead, body, frame.samples(SAMPLES), back.points)
        noise = max(self._noise, EXACT)
        usable = over[0] & (squares[0] <= (STRAY * noise) ** 2)
        count = np.bincount(self._block[usable], minlength=BLOCKS)
        sums = np.bincount(self._block[usable], squares[0][usable], minlength=BLOCKS)
        parts = np.sqrt(sums[count >= FEWEST] / count[count >= FEWEST])
        return shared_distance(squares, over, noise), float(parts.max(initial=0.0)), usable

    def _pairs(
        self, frame: FrameSurface, motion: RigidMotion, gate: float
    ) -> tuple[Float64[np.ndarray, "R 6"], Float64[np.ndarray, " R"]]:
        """Return the rows of a small turn and step for pairs in both directions, and the gaps to close."""
        vertices, target = motion.of(self._vertices), frame.mesh.vertices[frame.samples(SAMPLES)]
        source = vertices[self._chosen]
        ahead = frame.surface.closest(source)
        with self._surface.at(vertices) as moved:
            back = moved.closest(target)
            inside, past = frame.inside_at(ahead) > ON_BORDER, moved.past_border(back)
            facing = frame.surface.normals[ahead.faces], moved.normals[back.faces]
        own_ways, their_ways = products(self._normals, motion.turn.T), frame.normals[frame.samples(SAMPLES)]
        inside &= (facing[0] * own_ways).sum(axis=1) > ALIKE
        within = ~past & ((facing[1] * their_ways).sum(axis=1) > ALIKE)
        rows = list[tuple[np.ndarray, np.ndarray, np.ndarray]]()  # places on the body, directions, gaps along them
        for places, aims, ways, good in (
            (source, ahead.points, facing[0], inside),
            (back.points, target, facing[1], within),
            *((back.points, target, np.broadcast_to(axis, target.shape), past) for axis in ALONG * np.eye(3)),
        ):
            gaps = aims - places
            near = good & ((gaps**2).sum(axis=1) <= gate**2)
            rows.append((places[near], ways[near], (gaps * ways).sum(axis=1)[near]))
        places, ways, gaps = (np.concatenate(each) for each in zip(*rows, strict=True))
        return np.concatenate([np.cross(places, ways), ways], axis=1), gaps
