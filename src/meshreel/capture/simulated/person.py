"""A dressed person in a still pose, arms away from the body, as parts of a solid; +z is ahead, y up, x to the left, m.

An adult of 1.74 m with shoes, 7.6 heads high; a child is smaller, 6 heads high, and has a rounder face. All sizes are
guesses by eye, after the usual proportions of figure drawing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from .sculpture import Depths, Part, Places, Tube, Vector, ball, rod

Rows = list[tuple[float, float, float, float]]  # m along a tube; radii to the side and ahead; shift ahead

AHEAD, UP = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
HEAD = np.array([0.0, 1.607, 0.004])  # m, at the height of the eyes
SHOULDER, HIP = np.array([0.150, 1.398, -0.014]), np.array([0.088, 0.930, -0.005])
ARM = np.array([0.6428, -0.7660, 0.0])  # way from the left shoulder down the arm
PALM = np.cross(ARM, AHEAD)  # way out of the back of the left hand
UPPER_ARM, FOREARM = 0.28, 0.25  # m
ELBOW, WRIST = SHOULDER + UPPER_ARM * ARM, SHOULDER + (UPPER_ARM + FOREARM) * ARM
KNEE, ANKLE = np.array([0.093, 0.500, 0.002]), np.array([0.099, 0.085, -0.024])
COLLAR = 1.483  # m, where the shirt ends
EYE, LID = (0.0315, -0.001), (0.0165, 0.0068)  # m from `HEAD`: middle of an eye; half the width and height of its lids
# Place along the arm and ahead of the knuckles, length of the fingers, m, and their angle towards the thumb, rad.
FINGERS = (
    (0.090, 0.031, 0.072, 0.16),
    (0.094, 0.0105, 0.080, 0.04),
    (0.090, -0.0105, 0.074, -0.08),
    (0.080, -0.031, 0.058, -0.20),
)
THUMB = ((0.018, 0.020), (0.050, 0.048), (0.082, 0.062))  # m, joints and tip: along the arm and ahead
REST = (0.25, 0.25, 0.25, 0.25, 0.1)  # bends that the folds of the still pose are of, see `folds`
DEEP = 0.015  # m from the surface within which folds are computed (guess)

# fmt: off
WOMANS_SHIRT: Rows = [
    (0.995, 0.139, 0.104, -0.008), (1.03, 0.139, 0.106, -0.004), (1.10, 0.125, 0.096, 0.0), (1.19, 0.132, 0.100, 0.003),
    (1.285, 0.146, 0.104, 0.004), (1.34, 0.150, 0.102, 0.0), (1.395, 0.143, 0.088, -0.012),
    (1.435, 0.100, 0.067, -0.020), (1.462, 0.068, 0.060, -0.020), (1.472, 0.065, 0.058, -0.019),
]
CHILDS_SHIRT: Rows = [
    (0.885, 0.170, 0.128, -0.008), (0.93, 0.166, 0.127, -0.006), (1.03, 0.157, 0.126, -0.002),
    (1.11, 0.151, 0.122, 0.002),
    (1.20, 0.148, 0.113, 0.004), (1.285, 0.150, 0.106, 0.002), (1.34, 0.150, 0.101, 0.0), (1.395, 0.140, 0.088, -0.012),
    (1.435, 0.098, 0.067, -0.020), (1.462, 0.070, 0.062, -0.020), (1.472, 0.066, 0.059, -0.019),
]
NECKBAND: Rows = [(1.44, 0.060, 0.056, -0.020), (1.478, 0.0615, 0.0575, -0.017), (COLLAR, 0.060, 0.056, -0.0165)]
HIPS: Rows = [
    (0.80, 0.148, 0.092, -0.012), (0.87, 0.163, 0.108, -0.016), (0.95, 0.154, 0.106, -0.014),
    (1.0, 0.137, 0.099, -0.009), (1.012, 0.135, 0.098, -0.009),
]
BELT: Rows = [(0.972, 0.145, 0.107, -0.011), (1.003, 0.141, 0.105, -0.009)]
LEG_TOP = 0.95  # m, height at which the rows of legs begin
LEG: Rows = [
    (-0.035, 0.030, 0.050, -0.006), (0.0, 0.068, 0.088, -0.005), (0.05, 0.084, 0.101, -0.003),
    (0.13, 0.086, 0.098, 0.0), (0.25, 0.077, 0.086, 0.004), (0.39, 0.063, 0.069, 0.006), (0.46, 0.058, 0.063, 0.008),
    (0.55, 0.0575, 0.064, -0.004), (0.62, 0.0565, 0.0635, -0.010), (0.73, 0.050, 0.056, -0.006),
    (0.83, 0.047, 0.052, 0.0), (0.88, 0.047, 0.053, 0.0),
]
CUFF: Rows = [(0.822, 0.0515, 0.0565, 0.0), (0.872, 0.052, 0.058, 0.0)]
BARE_LEG: Rows = [
    (0.25, 0.060, 0.068, 0.004), (0.36, 0.054, 0.058, 0.007), (0.45, 0.047, 0.051, 0.010), (0.51, 0.043, 0.047, 0.002),
    (0.62, 0.045, 0.051, -0.010), (0.73, 0.040, 0.045, -0.006), (0.83, 0.038, 0.042, 0.0), (0.88, 0.038, 0.042, 0.0),
]
SOCK: Rows = [(0.78, 0.042, 0.047, -0.002), (0.785, 0.044, 0.049, -0.002), (0.88, 0.041, 0.047, 0.0)]
BARE_ARM: Rows = [
    (0.10, 0.036, 0.038, 0.0), (0.22, 0.034, 0.036, 0.0), (0.28, 0.034, 0.035, 0.0), (0.33, 0.0345, 0.0375, 0.002),
    (0.42, 0.028, 0.032, 0.002), (0.51, 0.020, 0.0265, 0.0), (0.55, 0.0185, 0.027, 0.0),
]
SLEEVE: Rows = [
    (-0.045, 0.024, 0.030, 0.0), (-0.015, 0.039, 0.046, 0.0), (0.03, 0.0445, 0.051, 0.0), (0.08, 0.0455, 0.050, 0.0),
    (0.14, 0.0445, 0.047, 0.0), (0.24, 0.0425, 0.0445, 0.0), (0.30, 0.041, 0.043, 0.0), (0.36, 0.0405, 0.0425, 0.002),
    (0.46, 0.0345, 0.0365, 0.002), (0.515, 0.0305, 0.0325, 0.0), (0.52, 0.033, 0.035, 0.0),
]
NECK: Rows = [(0.0, 0.062, 0.060, 0.0), (0.06, 0.049, 0.052, 0.0), (0.11, 0.046, 0.050, 0.0), (0.17, 0.047, 0.05, 0.0)]
BOB: Rows = [
    (0.0, 0.080, 0.086, -0.004), (0.02, 0.091, 0.098, -0.003), (0.05, 0.094, 0.104, 0.0), (0.11, 0.089, 0.106, 0.0),
    (0.158, 0.0845, 0.1055, 0.0),
]
# fmt: on


@dataclass(frozen=True, slots=True)
class Build:
    """Shape of a person and of the clothes."""

    size: float = 1.0  # of an adult
    head: float = 1.0  # of an adult's head, beyond `size`
    is_child: bool = False  # with a child's face and short hair, a T-shirt and shorts
    sleeve: float = 0.525  # m along the arm, where sleeves end
    trouser: float = 0.085  # m above the floor, where trousers end


def person(build: Build) -> list[Part]:
    """Return all parts of an adult's size, those that are cut out after those that they are cut from."""
    return [*_torso(build), *_legs(build), *_arms(build), *_head(build)]


def folds(points: Places, bends: tuple[float, ...], low: float) -> Depths:
    """Return by how much cloth stands out, m, for bends of elbows and knees (left, right) and waist, 0 to 1.

    Trousers end at a height `low`.
    """
    x, y, z = np.abs(points[..., 0]), points[..., 1], points[..., 2]
    is_left = points[..., 0] > 0
    elbow, knee = np.where(is_left, bends[0], bends[1]), np.where(is_left, bends[2], bends[3])
    along = (x - SHOULDER[0]) * ARM[0] + (y - SHOULDER[1]) * ARM[1]
    aside = (x - SHOULDER[0]) * ARM[1] - (y - SHOULDER[1]) * ARM[0]
    sleeve = (np.abs(aside) < 0.075) & (along > 0.03) & (x > 0.17)
    around = np.arctan2(aside, z)
    inside = elbow * np.exp(-(((along - 0.275) / 0.055) ** 2)) * (0.75 + 0.5 * np.cos(around))
    on_arm = 0.0065 * inside * _waves(along - 0.01 * np.sin(2 * around), 0.036, 0.0)
    on_arm += 0.0012 * _waves(along, 0.052, 1.7 * np.sin(around)) * np.clip(5 - 10 * along, 0, 1)
    leg = (y < 0.90) & (y > low) & (x < 0.2) & ~sleeve
    turn = np.arctan2(x - 0.09, z)
    behind = knee * np.exp(-(((y - 0.49) / 0.06) ** 2)) * (0.7 - 0.5 * np.cos(turn))
    on_leg = 0.0075 * behind * _waves(y + 0.012 * np.sin(turn), 0.042, 0.0)
    on_leg += 0.0040 * np.exp(-(((y - 0.185) / 0.045) ** 2)) * _waves(y, 0.036, 1.8 * np.cos(turn + 0.6))
    on_leg += 0.0022 * np.exp(-(((y - 0.70) / 0.10) ** 2)) * _waves(y + 0.9 * (x - 0.09), 0.075, 1.2 * turn)
    groin = np.exp(-(x * x + (y - 0.815) ** 2) / 0.075**2) * (0.4 + knee)
    on_leg += 0.0030 * groin * np.sin(9 * np.arctan2(y - 0.815, x + 1e-6))
    shirt = (y > 0.88) & (y < 1.40) & (x < 0.2) & ~sleeve
    face = np.arctan2(points[..., 0], z)
    slack = np.exp(-(((y - 1.075) / 0.05) ** 2)) * (0.0034 + 0.006 * bends[4])
    on_shirt = slack * _waves(y, 0.055, 2.4 * np.sin(face + 0.5) + 1.1 * np.sin(3 * face))
    drape = 0.0020 * np.exp(-(((y - 1.20) / 0.07) ** 2))
    on_shirt += drape * _waves(y + 1.3 * x, 0.07, 1.4 * np.sin(2 * face + 1))
    return sleeve * on_arm + leg * on_leg + shirt * on_shirt


def finger_joints() -> list[np.ndarray]:
    """Return root, knuckle, joint and tip of the fingers of the left hand, index first, then of the thumb; m."""
    found = []
    for along, ahead, length, spread in FINGERS:
        joints = [WRIST + (along - 0.03) * ARM + ahead * AHEAD, WRIST + along * ARM + ahead * AHEAD]
        for share, bend in ((0.46, 0.10), (0.54, 0.30)):
            way = np.cos(bend) * (np.cos(spread) * ARM + np.sin(spread) * AHEAD) - np.sin(bend) * PALM
            joints.append(joints[-1] + share * length * way)
        found.append(np.array(joints))
    return [*found, np.array([WRIST + along * ARM + ahead * AHEAD - 0.008 * PALM for along, ahead in THUMB])]


def in_head(build: Build, points: Places) -> Places:
    """Return places from the middle of the head at the height of the eyes, in the size of an adult's head."""
    return ((points - head_place(build)) / build.head).astype(np.float32)


def head_place(build: Build) -> Vector:
    """Return the middle of the head at the height of the eyes: chins of all sizes are at one height."""
    return HEAD + 0.107 * (build.head - 1) * UP


def hair(build: Build) -> Part:
    """Return the hair as a solid in the frame of `in_head`: an adult's bob with a parting, a child's short hair."""
    low, high = np.array([-0.11, -0.125, -0.14]), np.array([0.11, 0.145, 0.10])
    if build.is_child:
        solids, depth = [ball((0.0, 0.034, -0.022), (0.0865, 0.0935, 0.1055), 0.0)], 0.0035
        holes = [ball((0.006, -0.040, 0.088), (0.071, 0.102, 0.073), 0.0)]  # for the face and for ears
        holes += _both([ball((0.088, -0.034, 0.004), (0.035, 0.046, 0.036), 0.0)])
    else:
        solids, depth = [ball((0.0, 0.034, -0.022), (0.0845, 0.0935, 0.1055), 0.0)], 0.0016
        solids.append(_tube((0.0, -0.118, -0.022), (0.0, 0.04, -0.022), BOB).part(0.0))
        c, s = np.cos(0.2), np.sin(0.2)
        aslant = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        holes = [ball((-0.006, -0.030, 0.094), (0.0635, 0.101, 0.070), 0.0, aslant)]
        holes.append(ball((0.0, -0.118, 0.05), (0.066, 0.08, 0.10), 0.0))  # for the face, and under the chin

    def distance(points: Places) -> Depths:
        solid = np.min([part.distance(points) for part in solids], axis=0) - depth * strands(build, points)
        return np.maximum(solid, -np.min([part.distance(points) for part in holes], axis=0)).astype(np.float32)

    return Part(distance, low, high, 0.003)


def strands(build: Build, points: Places) -> Depths:
    """Return ridges along the hair, -1 to 1, for places in the frame of `in_head`."""
    x, y, z = (points[..., k] for k in range(3))
    if build.is_child:
        around = np.arctan2(x - 0.012, z + 0.055) + 9 * np.hypot(x - 0.012, z + 0.055)
        lumps = np.sin(11 * around + 30 * y) * np.cos(60 * y + 3 * around)
        return 0.6 * lumps + 0.4 * np.sin(37 * around + 80 * y)
    around = np.arctan2(x + 0.02, z + 0.03)
    wave = around + 0.16 * np.sin(24 * y + 2 * around + 1.0)
    return 0.6 * np.sin(31 * wave) + 0.4 * np.sin(73 * wave + 40 * y)


def _waves(place: Depths, length: float, phase: Depths | float) -> Depths:
    return np.sin(2 * np.pi * place / length + phase)


def _both(parts: Iterable[Part]) -> list[Part]:
    """Return parts of the left side and those of the right."""
    found = []
    for part in parts:
        low, high = part.low * (-1, 1, 1), part.high * (-1, 1, 1)
        corners = np.minimum(low, high), np.maximum(low, high)
        found += [part, Part(_mirrored(part), *corners, part.blend, part.is_cut)]
    return found


def _mirrored(part: Part) -> Callable[[Places], Depths]:
    flip = np.array([-1, 1, 1], np.float32)
    return lambda points: part.distance(points * flip)


def _tube(start: Iterable[float], end: Iterable[float], rows: Rows) -> Tube:
    """Return a tube along the line from start to end."""
    first, last = np.array(tuple(start)), np.array(tuple(end))
    way = (last - first) / np.sqrt(((last - first) ** 2).sum())
    front = AHEAD - way[2] * way
    return Tube(first, way, front / np.sqrt((front * front).sum()), np.array(rows))


def _upright(rows: Rows) -> Tube:
    return _tube((0.0, 0.0, 0.0), UP, rows)


def _creased(build: Build, part: Part) -> Part:
    """Return a part of cloth with folds."""

    def distance(points: Places) -> Depths:
        found = part.distance(points)
        near = np.abs(found) < DEEP
        found[near] -= folds(points[near], REST, build.trouser).astype(np.float32)
        return found

    return Part(distance, part.low - DEEP, part.high + DEEP, part.blend)


def _torso(build: Build) -> list[Part]:
    """Return the shirt, and the trousers as far as the hips."""
    c = build.is_child
    thin = 0.94 if c else 1.0
    found = [_creased(build, _upright(CHILDS_SHIRT if c else WOMANS_SHIRT).part(0.02))]
    found += _both([rod((0.045, 1.440, -0.026), (0.122, 1.408, -0.018), (0.030, 0.036), 0.05)])
    found += [] if c else _both([ball((0.058, 1.268, 0.068), (0.060, 0.058, 0.050), 0.05)])
    found.append(_upright([(y, thin * side, thin * ahead, shift) for y, side, ahead, shift in HIPS]).part(0.004))
    found += _both([ball((0.066, 0.890, -0.056), (0.076, 0.085, 0.072), 0.05)])
    if not c:
        found += [_upright(BELT).part(0.002), ball((0.0, 0.988, 0.0985), (0.022, 0.015, 0.006), 0.001)]
    return [*found, _upright(NECKBAND).part(0.003)]


def _legs(build: Build) -> list[Part]:
    """Return trousers, or shorts, legs and socks, and shoes."""
    top, end = np.array([0.086, LEG_TOP, -0.006]), np.array([0.099, 0.0, -0.026])
    tubes = [(LEG, 0.02), (CUFF, 0.002)]
    if build.is_child:
        hem = LEG_TOP - build.trouser
        shorts = [(t, min(a + 0.004, 0.084), b + 0.004 + 0.012 * t, s) for t, a, b, s in LEG if t < 0.3]
        shorts += [(hem - 0.02, 0.0765, 0.088, 0.006), (hem, 0.0765, 0.090, 0.006)]
        tubes = [(shorts, 0.02), (BARE_LEG, 0.004), (SOCK, 0.002)]
    found = [_creased(build, _tube(top, end, rows).part(blend)) for rows, blend in tubes]
    x, _, z = ANKLE
    found.append(rod((x, 0.10, z), (x, 0.05, z + 0.005), (0.036, 0.038), 0.006))
    found.append(ball((x + 0.004, 0.044, z + 0.070), (0.040, 0.041, 0.112), 0.02))
    found.append(ball((x, 0.048, z - 0.012), (0.037, 0.043, 0.048), 0.03))
    sole = np.array([(0.0, 0.045, 0.127, 0.0), (0.026, 0.0465, 0.129, 0.0)])
    return _both([*found, Tube(np.array([x + 0.003, 0.0, z + 0.058]), UP, AHEAD, sole).part(0.003)])


def _arms(build: Build) -> list[Part]:
    """Return arms, sleeves and hands."""
    wide = 0.006 if build.is_child else 0.0
    cloth = [(t, a + wide * (t > 0), b + wide * (t > 0), s) for t, a, b, s in SLEEVE if t < build.sleeve - 0.01]
    _, side, ahead, _ = cloth[-1]
    cloth.append((build.sleeve, side + 1.3 * wide + 0.001, ahead + 1.3 * wide + 0.001, 0.0))
    sleeve = _creased(build, _tube(SHOULDER, WRIST, cloth).part(0.05))
    return _both([_tube(SHOULDER, WRIST, BARE_ARM).part(0.01), sleeve, *_hand()])


def _hand() -> list[Part]:
    """Return palm, fingers and thumb of the left hand, which is open."""
    axes = np.stack([ARM, PALM, AHEAD], axis=1)
    root, end = (axes @ place + WRIST for place in ((0.020, -0.004, 0.016), (0.050, -0.008, 0.036)))
    found = [ball(WRIST + 0.052 * ARM, (0.052, 0.0155, 0.043), 0.012, axes), rod(root, end, (0.016, 0.013), 0.014)]
    for joints in finger_joints():
        radii = ((0.0098, 0.0088), (0.0088, 0.0080), (0.0080, 0.0066))
        found += [rod(a, b, thick, 0.004) for a, b, thick in zip(joints[:-1], joints[1:], radii, strict=False)]
    return found


def _head(build: Build) -> list[Part]:
    """Return neck, face, ears and hair."""
    scale, origin = build.head, head_place(build)

    def moved(part: Part) -> Part:
        def distance(points: Places) -> Depths:
            return np.float32(scale) * part.distance(in_head(build, points))

        corners = part.low * scale + origin, part.high * scale + origin
        return Part(distance, *corners, part.blend * scale, part.is_cut)

    neck = _tube((0.0, 1.40, -0.030), (0.0, 1.56, -0.016), NECK).part(0.006)
    return [neck, *map(moved, (*_skull(build), *_features(build), hair(build)))]


def _skull(build: Build) -> list[Part]:
    c = float(build.is_child)
    return [
        ball((0.0, 0.032, -0.018), (0.0755, 0.083, 0.095), 0.02),
        ball((0.0, -0.012, 0.020), (0.0635 + 0.0015 * c, 0.086 - 0.006 * c, 0.0655), 0.02),  # face
        ball((0.0, -0.058, 0.030), (0.0475 + 0.0025 * c, 0.048 - 0.004 * c, 0.047), 0.03),  # jaw
        ball((0.0, -0.094 + 0.008 * c, 0.058 - 0.003 * c), (0.0215, 0.0165, 0.0195), 0.035),  # chin
        *_both(
            [
                ball((0.037, -0.034 - 0.005 * c, 0.051), (0.021, 0.020 + 0.002 * c, 0.023), 0.025),  # cheeks
                rod((0.010, 0.0175, 0.0755), (0.044, 0.0150, 0.059), (0.0095, 0.0085), 0.014),  # brows
            ]
        ),
    ]


def eyelids(build: Build) -> tuple[float, float]:
    """Return half the width and height of the opening of an eye, m, of an adult's head."""
    return (1.12 * LID[0], 1.22 * LID[1]) if build.is_child else LID


def _features(build: Build) -> list[Part]:
    """Return eyes, nose, lips and ears."""
    c, (wide, high) = float(build.is_child), eyelids(build)
    a, b = np.cos((0.25, -0.2)), np.sin((0.25, -0.2))
    turn = np.array([[a[0], 0, b[0]], [0, 1, 0], [-b[0], 0, a[0]]]) @ np.array(
        [[1, 0, 0], [0, a[1], -b[1]], [0, b[1], a[1]]]
    )
    sides = [
        ball((0.032, -0.0015, 0.090), (0.0205, 0.0145, 0.0150), 0.014, is_cut=True),  # socket,
        ball((*EYE, 0.0640), (0.0158, 0.0150, 0.0150), 0.003),  # lids, their opening, and eye
        ball((*EYE, 0.0815), (wide - 0.001, high, 0.0085), 0.001, is_cut=True),
        ball((*EYE, 0.0640), (0.0132, 0.0132, 0.0136), 0.0005),
        ball((0.0112, -0.0405 + 0.004 * c, 0.0865 - 0.004 * c), (0.0068, 0.0066, 0.0090), 0.006),  # nostrils
        rod((0.003, -0.0620, 0.0850), (0.0215, -0.0655, 0.0725), (0.0048, 0.0026), 0.005),  # lips
        rod((0.009, -0.0722, 0.0815), (0.0205, -0.0670, 0.0725), (0.0052, 0.0022), 0.005),
        ball((0.0770, -0.012, -0.012), (0.0075, 0.0300, 0.0180), 0.006, turn),  # ear
        ball((0.0840, -0.008, -0.008), (0.0060, 0.0170, 0.0090), 0.004, turn, is_cut=True),
    ]
    return [
        *_both(sides),
        rod((0.0, 0.010, 0.0785), (0.0, -0.033 + 0.004 * c, 0.0955 - 0.006 * c), (0.0068, 0.0080), 0.012),  # nose
        ball((0.0, -0.0375 + 0.004 * c, 0.0960 - 0.006 * c), (0.0098, 0.0088, 0.0098), 0.007),
        ball((0.0, -0.0535, 0.0790 - 0.002 * c), (0.016, 0.014, 0.0085), 0.016),  # over the mouth
        rod((-0.010, -0.0725, 0.0815), (0.010, -0.0725, 0.0815), (0.0058, 0.0058), 0.006),
    ]
