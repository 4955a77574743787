"""A procedural person of capsules, an adult of 1.75 m at its own origin: +z is ahead, y up, x to its left."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from .implicit import Body, Chain

Row = tuple[tuple[float, ...], tuple[float, ...], float, float]  # start, end, their radii; m
Vector = Float64[np.ndarray, "3"]

_THIGH, _SHIN, _UPPER_ARM, _FOREARM = 0.43, 0.415, 0.28, 0.25  # m, lengths of an adult's bones (guess)
_STANCE = 0.6  # share of a step cycle that a foot is on the ground, about as in human gait (guess)


@dataclass(frozen=True, slots=True)
class Pose:
    """Position, gait and gestures of a person at one moment."""

    place: Vector  # m, the ground between the feet
    heading: float  # rad about y; 0 faces +z
    step: float = 0.0  # step cycles walked so far
    stride: float = 0.0  # m, length of a step at this moment
    wrists: tuple[Vector | None, Vector | None] = (None, None)  # left, right: world targets; None: the arm swings
    reach: tuple[float, float] = (0.0, 0.0)  # how far each wrist is on its way to its target, 0 to 1
    softness: float = 0.0  # -1 to 1: deflection of belly and chest
    size: float = 1.0  # relative to an adult
    girth: float = 1.0  # relative to an average adult's radii
    hips: tuple[float, float] = (0.0, 0.0)  # m above and ahead of where they are when standing; sitting: both negative
    lean: float = 0.0  # rad, of the trunk forward about the hips


def figure(pose: Pose, thinnest: float) -> Body:
    """Return the person's parts in world coordinates, none thinner than `thinnest` (m), so that a grid resolves it."""
    bob = -pose.stride * (0.035 + 0.02 * np.cos(4 * np.pi * pose.step))  # lowest when both feet are far apart
    lift = np.array([0.0, bob + pose.hips[0], pose.hips[1]])
    trunk = (_torso(lift, pose), _head(lift))
    chains = [replace(c, starts=_lean(c.starts, lift, pose.lean), ends=_lean(c.ends, lift, pose.lean)) for c in trunk]
    for side, phase in ((1.0, 0.0), (-1.0, 0.5)):
        chains += [_leg(lift, side, pose.step + phase, pose.stride), *_arm(lift, side, pose)]
    turn, body = turn_about_y(pose.heading), list[Chain]()
    for chain in chains:
        starts, ends = (pose.size * places @ turn.T + pose.place for places in (chain.starts, chain.ends))
        radii = np.maximum(pose.size * chain.radii, thinnest)
        body.append(Chain(starts, ends, radii, chain.blend * pose.size, chain.join * pose.size))
    return tuple(body)


def turn_about_y(angle: float) -> Float64[np.ndarray, "3 3"]:
    """Return the rotation that takes +z to the heading `angle`, rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _chain(rows: list[Row], blend: float, join: float, by: Vector | float = 0.0) -> Chain:
    """Return the chain of these parts, moved `by` metres."""
    starts, ends = np.array([row[0] for row in rows], float), np.array([row[1] for row in rows], float)
    return Chain(starts + by, ends + by, np.array([row[2:] for row in rows], dtype=np.float64), blend, join)


def _lean(points: np.ndarray, lift: Vector, lean: float) -> np.ndarray:
    """Turn points of the trunk about the hips."""
    if lean == 0:  # the same bytes as ever
        return points
    (c, s), hips = (np.cos(lean), np.sin(lean)), np.array([0.0, 0.95, 0.0]) + lift
    return (points - hips) @ np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]]) + hips


def _torso(lift: Vector, pose: Pose) -> Chain:
    g, wobble = pose.girth, 0.008 * pose.softness
    rows: list[Row] = [
        ((-0.13, 1.405, -0.01), (0.13, 1.405, -0.01), 0.060, 0.060),  # shoulders
        ((-0.07, 1.30, 0.01), (0.07, 1.30, 0.01), 0.100 * g + wobble, 0.100 * g + wobble),  # chest
        ((-0.055, 1.13, 0.0), (0.055, 1.13, 0.0), 0.092 * g, 0.092 * g),  # waist
        ((0.0, 1.08, 0.03), (0.0, 1.12, 0.03), 0.085 * g * g - wobble, 0.080 * g * g - wobble),  # belly
        ((-0.075, 0.96, -0.01), (0.075, 0.96, -0.01), 0.100 * g, 0.100 * g),  # hips
        ((-0.07, 0.93, -0.05), (0.07, 0.93, -0.05), 0.072 * g, 0.072 * g),  # seat
    ]
    return _chain(rows, 0.09, 0.04, lift)


def _head(lift: Vector) -> Chain:
    rows: list[Row] = [
        ((0.0, 1.42, -0.015), (0.0, 1.56, 0.005), 0.060, 0.054),  # neck
        ((0.0, 1.675, -0.015), (0.0, 1.670, 0.015), 0.090, 0.084),  # skull
        ((0.0, 1.645, 0.03), (0.0, 1.585, 0.055), 0.066, 0.036),  # face and chin
        ((0.0, 1.665, 0.105), (0.0, 1.638, 0.118), 0.010, 0.014),  # nose
        ((0.088, 1.655, 0.0), (0.090, 1.635, -0.004), 0.016, 0.012),  # ears
        ((-0.088, 1.655, 0.0), (-0.090, 1.635, -0.004), 0.016, 0.012),
    ]
    return _chain(rows, 0.025, 0.05, lift + [0.0, -0.02, 0.0])


def _leg(lift: Vector, side: float, phase: float, stride: float) -> Chain:
    ahead, up, pitch = _foot_track(phase)
    hip = np.array([0.09 * side, 0.92, 0.0]) + lift
    ankle = np.array([0.10 * side, 0.085 + up * stride, ahead * stride])
    knee, ankle = bent(hip, ankle, (_THIGH, _SHIN), np.array([0.12 * side, 0.0, 1.0]))
    slope = pitch * min(stride / 0.5, 1.0)
    toward = np.array([0.18 * side, -np.sin(slope), np.cos(slope)])
    heel, ball = ankle + [0.0, -0.045, -0.03], ankle + [0.0, -0.05, 0.0] + 0.11 * toward
    toes, calf = ball + 0.05 * toward, knee + 0.32 * (ankle - knee) + np.array([0.0, 0.0, -0.018])
    rows = [
        (tuple(hip), tuple(knee), 0.086, 0.054),
        (tuple(knee), tuple(ankle), 0.052, 0.036),
        (tuple(calf), tuple(calf + 0.25 * (ankle - knee)), 0.050, 0.040),
        (tuple(heel), tuple(ball), 0.036, 0.034),
        (tuple(ankle), tuple(ball), 0.038, 0.030),
        (tuple(ball + [0.012, 0.0, 0.0]), tuple(toes + [0.012, 0.0, 0.0]), 0.028, 0.022),
        (tuple(ball - [0.012, 0.0, 0.0]), tuple(toes - [0.012, 0.0, 0.0]), 0.028, 0.022),
    ]
    return _chain(rows, 0.03, 0.04)


def _foot_track(phase: float) -> tuple[float, float, float]:
    """Return how far a foot is ahead of the hip and above the ground, in strides, and its downward pitch, rad."""
    u = phase % 1.0
    if u < _STANCE:
        return 0.5 - u / _STANCE, 0.0, 0.0
    s = (u - _STANCE) / (1 - _STANCE)
    return -0.5 + s * s * (3 - 2 * s), 0.22 * np.sin(np.pi * s), 0.7 * np.sin(np.pi * s) * np.cos(np.pi * s)


def _arm(lift: Vector, side: float, pose: Pose) -> list[Chain]:
    which = 0 if side > 0 else 1
    shoulder = _lean(np.array([0.185 * side, 1.40, -0.01]) + lift, lift, pose.lean)
    swing = -side * np.cos(2 * np.pi * pose.step) * pose.stride * 0.35
    wrist = np.array([0.25 * side, 0.92 + 0.25 * abs(swing), 0.06 + swing]) + lift
    pole = np.array([0.35 * side, -0.2, -1.0])
    target, reach = pose.wrists[which], pose.reach[which]
    if target is not None and reach > 0:
        local = turn_about_y(-pose.heading) @ (target - pose.place) / pose.size
        out = np.array([0.12 * side, 0.0, 0.10]) * 4 * reach * (1 - reach)  # around the hip, not through it
        wrist = (1 - reach) * wrist + reach * local + out
        pole = (1 - reach) * pole + reach * np.array([0.8 * side, -1.0, -0.3])
    elbow, wrist = bent(shoulder, wrist, (_UPPER_ARM, _FOREARM), pole)
    upper = [(tuple(shoulder), tuple(elbow), 0.056, 0.041), (tuple(elbow), tuple(wrist), 0.042, 0.028)]
    upper += [(tuple(elbow + 0.1 * (wrist - elbow)), tuple(elbow + 0.4 * (wrist - elbow)), 0.043, 0.038)]
    return [_chain([*upper, *_hand(wrist, wrist - elbow, side)], 0.018, 0.035)]


def _hand(wrist: Vector, along: Vector, side: float) -> list[Row]:
    """Return palm, fingers and thumb; the flat side of the palm faces the middle of the body."""
    along = along / np.linalg.norm(along)
    flat = np.array([side, 0.0, 0.3])
    flat = flat - along * (flat @ along)
    flat = flat / max(float(np.linalg.norm(flat)), 1e-9)
    across = np.cross(along, flat) * side  # towards the thumb
    across = across if across[2] > 0 or (abs(across[2]) < 0.3 and across[1] > 0) else -across
    rows: list[Row] = []
    for offset, length in ((-0.024, 0.075), (0.0, 0.095), (0.022, 0.088)):
        knuckle = wrist + 0.085 * along + offset * across
        tip = knuckle + length * along + 0.5 * offset * across - 0.012 * flat
        base = wrist + 0.5 * offset * across
        rows += [(tuple(base), tuple(knuckle), 0.022, 0.018), (tuple(knuckle), tuple(tip), 0.015, 0.012)]
    root = wrist + 0.03 * along + 0.02 * across
    rows += [(tuple(root), tuple(root + 0.045 * along + 0.045 * across - 0.01 * flat), 0.018, 0.013)]
    return rows


def bent(root: Vector, end: Vector, lengths: tuple[float, float], pole: Vector) -> tuple[Vector, Vector]:
    """Return the middle joint and the end of a two-bone limb; the joint bends towards the pole."""
    first, second = lengths
    span = end - root
    distance = float(np.clip(np.linalg.norm(span), abs(first - second) + 0.02, 0.995 * (first + second)))
    along = span / max(float(np.linalg.norm(span)), 1e-9)
    share = (first**2 + distance**2 - second**2) / (2 * distance)
    aside = pole - along * (pole @ along)
    aside = aside / max(float(np.linalg.norm(aside)), 1e-9)
    return root + share * along + np.sqrt(max(first**2 - share**2, 0.0)) * aside, root + distance * along
