"""Painted colours of a person, sRGB in 0 to 255, by places in the still pose of `person`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from .person import ARM, EYE, LID, SHOULDER, Build, finger_joints, hair, local, strands
from .solid_colors import Colors, Points, _noise

RGB = tuple[int, int, int]
Share = Float64[np.ndarray, " N"]


@dataclass(frozen=True, slots=True)
class Look:
    """Colours of a person."""

    skin: RGB
    lips: RGB
    iris: RGB
    hair: RGB
    shirt: RGB
    stripe: RGB
    trousers: RGB
    seam: RGB
    shoes: RGB
    stripes: tuple[float, float] = (0.115, 0.40)  # m from one to the next, and the share that is coloured


WOMAN = Look((236, 190, 162), (190, 92, 88), (88, 62, 38), (78, 46, 28), (44, 66, 112), (240, 232, 216), (84, 112, 154), (196, 158, 96), (238, 236, 230))
CHILD = Look((240, 196, 168), (206, 116, 108), (64, 98, 120), (150, 100, 54), (244, 190, 64), (228, 92, 60), (62, 92, 106), (50, 74, 86), (206, 60, 52), (10.0, 0.0))


def soft(value: Share, edge: float, width: float) -> Share:
    """Return 0 far below an edge, 1 far above it, and a smooth transition as wide as `width`."""
    share = np.clip((value - edge) / width + 0.5, 0, 1)
    return share * share * (3 - 2 * share)


def mixed(colors: Colors, color: RGB | Colors, share: Share) -> Colors:
    return colors + np.clip(share, 0, 1)[:, None] * (np.asarray(color, float) - colors)


def dressed_colors(build: Build, look: Look, points: Points) -> Colors:
    """Return the colours of places on the person."""
    x, y, z = np.abs(points[:, 0]), points[:, 1], points[:, 2]
    beside = np.stack([x, y, z], axis=1) - SHOULDER
    along = beside @ ARM
    arm = (along > 0.02) & (x > 0.165) & (np.linalg.norm(beside - along[:, None] * ARM, axis=1) < 0.11) & (y > 0.7)
    above = y > 1.483
    colors = skin_colors(look, points)
    cloth = ~above & ~arm & (y > (0.885 if build.is_child else 0.987))
    colors[cloth] = shirt_colors(build, look, points[cloth], y[cloth])
    sleeve = arm & (along < build.sleeve)
    colors[sleeve] = shirt_colors(build, look, points[sleeve], np.full(int(sleeve.sum()), 2.0))
    legs = ~above & ~arm & ~cloth
    colors[legs] = leg_colors(build, look, points[legs])
    hand = arm & ~sleeve
    colors[hand] = nails(colors[hand], np.stack([x, y, z], axis=1)[hand])
    own = local(build, points[above]).astype(np.float64)
    colors[above] = head_colors(build, look, own, colors[above])
    return np.clip(colors, 0, 255)


def skin_colors(look: Look, points: Points) -> Colors:
    grain = 1 + 0.015 * _noise(points, 0.004)
    return np.asarray(look.skin, float) * grain[:, None]


def shirt_colors(build: Build, look: Look, points: Points, height: Share) -> Colors:
    knit = 1 + 0.03 * np.sin(2 * np.pi * points[:, 1] / 0.004)
    colors = np.repeat(np.array([look.shirt], float), len(points), axis=0)
    step, share = look.stripes
    phase = height / step % 1.0
    colors = mixed(colors, look.stripe, soft(share / 2 - np.abs(phase - 0.5), 0, 0.03) * (height < 1.35))
    if build.is_child:  # a star on the chest
        u, v = points[:, 0], points[:, 1] - 1.245
        around, far = np.arctan2(u, v), np.hypot(u, v)
        corner = np.abs((around / (2 * np.pi) * 5 + 0.5) % 1.0 - 0.5) * 2  # 0 at a tip, 1 between two
        rim = 0.075 * 0.45 / (0.45 * np.cos(corner * 0.628) + (1 - 0.45) * np.sin(corner * 0.628) * 1.25 + 0.0)
        rim = np.minimum(rim, 0.075) * (1 - 0.35 * soft(corner, 0.5, 0.9))
        colors = mixed(colors, look.stripe, soft(rim - far, 0, 0.003) * (points[:, 2] > 0.02))
        colors[(points[:, 1] > 1.466) & (np.hypot(points[:, 0], points[:, 2] + 0.018) < 0.074)] = look.stripe
    return colors * (knit * (1 + 0.03 * _noise(points, 0.006)))[:, None]


def leg_colors(build: Build, look: Look, points: Points) -> Colors:
    x, y, z = np.abs(points[:, 0]), points[:, 1], points[:, 2]
    twill = 1 + 0.06 * np.sin(2 * np.pi * (y + 0.5 * z + 0.5 * x) / 0.004) + 0.10 * _noise(points, 0.005)
    cloth = np.asarray(look.trousers, float) * twill[:, None]
    worn = np.exp(-(((y - 0.70) / 0.16) ** 2)) * soft(z, 0.03, 0.10) + 0.7 * np.exp(-(((y - 0.50) / 0.06) ** 2)) * soft(z, 0.03, 0.06)
    cloth = mixed(cloth, tuple(min(255, 1.35 * c + 12) for c in look.trousers), 0.55 * worn)
    out = x - 0.090 - 0.012 * (y - 0.5)
    seams = np.exp(-(((z + 0.006) / 0.0022) ** 2)) * (y < 0.965) * (np.abs(out) > 0.02)
    pocket = np.abs(np.hypot(x - 0.150, y - 0.99) - 0.072) < 0.0018
    seams = np.maximum(seams, 0.9 * (pocket & (z > 0.0)))
    back = (z < -0.06) & (np.abs(np.maximum(np.abs(x - 0.075) - 0.045, np.abs(y - 0.90) - 0.05)) < 0.002)
    seams = np.maximum(seams, 0.9 * back)
    seams = np.maximum(seams, np.exp(-((points[:, 0] / 0.002) ** 2)) * (z > 0) * (y > 0.84))
    colors = mixed(cloth, look.seam, 0.75 * seams)
    shoe = (y < 0.076) | ((z > 0.034) & (y < 0.13))
    if build.is_child:
        bare = (y < build.trouser) & (y > 0.168)
        colors[bare] = skin_colors(look, points[bare])
        sock = (y <= 0.168) & ~shoe
        ribs = 1 - 0.06 * (np.sin(900 * np.arctan2(x - 0.099, z + 0.02) / 20) > 0)
        colors[sock] = (np.array([240.0, 240.0, 236.0]) * ribs[:, None])[sock]
        colors[sock & (np.abs(y - 0.148) < 0.006)] = look.stripe
        colors[np.abs(y - build.trouser - 0.012) < 0.0015] *= 0.8
    else:
        cuff = (y < 0.129) & ~shoe
        colors[cuff] = mixed(cloth, (176, 192, 214), np.full(len(y), 0.6))[cuff]
        belt = y > 0.969
        leather = np.repeat(np.array([[104.0, 66.0, 40.0]]), len(y), axis=0) * (1 + 0.1 * _noise(points, 0.003))[:, None]
        colors[belt] = leather[belt]
        buckle = belt & (x < 0.0235) & (z > 0)
        hole = (x < 0.015) & (np.abs(y - 0.988) < 0.008)
        colors[buckle & ~hole] = (206, 190, 150)
    colors[shoe] = shoe_colors(look, points[shoe])
    return colors


def shoe_colors(look: Look, points: Points) -> Colors:
    x, y, z = np.abs(points[:, 0]), points[:, 1], points[:, 2]
    colors = np.asarray(look.shoes, float) * (1 + 0.03 * _noise(points, 0.004))[:, None]
    toe = soft(z, 0.105, 0.004)
    colors = mixed(colors, (246, 244, 238), toe)
    laces = (z > 0.005) & (z < 0.09) & (np.abs(x - 0.102) < 0.018) & (z % 0.018 < 0.008)
    colors[laces] = (250, 250, 246)
    band = np.abs(z - 0.02 + 0.5 * (y - 0.05)) < 0.006
    colors[band & (np.abs(x - 0.102) > 0.025)] = look.stripe
    sole = y < 0.0285
    colors[sole] = (248, 246, 240)
    colors[sole & (np.abs(y - 0.017) < 0.0025)] = look.stripe
    colors[y < 0.004] = (120, 112, 104)
    return colors


def nails(colors: Colors, points: Points) -> Colors:
    """Return colours of a hand: knuckles are redder, nails lighter."""
    for joints in finger_joints():
        for joint in joints[1:-1]:
            colors = mixed(colors, (216, 150, 126), 0.25 * np.exp(-(((points - joint) ** 2).sum(axis=1) / 0.010**2)))
    return colors


def head_colors(build: Build, look: Look, own: Points, skin: Colors) -> Colors:
    """Return colours of places in the frame of the head."""
    x, y, z = np.abs(own[:, 0]), own[:, 1], own[:, 2]
    c = float(build.is_child)
    front = soft(z, 0.035, 0.02)
    colors = skin
    warm = tuple(np.array(look.skin) * (1.0, 0.74, 0.68))
    for (u, v, wide, high), strength in (((0.045, -0.033, 0.020, 0.015), 0.42), ((0.0, -0.038, 0.013, 0.010), 0.30), ((0.078, -0.01, 0.012, 0.03), 0.35), ((0.0, -0.098, 0.016, 0.010), 0.18)):
        colors = mixed(colors, warm, strength * np.exp(-(((x - u) / wide) ** 2) - ((y - v) / high) ** 2))
    colors = mixed(colors, tuple(np.array(look.skin) * (0.80, 0.72, 0.72)), 0.5 * front * np.exp(-(((x - EYE[0]) / 0.021) ** 2) - ((y - EYE[1] - 0.005) / 0.010) ** 2))
    colors = brows(look, colors, x, y, front, c)
    colors = mouth(look, colors, x, y, front)
    colors = mixed(colors, (120, 70, 60), 0.75 * np.exp(-(((x - 0.0068) / 0.0032) ** 2) - ((y + 0.0462 - 0.004 * c) / 0.0020) ** 2) * front)
    colors = eyes(look, colors, own, front, c)
    return hair_colors(build, look, own, colors)


def brows(look: Look, colors: Colors, x: Share, y: Share, front: Share, c: float) -> Colors:
    middle = 0.0205 + 0.0040 * np.sin(np.pi * np.clip((x - 0.006) / 0.056, 0, 1)) + 0.002 * c
    thick = 0.0026 * np.clip(1.15 - (x - 0.012) / 0.045, 0.2, 1.0) * (1 - 0.15 * c)
    hairs = 0.85 + 0.15 * np.sin(2400 * x + 900 * y)
    share = soft(thick - np.abs(y - middle), 0, 0.002) * soft(x, 0.0125, 0.004) * soft(-x, -0.0495, 0.004)
    return mixed(colors, tuple(0.75 * np.array(look.hair)), (0.72 - 0.1 * c) * share * hairs * front)


def mouth(look: Look, colors: Colors, x: Share, y: Share, front: Share) -> Colors:
    corner = np.clip(x / 0.0235, 0, 1)
    line = -0.0682 + 0.0030 * corner**2  # a slight smile
    upper = line + 0.0068 * (1 - corner**2.2) - 0.0016 * np.exp(-((x / 0.004) ** 2))
    lower = line - 0.0094 * (1 - corner**2)
    lips = soft(np.minimum(upper - y, y - lower), 0.0, 0.0022) * (x < 0.0235)
    colors = mixed(colors, look.lips, 0.9 * lips * front)
    shine = np.exp(-((x / 0.010) ** 2) - ((y - line + 0.0050) / 0.0020) ** 2)
    colors = mixed(colors, (255, 226, 216), 0.35 * shine * front)
    dark = soft(0.0011 * (1.1 - 0.5 * corner) - np.abs(y - line), 0, 0.0012) * (x < 0.0245)
    return mixed(colors, (104, 44, 44), 0.85 * dark * front)


def eyes(look: Look, colors: Colors, own: Points, front: Share, c: float) -> Colors:
    x, y = np.abs(own[:, 0]), own[:, 1]
    w, h = LID[0] * (1 + 0.12 * c), LID[1] * (1 + 0.22 * c)
    u, v = x - EYE[0], y - EYE[1] - 0.0012 * (x - EYE[0]) / w
    share = np.clip(u / w, -1, 1)
    top, bottom = h * (1 - np.abs(share) ** 2.4), -0.80 * h * (1 - np.abs(share) ** 2.0)
    opening = soft(np.minimum(top - v, v - bottom), 0, 0.0012) * (np.abs(u) < w) * front
    white = mixed(np.full((len(x), 3), (242.0, 240.0, 236.0)), (214, 196, 188), soft(np.abs(share), 0.75, 0.6) + soft(v, 0.55 * h, 0.006))
    far = np.hypot(u, v - 0.0006)
    iris = 0.0064 * (1 + 0.12 * c)
    colored = mixed(np.repeat(np.array([look.iris], float), len(x), axis=0), tuple(np.minimum(255, np.array(look.iris) * 1.7)), 0.6 * soft(-v, 0, 0.006))
    ball = mixed(white, colored, soft(iris - far, 0, 0.0010))
    ball = mixed(ball, tuple(0.35 * np.array(look.iris)), soft(0.0012 - np.abs(far - iris), 0, 0.0012))
    ball = mixed(ball, (14, 10, 10), soft(0.0029 - far, 0, 0.0010))
    glint = np.hypot(own[:, 0] - np.sign(own[:, 0]) * EYE[0] - 0.0020, v - 0.0026)
    ball = mixed(ball, (255, 255, 255), soft(0.0015 - glint, 0, 0.0010))
    colors = colors + opening[:, None] * (ball - colors)
    lash = soft(0.0013 - np.abs(v - top - 0.0004), 0, 0.0012) * (np.abs(u) < w + 0.001) * front
    colors = mixed(colors, (44, 28, 24), 0.9 * lash)
    crease = np.exp(-(((v - top - 0.0042) / 0.0011) ** 2)) * (np.abs(u) < w) * front
    colors = mixed(colors, tuple(np.array(look.skin) * (0.68, 0.56, 0.54)), 0.55 * crease)
    under = np.exp(-(((v - bottom + 0.0004) / 0.0009) ** 2)) * (np.abs(u) < w) * front
    return mixed(colors, tuple(np.array(look.skin) * (0.72, 0.55, 0.52)), 0.6 * under)


def hair_colors(build: Build, look: Look, own: Points, colors: Colors) -> Colors:
    x, y, z = own.T
    places = own.astype(np.float32)
    share = soft(-hair(build).distance(places).astype(float), -0.0042, 0.0012)
    ridge = strands(build, places).astype(float)
    around = np.arctan2(x + 0.02, z + 0.03)
    fine = np.sin(140 * around + 3 * np.sin(30 * y)) * 0.5 + 0.5 * np.sin(311 * around + 50 * y)
    shine = np.exp(-(((y - 0.075) / 0.022) ** 2)) + 0.4 * np.exp(-(((y + 0.04) / 0.03) ** 2))
    tone = 1 + 0.20 * ridge + 0.10 * fine + 0.38 * shine * (0.7 + 0.3 * fine)
    return colors + share[:, None] * (np.asarray(look.hair, float) * tone[:, None] - colors)
