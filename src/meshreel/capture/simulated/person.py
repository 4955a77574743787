"""A dressed person in a still pose, arms at 40 degrees from the body, as parts of a sculpture; y up, +z ahead, m.

An adult of 1.74 m with shoes, 7.6 heads high; a child is smaller, of 6 heads, with a rounder face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64

from .sculpture import Depths, Part, Places, Tube, Vector, ball, rod

Rows = list[tuple[float, float, float, float]]  # m along a tube; radii to the side and to the front; shift to the front

HEAD = np.array([0.0, 1.607, 0.0])  # m, between the eyes' height and the ears
SHOULDER, HIP = np.array([0.150, 1.398, -0.014]), np.array([0.088, 0.930, -0.005])
ARM = np.array([0.6428, -0.7660, 0.0])  # way from the shoulder down the arm
UPPER_ARM, FOREARM = 0.28, 0.25  # m
ELBOW, WRIST = SHOULDER + UPPER_ARM * ARM, SHOULDER + (UPPER_ARM + FOREARM) * ARM
KNEE, ANKLE = np.array([0.093, 0.500, 0.002]), np.array([0.099, 0.085, -0.024])
PALM = np.cross(ARM, [0.0, 0.0, 1.0])  # way out of the back of the left hand
# Place along the arm and to the thumb of the knuckles, the length of the fingers, and by how much they spread.
FINGERS = ((0.090, 0.031, 0.072, 0.16), (0.094, 0.0105, 0.080, 0.04), (0.090, -0.0105, 0.074, -0.08), (0.080, -0.031, 0.058, -0.2))
THUMB = ((0.018, 0.020), (0.050, 0.048), (0.082, 0.062))  # its joints and its tip, along the arm and to the front


@dataclass(frozen=True, slots=True)
class Build:
    """Shape of a person and of the clothes."""

    size: float = 1.0  # of an adult
    head: float = 1.0  # of an adult's head, beyond `size`
    is_child: bool = False
    has_long_hair: bool = True
    sleeve: float = 0.525  # m along the arm, where sleeves end
    trouser: float = 0.085  # m above the floor, where trousers end


def parts(build: Build) -> list[Part]:
    """Return all parts, those that are cut out after those that they are cut from."""
    return [*torso(build), *legs(build), *arms(build), *head(build)]


def mirrored(part: Part) -> Part:
    """Return the part of the other side."""
    flip = np.array([-1, 1, 1], np.float32)
    low, high = part.low * flip, part.high * flip
    return Part(lambda points: part.distance(points * flip), np.minimum(low, high), np.maximum(low, high), part.blend, part.is_cut)


def both(part: Part) -> tuple[Part, Part]:
    return part, mirrored(part)


def tube(start: Vector, end: Vector, rows: Rows) -> Tube:
    """Return a tube along the line from start to end; its front is ahead."""
    way = (end - start) / np.linalg.norm(end - start)
    front = np.array([0.0, 0.0, 1.0]) - way[2] * way
    return Tube(start, way, front / np.linalg.norm(front), np.array(rows))


UP = (np.zeros(3), np.array([0.0, 1.0, 0.0]))


def torso(build: Build) -> list[Part]:
    """Return the shirt, and the trousers, or shorts, as far as the hips."""
    c = build.is_child
    shirt: Rows = CHILDS_SHIRT if c else WOMANS_SHIRT
    found = [creased(build, tube(*UP, shirt).part(0.02))]
    found += both(rod((0.045, 1.440, -0.026), (0.122, 1.408, -0.018), (0.030, 0.036), 0.05))  # shoulders
    if not c:
        found += both(ball((0.058, 1.268, 0.068), (0.060, 0.058, 0.050), 0.05))
    thin = 0.94 if c else 1.0
    hips = [(y, thin * a, thin * b, s) for y, a, b, s in HIPS]
    found += [tube(*UP, hips).part(0.004), *both(ball((0.066, 0.890, -0.056), (0.076, 0.085, 0.072), 0.05))]
    if not c:
        found.append(tube(*UP, [(0.972, 0.145, 0.107, -0.011), (1.003, 0.141, 0.105, -0.009)]).part(0.002))  # belt
        found.append(ball((0.0, 0.988, 0.0985), (0.022, 0.015, 0.006), 0.001))  # and buckle
    collar: Rows = [(1.44, 0.060, 0.056, -0.020), (1.478, 0.0615, 0.0575, -0.017), (1.483, 0.060, 0.056, -0.0165)]
    return [*found, tube(*UP, collar).part(0.003)]


WOMANS_SHIRT: Rows = [
    (0.995, 0.139, 0.104, -0.008), (1.03, 0.139, 0.106, -0.004), (1.10, 0.125, 0.096, 0.0), (1.19, 0.132, 0.100, 0.003),
    (1.285, 0.146, 0.104, 0.004), (1.34, 0.150, 0.102, 0.0), (1.395, 0.143, 0.088, -0.012), (1.435, 0.100, 0.067, -0.020),
    (1.462, 0.068, 0.060, -0.020), (1.472, 0.065, 0.058, -0.019),
]
CHILDS_SHIRT: Rows = [
    (0.885, 0.170, 0.128, -0.008), (0.93, 0.166, 0.127, -0.006), (1.03, 0.157, 0.126, -0.002), (1.11, 0.151, 0.122, 0.002),
    (1.20, 0.148, 0.113, 0.004), (1.285, 0.150, 0.106, 0.002), (1.34, 0.150, 0.101, 0.0), (1.395, 0.140, 0.088, -0.012),
    (1.435, 0.098, 0.067, -0.020), (1.462, 0.070, 0.062, -0.020), (1.472, 0.066, 0.059, -0.019),
]
HIPS: Rows = [(0.80, 0.148, 0.092, -0.012), (0.87, 0.163, 0.108, -0.016), (0.95, 0.154, 0.106, -0.014), (1.0, 0.137, 0.099, -0.009), (1.012, 0.135, 0.098, -0.009)]
LEG: Rows = [  # from above the hips down
    (-0.035, 0.030, 0.050, -0.006), (0.0, 0.068, 0.088, -0.005), (0.05, 0.084, 0.101, -0.003), (0.13, 0.086, 0.098, 0.0), (0.25, 0.077, 0.086, 0.004),
    (0.39, 0.063, 0.069, 0.006), (0.46, 0.058, 0.063, 0.008), (0.55, 0.0575, 0.064, -0.004), (0.62, 0.0565, 0.0635, -0.010),
    (0.73, 0.050, 0.056, -0.006), (0.83, 0.047, 0.052, 0.0), (0.88, 0.047, 0.053, 0.0),
]
LEG_TOP = 0.95  # m, where `LEG` begins


def legs(build: Build) -> list[Part]:
    """Return trousers, or shorts, legs and socks, and shoes."""
    top, end = np.array([0.086, LEG_TOP, -0.006]), np.array([0.099, 0.0, -0.026])
    if build.is_child:
        hem = LEG_TOP - build.trouser
        cloth: Rows = [(t, min(a + 0.004, 0.084), b + 0.004 + 0.012 * t, s) for t, a, b, s in LEG if t < 0.3]
        cloth += [(hem - 0.02, 0.0765, 0.088, 0.006), (hem, 0.0765, 0.090, 0.006)]
        bare: Rows = [(0.25, 0.060, 0.068, 0.004), (0.36, 0.054, 0.058, 0.007), (0.45, 0.047, 0.051, 0.010), (0.51, 0.043, 0.047, 0.002)]
        bare += [(t, 0.80 * a, 0.80 * b, s) for t, a, b, s in LEG if t > 0.6]
        sock: Rows = [(0.78, 0.042, 0.047, -0.002), (0.785, 0.044, 0.049, -0.002), (0.88, 0.041, 0.047, 0.0)]
        tubes = [(cloth, 0.02), (bare, 0.004), (sock, 0.002)]
    else:
        cuff: Rows = [(0.822, 0.0515, 0.0565, 0.0), (0.872, 0.052, 0.058, 0.0)]
        tubes = [(LEG, 0.02), (cuff, 0.002)]
    found = [side for rows, blend in tubes for side in both(creased(build, tube(top, end, rows).part(blend)))]
    x, z = ANKLE[0], ANKLE[2]
    found += both(rod((x, 0.10, z), (x, 0.05, z + 0.005), (0.036, 0.038), 0.006))
    found += both(ball((x + 0.004, 0.040, z + 0.070), (0.040, 0.044, 0.112), 0.02))
    found += both(ball((x, 0.045, z - 0.012), (0.037, 0.046, 0.048), 0.03))
    ahead, rows = np.array([0.0, 0.0, 1.0]), [(0.0, 0.045, 0.127, 0.0), (0.026, 0.0465, 0.129, 0.0)]
    return [*found, *both(Tube(np.array([x + 0.003, 0.0, z + 0.058]), UP[1], ahead, np.array(rows)).part(0.003))]


BARE_ARM: Rows = [(0.10, 0.036, 0.038, 0.0), (0.22, 0.034, 0.036, 0.0), (0.28, 0.034, 0.035, 0.0), (0.33, 0.0345, 0.0375, 0.002), (0.42, 0.028, 0.032, 0.002), (0.51, 0.020, 0.0265, 0.0), (0.55, 0.0185, 0.027, 0.0)]
SLEEVE: Rows = [(-0.045, 0.024, 0.030, 0.0), (-0.015, 0.039, 0.046, 0.0), (0.03, 0.0445, 0.051, 0.0), (0.08, 0.0455, 0.050, 0.0), (0.14, 0.0445, 0.047, 0.0), (0.24, 0.0425, 0.0445, 0.0), (0.30, 0.041, 0.043, 0.0), (0.36, 0.0405, 0.0425, 0.002), (0.46, 0.0345, 0.0365, 0.002), (0.515, 0.0305, 0.0325, 0.0), (0.52, 0.033, 0.035, 0.0)]


def arms(build: Build) -> list[Part]:
    """Return arms, sleeves and hands."""
    wide = 0.006 if build.is_child else 0.0
    cloth = [(t, a + wide * (t > 0), b + wide * (t > 0), s) for t, a, b, s in SLEEVE if t < build.sleeve - 0.01]
    cloth.append((build.sleeve, cloth[-1][1] + 1.3 * wide + 0.001, cloth[-1][2] + 1.3 * wide + 0.001, 0.0))
    found = [*both(tube(SHOULDER, WRIST, BARE_ARM).part(0.01)), *both(creased(build, tube(SHOULDER, WRIST, cloth).part(0.05)))]
    return found + [side for part in hand() for side in both(part)]


DEEP = 0.015  # m from the surface within which folds are computed (guess)
REST = (0.25, 0.25, 0.25, 0.25, 0.1)  # bends of elbows, knees and waist whose folds are in the still pose


def creased(build: Build, part: Part) -> Part:
    """Return a part of cloth with folds."""

    def distance(points: Places) -> Depths:
        found = part.distance(points)
        near = np.abs(found) < DEEP
        found[near] -= folds(points[near], REST, build.trouser).astype(np.float32)
        return found

    return Part(distance, part.low - 0.01, part.high + 0.01, part.blend)


def folds(points: Places, bends: tuple[float, ...], low: float) -> Depths:
    """Return by how much cloth stands out, m, where elbows, knees and waist bend (left, right; 0 to 1); trousers end at `low`."""
    x, y, z = np.abs(points[..., 0]), points[..., 1], points[..., 2]
    is_left = points[..., 0] > 0
    elbow, knee = np.where(is_left, bends[0], bends[1]), np.where(is_left, bends[2], bends[3])
    along = (x - SHOULDER[0]) * ARM[0] + (y - SHOULDER[1]) * ARM[1]
    aside = (x - SHOULDER[0]) * ARM[1] - (y - SHOULDER[1]) * ARM[0]
    sleeve = (np.abs(aside) < 0.075) & (along > 0.03) & (x > 0.17)
    around = np.arctan2(aside, z)
    inner = 0.5 + 0.5 * np.cos(around)
    found = sleeve * 0.0065 * elbow * np.exp(-(((along - 0.275) / 0.055) ** 2)) * (0.25 + inner) * np.sin(2 * np.pi * (along - 0.01 * np.sin(2 * around)) / 0.036)
    found += sleeve * 0.0012 * np.sin(2 * np.pi * along / 0.052 + 1.7 * np.sin(around)) * np.clip(0.5 - along, 0, 0.1) * 10
    leg = (y < 0.90) & (y > low) & (x < 0.2) & ~sleeve
    turn = np.arctan2(x - 0.09, z)
    back = 0.5 - 0.5 * np.cos(turn)
    found += leg * 0.0075 * knee * np.exp(-(((y - 0.49) / 0.06) ** 2)) * (0.2 + back) * np.sin(2 * np.pi * (y + 0.012 * np.sin(turn)) / 0.042)
    found += leg * 0.0040 * np.exp(-(((y - 0.185) / 0.045) ** 2)) * np.sin(2 * np.pi * y / 0.036 + 1.8 * np.cos(turn + 0.6))
    found += leg * 0.0022 * np.exp(-(((y - 0.70) / 0.10) ** 2)) * np.sin(2 * np.pi * (y + 0.9 * (x - 0.09)) / 0.075 + 1.2 * turn)
    far = np.hypot(x, y - 0.815)
    found += leg * 0.0030 * np.exp(-((far / 0.075) ** 2)) * np.sin(9 * np.arctan2(y - 0.815, x + 1e-6)) * (0.4 + knee)
    shirt = (y > 0.88) & (x < 0.2) & (y < 1.40) & ~sleeve
    face = np.arctan2(points[..., 0], z)
    slack = np.exp(-(((y - 1.075) / 0.05) ** 2)) * (0.0034 + 0.006 * bends[4])
    found += shirt * slack * np.sin(2 * np.pi * y / 0.055 + 2.4 * np.sin(face + 0.5) + 1.1 * np.sin(3 * face))
    drape = np.exp(-(((y - 1.20) / 0.07) ** 2)) * 0.0020
    return found + shirt * drape * np.sin(2 * np.pi * (y + 1.3 * x) / 0.07 + 1.4 * np.sin(2 * face + 1))


def hand() -> list[Part]:
    """Return palm, fingers and thumb of the left hand, which is open."""
    place = lambda along, front, out=0.0: WRIST + along * ARM + front * np.array([0.0, 0.0, 1.0]) + out * PALM  # noqa: E731
    found = [ball(place(0.052, 0.0, 0.0), (0.052, 0.0155, 0.043), 0.012, np.stack([ARM, PALM, [0.0, 0.0, 1.0]], axis=1))]
    found.append(rod(place(0.02, 0.016, -0.004), place(0.05, 0.036, -0.008), (0.016, 0.013), 0.014))  # ball of the thumb
    for joints in finger_joints():
        for a, b, ra, rb in zip(joints[:-1], joints[1:], (0.0098, 0.0088, 0.0080), (0.0088, 0.0080, 0.0066), strict=False):
            found.append(rod(a, b, (ra, rb), 0.004))
    return found


def finger_joints() -> list[np.ndarray]:
    """Return knuckle, joints and tip of the fingers of the left hand, index first, and of its thumb; m."""
    ahead = np.array([0.0, 0.0, 1.0])
    found = []
    for along, front, length, spread in FINGERS:
        at, points = WRIST + along * ARM + front * ahead, []
        base = at - 0.030 * ARM
        points = [base, at]
        for share, bend in ((0.46, 0.10), (0.54, 0.30)):
            way = np.cos(bend) * (np.cos(spread) * ARM + np.sin(spread) * ahead) - np.sin(bend) * PALM
            at = at + share * length * way
            points.append(at)
        found.append(np.array(points))
    found.append(np.array([WRIST + a * ARM + f * ahead - 0.008 * PALM for a, f in THUMB]))
    return found


def local(build: Build, points: Places) -> Float32[np.ndarray, "... 3"]:
    """Return places in the frame of an adult's head, whose origin is at the height of the eyes."""
    return ((points - head_place(build)) / build.head).astype(np.float32)


def head_place(build: Build) -> Float64[np.ndarray, "3"]:
    return HEAD + [0.0, 0.107 * (build.head - 1), 0.004]


def head(build: Build) -> list[Part]:
    """Return neck, face, ears and hair."""
    skin = [*skull(build), *features(build)]
    scale, origin = build.head, head_place(build)

    def moved(part: Part) -> Part:
        def distance(points: Places) -> Depths:
            return np.float32(scale) * part.distance(local(build, points))

        return Part(distance, part.low * scale + origin, part.high * scale + origin, part.blend * scale, part.is_cut)

    neck = [tube(np.array([0.0, 1.40, -0.030]), np.array([0.0, 1.56, -0.016]), [(0.0, 0.062, 0.060, 0.0), (0.06, 0.050 - 0.004 * build.is_child, 0.052, 0.0), (0.11, 0.047 - 0.004 * build.is_child, 0.050, 0.0), (0.17, 0.048, 0.05, 0.0)]).part(0.006)]
    return neck + [moved(part) for part in skin] + [moved(hair(build))]


def skull(build: Build) -> list[Part]:
    c = float(build.is_child)
    return [
        ball((0.0, 0.032, -0.018), (0.0755, 0.083, 0.095), 0.02),  # cranium
        ball((0.0, -0.012, 0.020), (0.0635 + 0.0015 * c, 0.086 - 0.006 * c, 0.0655), 0.02),  # face
        ball((0.0, -0.058, 0.030), (0.0475 + 0.0025 * c, 0.048 - 0.004 * c, 0.047), 0.03),  # jaw
        ball((0.0, -0.094 + 0.008 * c, 0.058 - 0.003 * c), (0.0215, 0.0165, 0.0195), 0.035),  # chin
        *both(ball((0.037, -0.034 - 0.005 * c, 0.051), (0.021, 0.020 + 0.002 * c, 0.023), 0.025)),  # cheeks
        *both(rod((0.010, 0.0175, 0.0755), (0.044, 0.0150, 0.059), (0.0095, 0.0085), 0.014)),  # brows
    ]


EYE, LID = (0.0315, -0.001), (0.0165, 0.0068)  # middle of an eye and half its width and height, m


def features(build: Build) -> list[Part]:
    c = float(build.is_child)
    w, h = LID[0] * (1 + 0.12 * c), LID[1] * (1 + 0.22 * c)
    found = list(both(ball((0.032, -0.0015, 0.090), (0.0205, 0.0145, 0.0150), 0.014, is_cut=True)))  # sockets
    found += both(ball((EYE[0], EYE[1], 0.0640), (0.0158, 0.0150, 0.0150), 0.003))  # lids
    found += both(ball((EYE[0], EYE[1], 0.0815), (w - 0.001, h, 0.0085), 0.001, is_cut=True))
    found += both(ball((EYE[0], EYE[1], 0.0640), (0.0132, 0.0132, 0.0136), 0.0005))
    found += [
        rod((0.0, 0.010, 0.0785), (0.0, -0.033 + 0.004 * c, 0.0955 - 0.006 * c), (0.0068, 0.0080), 0.012),  # nose
        ball((0.0, -0.0375 + 0.004 * c, 0.0960 - 0.006 * c), (0.0098, 0.0088, 0.0098), 0.007),
        *both(ball((0.0112, -0.0405 + 0.004 * c, 0.0865 - 0.004 * c), (0.0068, 0.0066, 0.0090), 0.006)),
        ball((0.0, -0.0535, 0.0790 - 0.002 * c), (0.016, 0.014, 0.0085), 0.016),  # over the mouth
        *both(rod((0.003, -0.0620, 0.0850), (0.0215, -0.0655, 0.0725), (0.0048, 0.0026), 0.005)),  # lips
        rod((-0.010, -0.0725, 0.0815), (0.010, -0.0725, 0.0815), (0.0058, 0.0058), 0.006),
        *both(rod((0.009, -0.0722, 0.0815), (0.0205, -0.0670, 0.0725), (0.0052, 0.0022), 0.005)),
        *both(ball((0.0770, -0.012, -0.012), (0.0075, 0.0300, 0.0180), 0.006, _turn(0.25, -0.2))),  # ears
        *both(ball((0.0840, -0.008, -0.008), (0.0060, 0.0170, 0.0090), 0.004, _turn(0.25, -0.2), is_cut=True)),
    ]
    return found


def _turn(about_y: float, about_x: float) -> np.ndarray:
    a, b, c, s = np.cos(about_y), np.sin(about_y), np.cos(about_x), np.sin(about_x)
    return np.array([[a, 0, b], [0, 1, 0], [-b, 0, a]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def about_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def hair(build: Build) -> Part:
    """Return the hair as one solid in the frame of the head: a bob with a parting, or short and tousled."""
    cap = ball((0.0, 0.034, -0.022), (0.0865 - 0.002 * build.has_long_hair, 0.0935, 0.1055), 0.0)
    if build.has_long_hair:
        low, high = np.array([-0.11, -0.125, -0.14]), np.array([0.11, 0.14, 0.10])
        bob = tube(np.array([0.0, -0.118, -0.022]), np.array([0.0, 0.04, -0.022]), [(0.0, 0.080, 0.086, -0.004), (0.02, 0.091, 0.098, -0.003), (0.05, 0.094, 0.104, 0.0), (0.11, 0.089, 0.106, 0.0), (0.158, 0.0845, 0.1055, 0.0)])
        tilt = about_z(0.20)
        opening = ball((-0.006, -0.030, 0.094), (0.0635, 0.101, 0.070), 0.0, tilt)
        under = ball((0.0, -0.118, 0.05), (0.066, 0.08, 0.10), 0.0)
    else:
        low, high = np.array([-0.10, -0.09, -0.14]), np.array([0.10, 0.145, 0.10])
        opening = ball((0.006, -0.040, 0.088), (0.071, 0.102, 0.073), 0.0)
        ears = [*both(ball((0.088, -0.034, 0.004), (0.035, 0.046, 0.036), 0.0))]

    def distance(points: Places) -> Depths:
        relief = strands(build, points)
        solid = cap.distance(points)
        if build.has_long_hair:
            solid = np.minimum(solid, bob.distance(points)) - 0.0016 * relief
            return np.maximum(solid, -np.minimum(opening.distance(points), under.distance(points)))
        solid = solid - 0.0035 * relief
        holes = np.minimum(opening.distance(points), np.minimum(ears[0].distance(points), ears[1].distance(points)))
        return np.maximum(solid, -holes)

    return Part(distance, low, high, 0.003)


def strands(build: Build, points: Places) -> Depths:
    """Return ridges along the hair, -1 to 1, for places in the frame of the head."""
    x, y, z = (points[..., k] for k in range(3))
    if build.has_long_hair:
        around = np.arctan2(x + 0.02, z + 0.03)
        wave = around + 0.16 * np.sin(24 * y + 2 * around + 1.0)
        return (0.6 * np.sin(31 * wave) + 0.4 * np.sin(73 * wave + 40 * y)).astype(np.float32)
    around = np.arctan2(x - 0.012, z + 0.055) + 9 * np.sqrt((x - 0.012) ** 2 + (z + 0.055) ** 2)
    lumps = np.sin(11 * around + 30 * y) * np.cos(60 * y + 3 * around)
    return (0.6 * lumps + 0.4 * np.sin(37 * around + 80 * y)).astype(np.float32)
