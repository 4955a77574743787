"""Painted colours of a person, sRGB in 0 to 255, by places in the still pose of `person`; all are guesses by eye."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from .person import ANKLE, ARM, COLLAR, EYE, SHOULDER, Build, eyelids, finger_joints, hair, in_head, strands
from .solid_colors import Colors, Points, noise

RGB = tuple[int, int, int]
Share = Float[np.ndarray, " N"]
OVER = 0.0042  # m from the solid of the hair that is hair, too (guess)


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


# fmt: off
WOMAN = Look(
    skin=(236, 190, 162), lips=(190, 92, 88), iris=(88, 62, 38), hair=(78, 46, 28), shirt=(44, 66, 112),
    stripe=(240, 232, 216), trousers=(84, 112, 154), seam=(196, 158, 96), shoes=(238, 236, 230),
)
CHILD = Look(
    skin=(240, 196, 168), lips=(206, 116, 108), iris=(64, 98, 120), hair=(150, 100, 54), shirt=(244, 190, 64),
    stripe=(228, 92, 60), trousers=(62, 92, 106), seam=(50, 74, 86), shoes=(206, 60, 52),
)
# fmt: on
BAND = (0.115, 0.40)  # m from a stripe of the shirt to the next, and its share of that (guess)


def soft(value: Share, edge: Share | float, width: float) -> Share:
    """Return 0 far below an edge, 1 far above it, and a smooth transition as wide as `width`."""
    share = np.clip((value - edge) / width + 0.5, 0, 1)
    return share * share * (3 - 2 * share)


def near(value: Share, half: float, width: float) -> Share:
    """Return 1 where a value is less than `half` from 0, and 0 elsewhere, with a smooth transition."""
    return soft(-np.abs(value), -half, width)


def spot(x: Share, y: Share, wide: float, high: float) -> Share:
    """Return 1 at the origin and less and less around it."""
    return np.exp(-((x / wide) ** 2) - (y / high) ** 2)


def mixed(colors: Colors, color: RGB | Colors, share: Share) -> Colors:
    """Return colours with a share of another one."""
    return colors + np.clip(share, 0, 1)[:, None] * (np.asarray(color, float) - colors)


def plain(color: RGB, shade: Share) -> Colors:
    """Return a colour in shades of it."""
    return np.asarray(color, float) * shade[:, None]


def darker(color: RGB, red: float, green: float, blue: float) -> RGB:
    """Return a colour whose channels are multiplied."""
    return (int(color[0] * red), int(color[1] * green), int(color[2] * blue))


def dressed_colors(build: Build, look: Look, points: Points) -> Colors:
    """Return the colours of places on the person."""
    x, y, z = np.abs(points[:, 0]), points[:, 1], points[:, 2]
    beside = np.stack([x, y, z], axis=1) - SHOULDER
    along = np.einsum("nd,d->n", beside, ARM)
    away = beside - along[:, None] * ARM
    arm = (along > 0.02) & (x > 0.165) & ((away * away).sum(axis=1) < 0.11**2) & (y > 0.7)
    above = y > COLLAR
    cloth = ~above & ~arm & (y > (0.885 if build.is_child else 0.987))
    sleeve, hand, legs = arm & (along < build.sleeve), arm & (along >= build.sleeve), ~above & ~arm & ~cloth
    colors = _skin(look, points)
    colors[cloth] = _shirt(build, look, points[cloth])
    colors[sleeve] = _knit(look, points[sleeve])
    colors[legs] = _legs(build, look, points[legs])
    colors[hand] = _hand(colors[hand], np.stack([x, y, z], axis=1)[hand])
    colors[above] = _head(build, look, in_head(build, points[above]).astype(np.float64), colors[above])
    return np.clip(colors, 0, 255)


def _skin(look: Look, points: Points) -> Colors:
    return plain(look.skin, 1 + 0.015 * noise(points, 0.004))


def _knit(look: Look, points: Points) -> Colors:
    rows = 1 + 0.03 * np.sin(2 * np.pi * points[:, 1] / 0.004)
    return plain(look.shirt, rows * (1 + 0.03 * noise(points, 0.006)))


def _shirt(build: Build, look: Look, points: Points) -> Colors:
    """Return an adult's stripes, or the star and the red collar of a child."""
    x, y, z = points.T
    if not build.is_child:
        step, share = BAND
        return mixed(_knit(look, points), look.stripe, near(y / step % 1.0 - 0.5, share / 2, 0.03) * (y < 1.35))
    colors, (u, v) = _knit(look, points), (x, y - 1.245)
    corner = np.abs((np.arctan2(u, v) / (2 * np.pi) * 5 + 0.5) % 1.0 - 0.5) * 2  # 0 at a tip, 1 between two
    tip = np.pi / 5 * corner
    rim = 0.075 / (np.cos(tip) + 1.53 * np.sin(tip)) * (1 - 0.35 * soft(corner, 0.5, 0.9))
    colors = mixed(colors, look.stripe, soft(rim - np.hypot(u, v), 0, 0.003) * (z > 0.02))
    collar = (y > COLLAR - 0.017) & (np.hypot(x, z + 0.018) < 0.074)
    colors[collar] = look.stripe
    return colors


def _legs(build: Build, look: Look, points: Points) -> Colors:
    """Return trousers with seams and pockets, belt, skin and socks, and shoes."""
    x, y, z = np.abs(points[:, 0]), points[:, 1], points[:, 2]
    twill = 0.06 * np.sin(2 * np.pi * (y + 0.5 * z + 0.5 * x) / 0.004) + 0.10 * noise(points, 0.005)
    worn = spot(y - 0.70, z, 0.16, 9.0) * soft(z, 0.03, 0.10) + 0.7 * spot(y - 0.50, z, 0.06, 9.0) * soft(z, 0.03, 0.06)
    cloth = mixed(plain(look.trousers, 1 + twill), darker(look.trousers, 1.4, 1.4, 1.3), 0.55 * worn)
    sides = spot(z + 0.006, y, 0.0022, 9.0) * (y < 0.965) * (np.abs(x - 0.090 - 0.012 * (y - 0.5)) > 0.02)
    fly = spot(x, y, 0.002, 9.0) * (z > 0) * (y > 0.84)
    pocket = 0.9 * near(np.hypot(x - 0.150, y - 0.99) - 0.072, 0.0018, 0.001) * (z > 0)
    square = np.maximum(np.abs(x - 0.075) - 0.045, np.abs(y - 0.90) - 0.05)
    back = 0.9 * near(square, 0.002, 0.001) * (z < -0.06)
    colors = mixed(cloth, look.seam, 0.75 * np.max([sides, fly, pocket, back], axis=0))
    shoe = (y < 0.076) | ((z > 0.034) & (y < 0.13))
    if build.is_child:
        colors[np.abs(y - build.trouser - 0.012) < 0.0015] *= 0.8
        colors[y < build.trouser] = _skin(look, points)[y < build.trouser]
        ribs = 1 - 0.06 * (np.sin(45 * np.arctan2(x - ANKLE[0], z + 0.02)) > 0)
        colors[y < 0.168] = plain((240, 240, 236), ribs)[y < 0.168]
        colors[np.abs(y - 0.148) < 0.006] = look.stripe
    else:
        colors[y < 0.129] = mixed(cloth, (176, 192, 214), np.full(len(y), 0.6))[y < 0.129]  # the inner side, turned up
        belt = y > 0.969
        colors[belt] = plain((104, 66, 40), 1 + 0.1 * noise(points, 0.003))[belt]
        hole = (x < 0.015) & (np.abs(y - 0.988) < 0.008)
        colors[belt & (x < 0.0235) & (z > 0) & ~hole] = (206, 190, 150)
    colors[shoe] = _shoes(look, points[shoe])
    return colors


def _shoes(look: Look, points: Points) -> Colors:
    x, y, z = np.abs(points[:, 0]), points[:, 1], points[:, 2]
    aside = np.abs(x - ANKLE[0] - 0.003)
    colors = mixed(plain(look.shoes, 1 + 0.03 * noise(points, 0.004)), (246, 244, 238), soft(z, 0.105, 0.004))
    colors[(z > 0.005) & (z < 0.09) & (aside < 0.018) & (z % 0.018 < 0.008)] = (250, 250, 246)  # laces
    colors[(np.abs(z - 0.02 + 0.5 * (y - 0.05)) < 0.006) & (aside > 0.025)] = look.stripe
    sole = y < 0.0285
    colors[sole] = (248, 246, 240)
    colors[sole & (np.abs(y - 0.017) < 0.0025)] = look.stripe
    colors[y < 0.004] = (120, 112, 104)
    return colors


def _hand(colors: Colors, points: Points) -> Colors:
    """Return a hand whose joints are redder."""
    for joints in finger_joints():
        for joint in joints[1:-1]:
            colors = mixed(colors, (216, 150, 126), 0.25 * np.exp(-((points - joint) ** 2).sum(axis=1) / 0.010**2))
    return colors


def _head(build: Build, look: Look, own: Points, colors: Colors) -> Colors:
    """Return skin, face and hair at places in the frame of `in_head`."""
    x, y, z = np.abs(own[:, 0]), own[:, 1], own[:, 2]
    front, low = soft(z, 0.035, 0.02), 0.004 * build.is_child
    warm, shaded = darker(look.skin, 1.0, 0.74, 0.68), darker(look.skin, 0.80, 0.72, 0.72)
    blush = 0.42 * spot(x - 0.045, y + 0.033, 0.020, 0.015) + 0.30 * spot(x, y + 0.038, 0.013, 0.010)
    blush += 0.35 * spot(x - 0.078, y + 0.01, 0.012, 0.03) + 0.18 * spot(x, y + 0.098, 0.016, 0.010)
    colors = mixed(colors, warm, blush)
    colors = mixed(colors, shaded, 0.5 * front * spot(x - EYE[0], y - EYE[1] - 0.005, 0.021, 0.010))
    colors = mixed(colors, (120, 70, 60), 0.75 * front * spot(x - 0.0068, y + 0.0462 - low, 0.0032, 0.0020))
    brows = _brows(x, y - low / 2, 0.62 if build.is_child else 0.72)
    colors = mixed(colors, darker(look.hair, 0.75, 0.75, 0.75), brows * front)
    colors = _mouth(look, colors, x, y, front)
    return _hair(build, look, own, _eyes(build, look, colors, own, front))


def _brows(x: Share, y: Share, most: float) -> Share:
    """Return the share of the hairs of brows, `most` in their middle."""
    middle = 0.0205 + 0.0040 * np.sin(np.pi * np.clip((x - 0.006) / 0.056, 0, 1))
    thick = 0.0026 * np.clip(1.15 - (x - 0.012) / 0.045, 0.2, 1.0)
    share = soft(thick - np.abs(y - middle), 0, 0.002) * near(x - 0.031, 0.0185, 0.004)
    hairs = 0.85 + 0.15 * np.sin(2400 * x + 900 * y)
    return most * share * hairs


def _mouth(look: Look, colors: Colors, x: Share, y: Share, front: Share) -> Colors:
    """Return lips that smile a little."""
    corner = np.clip(x / 0.0235, 0, 1)
    line = -0.0682 + 0.0030 * corner**2
    upper = line + 0.0068 * (1 - corner**2.2) - 0.0016 * spot(x, y, 0.004, 9.0)
    lower = line - 0.0094 * (1 - corner**2)
    lips = soft(np.minimum(upper - y, y - lower), 0, 0.0022) * (x < 0.0235)
    colors = mixed(colors, look.lips, 0.9 * lips * front)
    colors = mixed(colors, (255, 226, 216), 0.35 * front * spot(x, y - line + 0.0050, 0.010, 0.0020))
    between = soft(0.0011 * (1.1 - 0.5 * corner) - np.abs(y - line), 0, 0.0012) * (x < 0.0245)
    return mixed(colors, (104, 44, 44), 0.85 * between * front)


def _eyes(build: Build, look: Look, colors: Colors, own: Points, front: Share) -> Colors:
    """Return eyes with white, iris and pupil, lashes and the fold of the lids."""
    x, (wide, high) = np.abs(own[:, 0]), eyelids(build)
    u, v = x - EYE[0], own[:, 1] - EYE[1] - 0.0012 * (x - EYE[0]) / wide
    share, within = np.clip(np.abs(u) / wide, 0, 1), front * (np.abs(u) < wide)
    top, bottom = high * (1 - share**2.4), -0.80 * high * (1 - share**2)
    eye = np.repeat(np.array([[242.0, 240.0, 236.0]]), len(x), axis=0)
    eye = mixed(eye, (214, 196, 188), soft(share, 0.75, 0.6) + soft(v, 0.55 * high, 0.006))
    far, iris = np.hypot(u, v - 0.0006), 0.39 * wide
    rim = darker(look.iris, 0.35, 0.35, 0.35)
    lower = 0.6 * soft(-v, 0, 0.006)
    colored = mixed(plain(look.iris, np.ones(len(x))), darker(look.iris, 1.7, 1.7, 1.7), lower)
    eye = mixed(mixed(eye, colored, soft(iris - far, 0, 0.0010)), rim, near(far - iris, 0.0012, 0.0012))
    eye = mixed(eye, (14, 10, 10), soft(0.0029 - far, 0, 0.0010))
    glint = np.hypot(own[:, 0] - np.sign(own[:, 0]) * EYE[0] - 0.0020, v - 0.0026)
    eye = mixed(eye, (255, 255, 255), soft(0.0015 - glint, 0, 0.0010))
    colors = mixed(colors, eye, soft(np.minimum(top - v, v - bottom), 0, 0.0012) * within)
    colors = mixed(colors, (44, 28, 24), 0.9 * near(v - top - 0.0004, 0.0013, 0.0012) * within)
    colors = mixed(colors, darker(look.skin, 0.68, 0.56, 0.54), 0.55 * spot(v - top - 0.0042, u, 0.0011, 9.0) * within)
    return mixed(colors, darker(look.skin, 0.72, 0.55, 0.52), 0.6 * spot(v - bottom + 0.0004, u, 0.0009, 9.0) * within)


def _hair(build: Build, look: Look, own: Points, colors: Colors) -> Colors:
    x, y, z = own.T
    places = own.astype(np.float32)
    around = np.arctan2(x + 0.02, z + 0.03)
    fine = 0.5 * np.sin(140 * around + 3 * np.sin(30 * y)) + 0.5 * np.sin(311 * around + 50 * y)
    shine = spot(y - 0.075, x, 0.022, 9.0) + 0.4 * spot(y + 0.04, x, 0.03, 9.0)
    tone = 1 + 0.20 * strands(build, places) + 0.10 * fine + 0.38 * shine * (0.7 + 0.3 * fine)
    return mixed(colors, plain(look.hair, tone), soft(-hair(build).distance(places), -OVER, 0.0012))
