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
SHOULDER, HIP = np.array([0.166, 1.400, -0.014]), np.array([0.088, 0.930, -0.005])
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
    c = build.is_child
    shirt: Rows = [
        (0.995 if not c else 0.885, 0.146 if not c else 0.158, 0.104 if not c else 0.122, -0.008),
        (1.03, 0.147, 0.106 if not c else 0.126, -0.004),
        (1.11, 0.139 if not c else 0.150, 0.101 if not c else 0.126, 0.002),
        (1.20, 0.146, 0.106 if not c else 0.116, 0.006),
        (1.285, 0.158, 0.122 if not c else 0.110, 0.010 if not c else 0.002),
        (1.34, 0.166, 0.112 if not c else 0.104, 0.002),
        (1.395, 0.156, 0.090, -0.012),
        (1.435, 0.112, 0.068, -0.020),
        (1.462, 0.072, 0.062, -0.020),
        (1.472, 0.066, 0.059, -0.019),
    ]
    found = [
        tube(*UP, shirt).part(0.02),
        *both(rod((0.05, 1.443, -0.024), (0.145, 1.405, -0.016), (0.034, 0.042), 0.05)),
    ]
    hips: Rows = [(0.80, 0.150, 0.095, -0.012), (0.87, 0.166, 0.112, -0.018), (0.95, 0.158, 0.108, -0.014), (1.0, 0.142, 0.099, -0.009), (1.012, 0.141, 0.098, -0.009)]
    found += [tube(*UP, hips).part(0.004), *both(ball((0.066, 0.895, -0.058), (0.078, 0.085, 0.078), 0.05))]
    if not c:
        found.append(tube(*UP, [(0.972, 0.152, 0.107, -0.011), (1.003, 0.148, 0.105, -0.009)]).part(0.002))  # belt
        found.append(ball((0.0, 0.988, 0.0985), (0.022, 0.015, 0.006), 0.001))  # and buckle
    found.append(tube(*UP, [(1.44, 0.060, 0.056, -0.020), (1.478, 0.0615, 0.0575, -0.017), (1.483, 0.060, 0.056, -0.0165)]).part(0.003))  # collar
    return found


def legs(build: Build) -> list[Part]:
    top = np.array([0.086, 0.95, -0.006])
    end = np.array([0.099, 0.0, -0.026])
    at = lambda y: 0.95 - y  # noqa: E731
    limb: Rows = [
        (at(0.93), 0.090, 0.105, -0.004), (at(0.82), 0.087, 0.098, 0.0), (at(0.70), 0.077, 0.086, 0.004),
        (at(0.56), 0.062, 0.068, 0.006), (at(0.49), 0.058, 0.063, 0.008), (at(0.40), 0.0575, 0.064, -0.004),
        (at(0.33), 0.0565, 0.0635, -0.010), (at(0.22), 0.050, 0.056, -0.006), (at(0.12), 0.047, 0.052, 0.0), (at(0.07), 0.047, 0.053, 0.0),
    ]
    found: list[Part] = []
    if build.is_child:  # shorts, knees and socks
        hem = at(build.trouser)
        cloth = [(t, a + 0.004 + 0.012 * t, b + 0.004 + 0.012 * t, s) for t, a, b, s in limb if t < hem - 0.03]
        cloth += [(hem, cloth[-1][1] + 0.004, cloth[-1][2] + 0.004, 0.006)]
        found += both(tube(top, end, cloth).part(0.02))
        bare = [(t, 0.80 * a, 0.80 * b, s) for t, a, b, s in limb[2:]]
        bare[2:4] = [(at(0.50), 0.050, 0.053, 0.010), (at(0.44), 0.044, 0.048, 0.002)]
        found += both(tube(top, end, bare).part(0.004))
        sock: Rows = [(at(0.17), 0.042, 0.047, -0.002), (at(0.165), 0.044, 0.049, -0.002), (at(0.07), 0.041, 0.047, 0.0)]
        found += both(tube(top, end, sock).part(0.002))
    else:
        found += both(tube(top, end, limb).part(0.02))
        cuff: Rows = [(at(0.128), 0.0515, 0.0565, 0.0), (at(0.078), 0.052, 0.058, 0.0)]
        found += both(tube(top, end, cuff).part(0.002))
    x, z = ANKLE[0], ANKLE[2]
    found += both(rod((x, 0.10, z), (x, 0.05, z + 0.005), (0.036, 0.038), 0.006))
    found += both(ball((x + 0.004, 0.040, z + 0.070), (0.040, 0.044, 0.112), 0.02))
    found += both(ball((x, 0.045, z - 0.012), (0.037, 0.046, 0.048), 0.03))
    sole = Tube(np.array([x + 0.003, 0.0, z + 0.058]), UP[1], np.array([0.0, 0.0, 1.0]), np.array([(0.0, 0.045, 0.127, 0.0), (0.026, 0.0465, 0.129, 0.0)]))
    found += both(sole.part(0.003))
    return found


def arms(build: Build) -> list[Part]:
    end = WRIST
    skin: Rows = [(0.10, 0.038, 0.040, 0.0), (0.22, 0.036, 0.038, 0.0), (0.28, 0.035, 0.036, 0.0), (0.33, 0.036, 0.039, 0.002), (0.42, 0.029, 0.033, 0.002), (0.51, 0.020, 0.0265, 0.0), (0.55, 0.0185, 0.027, 0.0)]
    cloth: Rows = [(-0.02, 0.052, 0.058, 0.0), (0.05, 0.052, 0.057, 0.0), (0.14, 0.047, 0.050, 0.0), (0.24, 0.0435, 0.0455, 0.0), (0.30, 0.042, 0.044, 0.0), (0.36, 0.0415, 0.0435, 0.002), (0.46, 0.035, 0.037, 0.002), (0.515, 0.031, 0.033, 0.0), (0.52, 0.033, 0.035, 0.0)]
    found = list(both(tube(SHOULDER, end, skin).part(0.01)))
    short = [row for row in cloth if row[0] < build.sleeve - 0.01]
    wide = 0.006 if build.is_child else 0.0
    short = [(t, a + wide, b + wide, s) for t, a, b, s in short] + [(build.sleeve, short[-1][1] + 1.3 * wide + 0.001, short[-1][2] + 1.3 * wide + 0.001, 0.0)]
    found += both(tube(SHOULDER, end, short).part(0.04))
    return found + [side for part in hand() for side in both(part)]


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
        ball((0.0, -0.012, 0.020), (0.066 + 0.002 * c, 0.086 - 0.006 * c, 0.0655), 0.02),  # face
        ball((0.0, -0.058, 0.030), (0.052 + 0.003 * c, 0.048 - 0.004 * c, 0.047), 0.03),  # jaw
        ball((0.0, -0.094 + 0.008 * c, 0.058 - 0.003 * c), (0.0215, 0.0165, 0.0195), 0.035),  # chin
        *both(ball((0.041, -0.036 - 0.004 * c, 0.050), (0.024 + 0.003 * c, 0.022 + 0.003 * c, 0.024 + 0.002 * c), 0.03)),  # cheeks
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


def hair(build: Build) -> Part:
    """Return the hair as one solid in the frame of the head: a bob with a parting, or short and tousled."""
    cap = ball((0.0, 0.034, -0.022), (0.0865, 0.0935, 0.1055), 0.0)
    if build.has_long_hair:
        low, high = np.array([-0.11, -0.125, -0.14]), np.array([0.11, 0.14, 0.10])
        bob = tube(np.array([0.0, -0.118, -0.022]), np.array([0.0, 0.04, -0.022]), [(0.0, 0.086, 0.094, -0.002), (0.02, 0.0945, 0.102, -0.002), (0.06, 0.0955, 0.106, 0.0), (0.12, 0.090, 0.106, 0.0), (0.158, 0.0865, 0.1055, 0.0)])
        tilt = np.array([[np.cos(0.16), -np.sin(0.16), 0], [np.sin(0.16), np.cos(0.16), 0], [0, 0, 1.0]])
        opening = ball((-0.004, -0.036, 0.092), (0.0625, 0.094, 0.067), 0.0, tilt)
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
        wave = around + 0.35 * np.sin(22 * y + 2 * around)
        return (0.6 * np.sin(31 * wave) + 0.4 * np.sin(73 * wave + 40 * y)).astype(np.float32)
    around = np.arctan2(x - 0.012, z + 0.055) + 9 * np.sqrt((x - 0.012) ** 2 + (z + 0.055) ** 2)
    lumps = np.sin(11 * around + 30 * y) * np.cos(60 * y + 3 * around)
    return (0.6 * lumps + 0.4 * np.sin(37 * around + 80 * y)).astype(np.float32)
