"""Story of the demo: a woman walks in and waves, a child looks up at her and jumps for joy.

Times and sizes are guesses by eye. Afterwards the woman stands there, and the child jumps again and again.
"""

from __future__ import annotations

import math

import numpy as np

from .sculpture import Vector
from .skeleton import Limb, Stance

STEP, PACE = 0.60, 0.52  # m and s, of a step
SLOWING, ARRIVAL = 0.45, 1.35  # s, when the woman begins to slow down and when she has stopped
BEGIN, WAY = np.array([-0.98, 0.0, -0.42]), 0.70  # m, where she comes from, and rad, where to
STANCE = 0.6  # share of a step cycle that a foot is on the floor, about as in human gait
PERIOD, LEAP = 3.0, 0.62  # s, between jumps of the child, and of the first one
HEIGHT, GRAVITY = 0.17, 9.81  # m and m/s^2, of a jump
HANGING = np.array([0.225, 0.892, 0.045])  # m, of a left wrist
SIDES = np.array([1.0, 1.0, 1.0]), np.array([-1.0, 1.0, 1.0])  # left and right, of what is given for the left
BACK = np.array([0.45, -0.2, -1.0])  # way that the left elbow points to, then


def stances(time: float) -> tuple[Stance, Stance]:
    """Return the stances of the woman and of the child at a time, s."""
    return _woman(time), _child(time)


def curve(time: float, *points: tuple[float, float]) -> float:
    """Return a smooth curve through points (time, value), constant before and after; it does not overshoot."""
    times, values = zip(*points, strict=True)
    after = int(np.searchsorted(times, time))
    if after in (0, len(times)):
        return values[min(after, len(times) - 1)]
    share = (time - times[after - 1]) / (times[after] - times[after - 1])
    return values[after - 1] + share * share * (3 - 2 * share) * (values[after] - values[after - 1])


def walked(time: float) -> float:
    """Return the way of the woman until a time, m: steady, then slower and slower."""
    late, whole = min(max(time - SLOWING, 0.0), ARRIVAL - SLOWING), ARRIVAL - SLOWING
    return STEP / PACE * (min(time, SLOWING) + late - late * late / (2 * whole))


def _woman(time: float) -> Stance:
    way, phase = np.array([math.sin(WAY), 0.0, math.cos(WAY)]), time / (2 * PACE) + 0.15  # step cycles
    speed = (walked(time + 0.1) - walked(time - 0.1)) / 0.2 * PACE / STEP
    feet = _foot(time, phase, 1.0), _foot(time, phase + 0.5, -1.0)
    lift = -0.006 - 0.022 * speed - 0.012 * speed * math.cos(4 * math.pi * phase)
    swing = math.cos(2 * math.pi * (phase - 0.05)) * speed
    raised = curve(time, (0.55, 0.0), (1.1, 1.0), (3.2, 1.0), (3.9, 0.0))
    waving = curve(time, (0.9, 0.0), (1.2, 1.0), (3.0, 1.0), (3.4, 0.0)) * math.sin(3.8 * math.pi * (time - 0.9))
    low = HANGING * SIDES[1] + [0.0, 0.0, 0.23 * swing]
    wrist = _between(low, np.array([-0.42, 1.15, 0.26]), np.array([-0.30 - 0.075 * waving, 1.60, 0.17]), raised)
    pole = (1 - raised) * BACK * SIDES[1] + raised * np.array([-0.8, -1.0, -0.15])
    left = Limb(HANGING - [0.0, 0.0, 0.23 * swing], BACK, 0.28)
    right = Limb(wrist, pole, 0.28 - 0.24 * raised, 0.25 * waving)
    head = (
        curve(time, (0.0, -0.12), (1.2, 0.06)),
        curve(time, (0.0, -0.05), (1.0, -0.12)),
        0.05 * waving + 0.08 * raised,
    )
    tilt = 0.045 * speed * math.sin(2 * math.pi * phase) - 0.025 * raised
    heading = curve(time, (0.5, WAY), (1.5, 0.50))
    place = BEGIN + walked(time) * way
    return Stance(place, heading, lift, (left, right), feet, tilt, -0.16 * swing - 0.06 * raised, 0.03, head)


def _foot(time: float, phase: float, side: float) -> Limb:
    """Return where a foot is: on the floor where the body is in the middle of the foot's stance, or on its way."""
    share = phase % 1.0
    middles = [time + (k + STANCE / 2 - share) * 2 * PACE for k in (-1, 0, 1)]
    before, here, there = (walked(middle) for middle in middles)
    came, goes = (here - before) / (2 * STEP), (there - here) / (2 * STEP)  # 1 at full speed
    moved = max(share - STANCE, 0.0) / (1 - STANCE)
    at = here + moved * moved * (3 - 2 * moved) * (there - here) - walked(time)
    heels = (-0.26 * came, 0.0, 0.0, 0.58 * goes, 0.35 * goes, -0.2 * goes, -0.26 * goes)
    pitch = float(np.interp(share, (0.0, 0.1, 0.38, STANCE, 0.76, 0.92, 1.0), heels))
    up = (0.165 if pitch > 0 else -0.06) * math.sin(pitch) + 0.035 * goes * math.sin(math.pi * moved)
    ahead = 0.165 * (1 - math.cos(max(pitch, 0.0))) + at
    ankle = np.array([(0.099 - 0.03 * goes) * side, 0.085 + up, -0.024 + ahead])
    return Limb(ankle, np.array([0.15 * side, 0.0, 1.0]), pitch, 0.12)


def _child(time: float) -> Stance:
    now, air = time % PERIOD - LEAP, 2 * math.sqrt(2 * HEIGHT / GRAVITY)  # s, since it leaps, and that it flies
    rise = max(HEIGHT - GRAVITY / 2 * (now - air / 2) ** 2, 0.0)
    lift = curve(now, (-0.42, -0.008), (-0.14, -0.11), (0.0, 0.0), (air, 0.0), (air + 0.13, -0.10), (air + 0.5, -0.008))
    swung = curve(now, (-0.42, 0.0), (-0.18, 0.2), (0.05, 0.0))
    raised = curve(now, (-0.20, 0.0), (0.22, 1.0), (air, 0.96), (air + 0.70, 0.0))
    tucked = curve(now, (0.0, 0.0), (air / 2, 1.0), (air, 0.0))
    wrist = _between(HANGING + [0.025, 0.0, -swung], np.array([0.62, 1.25, 0.22]), np.array([0.36, 1.76, 0.06]), raised)
    pole = (1 - raised) * BACK + raised * np.array([1.0, -0.6, -0.4])
    left_hand, right_hand = (Limb(side * wrist, side * pole, 0.30 - 0.24 * raised) for side in SIDES)
    ankle = np.array([0.105, 0.085 + 0.09 * tucked, -0.024 - 0.05 * tucked])
    left_foot, right_foot = (
        Limb(side * ankle, side * np.array([0.25, 0.0, 1.0]), 0.55 * tucked, 0.22) for side in SIDES
    )
    left = curve(now, (-0.62, -0.55), (-0.15, -0.50), (0.2, -0.05), (1.4, 0.0), (2.2, -0.55))
    down = curve(now, (-0.62, -0.22), (0.15, -0.22), (0.5, -0.05), (1.6, -0.06), (2.2, -0.22))
    sway = 0.02 * math.sin(math.pi * time)
    heading, lean = 0.35 + 0.05 * math.sin(2 * math.pi * time / PERIOD), max(-2.2 * lift - 0.022, 0.0)
    place = np.array([0.62, rise, 0.10])
    hands, feet = (left_hand, right_hand), (left_foot, right_foot)
    return Stance(place, heading, lift, hands, feet, sway, 0.0, lean, (left, down, sway))


def _between(first: Vector, middle: Vector, last: Vector, share: float) -> Vector:
    """Return a place on the curve from the first place towards the middle one to the last."""
    return (1 - share) ** 2 * first + 2 * share * (1 - share) * middle + share**2 * last
