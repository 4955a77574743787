"""What the people of the demo do: a woman walks in and waves, a child looks up at her and jumps for joy."""

from __future__ import annotations

import math

import numpy as np

from .sculpture import Vector
from .skeleton import Limb, Stance

STEP, PACE = 0.60, 0.52  # m and s, of a step of the woman (guess)
ARRIVAL = 1.35  # s, when she has stopped
SPEED = STEP / PACE  # m/s
JUMP, HEIGHT, GRAVITY = 3.0, 0.17, 9.81  # s between jumps of the child; m; m/s^2
READY = 0.62  # s, when the child leaves the floor


def curve(time: float, *points: tuple[float, float]) -> float:
    """Return a smooth curve through points (time, value), constant before and after; it does not overshoot."""
    times, values = zip(*points, strict=True)
    after = int(np.searchsorted(times, time))
    if after in (0, len(times)):
        return values[0 if after == 0 else -1]
    share = (time - times[after - 1]) / (times[after] - times[after - 1])
    return values[after - 1] + share * share * (3 - 2 * share) * (values[after] - values[after - 1])


def walked(time: float) -> float:
    """Return the way of the woman until a moment, m: steady, and slower and slower before she stops."""
    slowing = ARRIVAL - 0.9
    late = min(max(time - slowing, 0.0), 0.9)
    return SPEED * (min(time, slowing) + late - late * late / 1.8)


def woman(time: float) -> Stance:
    """Return the stance of the woman."""
    heading = curve(time, (0.5, 0.70), (1.5, 0.50))
    start, way = np.array([-0.98, 0.0, -0.42]), np.array([math.sin(0.70), 0.0, math.cos(0.70)])
    body = walked(time)
    feet, phase = [], time / (2 * PACE)
    pace = (walked(time + 0.1) - walked(time - 0.1)) / 0.2 / SPEED
    for side, offset in ((1.0, 0.15), (-1.0, 0.65)):
        feet.append(step(time, phase + offset, offset, side, body))
    swing = math.cos(2 * math.pi * (phase + 0.15 - 0.05)) * pace
    lift = curve(pace, (0.0, -0.006), (1.0, -0.028)) - 0.012 * pace * math.cos(4 * math.pi * (phase + 0.15))
    raised = curve(time, (0.55, 0.0), (1.1, 1.0), (3.2, 1.0), (3.9, 0.0))
    shake = math.sin(2 * math.pi * 1.9 * (time - 0.9)) * curve(time, (0.9, 0.0), (1.2, 1.0), (3.0, 1.0), (3.4, 0.0))
    hanging = (np.array([0.225, 0.892, 0.045 - 0.23 * swing]), np.array([-0.225, 0.892, 0.045 + 0.23 * swing]))
    up, out = np.array([-0.30 - 0.075 * shake, 1.60, 0.17]), np.array([-0.42, 1.15, 0.26])
    right = (1 - raised) ** 2 * hanging[1] + 2 * raised * (1 - raised) * out + raised**2 * up
    pole = (1 - raised) * np.array([-0.45, -0.2, -1.0]) + raised * np.array([-0.8, -1.0, -0.15])
    hands = (Limb(hanging[0], np.array([0.45, -0.2, -1.0]), 0.28), Limb(right, pole, 0.28 - 0.24 * raised, 0.25 * shake))
    look = (curve(time, (0.0, -0.12), (1.2, 0.06)), curve(time, (0.0, -0.05), (1.0, -0.12)), 0.05 * shake + 0.08 * raised)
    tilt = 0.045 * pace * math.sin(2 * math.pi * (phase + 0.15)) - 0.025 * raised
    return Stance(start + body * way, heading, lift, hands, (feet[0], feet[1]), tilt, -0.16 * swing - 0.06 * raised, 0.03, look)


def step(time: float, phase: float, offset: float, side: float, body: float) -> Limb:
    """Return where a foot is: it stands where the body is in the middle of its stance."""
    number = math.floor(phase)
    share = phase - number
    plants = [walked((k + 0.3 - offset) * 2 * PACE) for k in (number, number + 1)]
    size = (plants[1] - plants[0]) / (2 * STEP)
    moved = max(share - 0.6, 0.0) / 0.4
    place = plants[0] + moved * moved * (3 - 2 * moved) * (plants[1] - plants[0]) - body
    came = (plants[0] - walked((number - 0.7 - offset) * 2 * PACE)) / (2 * STEP)
    tips = (-0.26 * came, 0.0, 0.0, 0.58 * size, 0.35 * size, -0.2 * size, -0.26 * size)
    pitch = float(np.interp(share, (0.0, 0.1, 0.38, 0.6, 0.76, 0.92, 1.0), tips))
    up = 0.125 * math.sin(max(pitch, 0.0)) + 0.06 * math.sin(max(-pitch, 0.0)) + 0.035 * size * math.sin(math.pi * moved)
    ahead = 0.125 * (1 - math.cos(max(pitch, 0.0)))
    ankle = np.array([(0.099 - 0.03 * size) * side, 0.085 + up, -0.024 + place + ahead])
    return Limb(ankle, np.array([0.15 * side, 0.0, 1.0]), pitch, 0.12)


def child(time: float) -> Stance:
    """Return the stance of the child."""
    now = time % JUMP - READY
    air = 2 * math.sqrt(2 * HEIGHT / GRAVITY)
    rise = HEIGHT - GRAVITY / 2 * (now - air / 2) ** 2 if 0 < now < air else 0.0
    crouch = curve(now, (-0.42, -0.008), (-0.14, -0.11), (0.0, 0.0), (air, 0.0), (air + 0.13, -0.10), (air + 0.5, -0.008))
    joy = curve(now, (-0.42, 0.0), (-0.14, -0.25), (0.10, 1.0), (air, 0.9), (air + 0.55, 0.0))
    tucked = curve(now, (0.0, 0.0), (air / 2, 1.0), (air, 0.0))
    hands = []
    for side in (1.0, -1.0):
        low, high = np.array([0.25, 0.885, 0.05]), np.array([0.36, 1.76, 0.06])
        mid = np.array([0.62, 1.25, 0.22])
        s = max(joy, 0.0)
        place = (1 - s) ** 2 * low + 2 * s * (1 - s) * mid + s * s * high + min(joy, 0.0) * np.array([0.0, 0.0, 0.8])
        pole = (1 - s) * np.array([0.45, -0.2, -1.0]) + s * np.array([1.0, -0.6, -0.4])
        flip = np.array([side, 1.0, 1.0])
        hands.append(Limb(flip * place, flip * pole, 0.30 - 0.24 * s))
    feet = []
    for side in (1.0, -1.0):
        ankle = np.array([0.105 * side, 0.085 + 0.09 * tucked, -0.024 - 0.05 * tucked])
        feet.append(Limb(ankle, np.array([0.25 * side, 0.0, 1.0]), 0.55 * tucked, 0.22))
    lean = -2.2 * min(crouch + 0.01, 0.0)
    sway = 0.02 * math.sin(2 * math.pi * 0.5 * time)
    look = (curve(now, (-0.62, -0.55), (-0.15, -0.50), (0.2, -0.05), (1.4, 0.0), (2.2, -0.55)), curve(now, (-0.62, -0.22), (0.15, -0.22), (0.5, -0.05), (1.6, -0.06), (2.2, -0.22)), sway)
    heading = 0.35 + 0.05 * math.sin(2 * math.pi * time / JUMP)
    place = np.array([0.62, rise, 0.10])
    return Stance(place, heading, crouch, (hands[0], hands[1]), (feet[0], feet[1]), sway, 0.0, lean, look)


def at(time: float) -> tuple[Stance, Stance]:
    return woman(time), child(time)


__all__ = ["Vector", "at"]
