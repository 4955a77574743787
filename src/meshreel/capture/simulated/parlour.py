"""The room of the demo: three walls, a floor of oak, a sofa, shelves, a plant and a ball, and their colours.

Places, sizes and colours (sRGB, 0 to 255) are guesses by eye.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...types import Mesh
from .demo_room import Box, box, joined, panel
from .dress import Share, mixed, near, plain, soft, spot
from .sculpture import Part, ball, block, meshed, rod
from .solid_colors import Colors, Points, noise

SIZE = (3.4, 2.25, 2.8)  # m; the origin is the middle of the floor
WINDOW = np.array([[-0.55, 1.00], [0.95, 2.00]])  # m, its corners on the left wall, z and y
# m, pictures on the back wall: x and y of their middles, and half their sides.
FRAMES = ((0.30, 1.40, 0.17, 0.22), (0.78, 1.46, 0.20, 0.15), (1.22, 1.38, 0.14, 0.18))
SHELF: Box = ((-1.62, 0.0, -1.38), (-0.92, 1.55, -1.08))
BALL = ((1.22, 0.12, 0.85), 0.12)  # m, its middle and radius
CUSHION = np.array([[0.43, 0.66, -1.06], [0.19, 0.17, 0.09]])  # m, its middle and radii
# m, boxes around what stands on the floor, which is darker beside them.
FOOTPRINTS = np.array(
    [
        SHELF,
        ((0.08, 0.0, -1.36), (1.60, 0.82, -0.60)),
        ((-1.55, 0, 0.85), (-1.29, 0.3, 1.11)),
        ((1.13, 0, 0.76), (1.31, 0.05, 0.94)),
    ]
)
BOOKS = np.array(
    [(176, 74, 60), (54, 84, 110), (214, 170, 88), (96, 124, 98), (226, 214, 192), (120, 72, 84), (70, 110, 120)], float
)
COARSE, MANY = 0.03, 20_000  # m, of the lattice of furniture, and faces, which none has
FLAT = 0.004  # m from a plane that still is on it


@dataclass(frozen=True, slots=True)
class Thing:
    """Still surface and its colours."""

    mesh: Mesh
    paint: Callable[[Points], Colors]


def furniture() -> tuple[Thing, ...]:
    """Return the room and what stands in it."""
    x, y, z = SIZE[0] / 2, SIZE[1], SIZE[2] / 2
    panels = [
        panel((-x, 0, z), (2 * x, 0, 0), (0, 0, -2 * z)),  # the floor
        panel((-x, 0, -z), (2 * x, 0, 0), (0, y, 0)),  # the walls at the back,
        panel((-x, 0, z), (0, 0, -2 * z), (0, y, 0)),  # on the left,
        panel((x, 0, -z), (0, 0, 2 * z), (0, y, 0)),  # and on the right
    ]
    return (
        Thing(joined(panels), _room),
        Thing(box(SHELF), _shelf),
        Thing(meshed(_sofa_parts(), COARSE, MANY), _sofa),
        Thing(meshed(_plant_parts(), COARSE, MANY), _plant),
        Thing(meshed([ball(BALL[0], (BALL[1],) * 3, 0.0)], COARSE, MANY), _ball),
    )


def _sofa_parts() -> list[Part]:
    return [
        block((0.12, 0.10, -1.36), (1.56, 0.40, -0.62), 0.05, 0.01),
        block((0.12, 0.10, -1.36), (1.56, 0.82, -1.14), 0.07, 0.01),
        block((0.08, 0.08, -1.36), (0.28, 0.60, -0.60), 0.07, 0.01),
        block((1.40, 0.08, -1.36), (1.60, 0.60, -0.60), 0.07, 0.01),
        block((0.29, 0.36, -1.18), (0.835, 0.49, -0.60), 0.045, 0.004),
        block((0.845, 0.36, -1.18), (1.39, 0.49, -0.60), 0.045, 0.004),
        ball(CUSHION[0], CUSHION[1], 0.004),
    ]


def _plant_parts() -> list[Part]:
    """Return a pot, a stem, and leaves around the surface of an ellipsoid."""
    parts = [rod((-1.42, 0.10, 0.98), (-1.42, 0.30, 0.98), (0.13, 0.16), 0.01)]
    for way in np.random.default_rng(3).normal(size=(16, 3)):
        at = 0.21 / np.sqrt((way * way).sum()) * way * (0.85, 1.15, 0.85)
        parts.append(ball(at + (-1.42, 0.72, 0.98), (0.13, 0.11, 0.13), 0.02))
    return [*parts, rod((-1.42, 0.3, 0.98), (-1.42, 0.6, 0.98), (0.03, 0.03), 0.03)]


def _room(points: Points) -> Colors:
    """Return the colours of floor and walls, darker in corners and beside things."""
    x, y, z = points.T
    colors, floor = _walls(points), y < FLAT
    colors[floor] = _floor(points[floor])
    for gap in (y, SIZE[0] / 2 - x, SIZE[0] / 2 + x, SIZE[2] / 2 + z):  # to each plane but that of the place itself
        colors *= (1 - 0.16 * np.exp(-np.where(gap < FLAT, np.inf, gap) / 0.20))[:, None]
    for low, high in FOOTPRINTS:
        beyond = np.maximum(np.maximum(low - points, points - high), 0)
        colors *= (1 - 0.34 * np.exp(-np.sqrt((beyond * beyond).sum(axis=1)) / 0.07))[:, None]
    return colors


def _floor(points: Points) -> Colors:
    """Return oak planks, and a round rug."""
    x, z = points[:, 0], points[:, 2]
    row = np.floor(z / 0.14)
    shifted = x + 0.37 * row
    tone = np.sin(12.9898 * row + 78.233 * np.floor(shifted / 1.1)) * 43758.5453
    tone -= np.floor(tone)
    fibres = noise(np.stack([x / 12, 0 * x, z], axis=1), 0.003)
    grain = 0.5 * np.sin(2 * np.pi * (z / 0.021 + 0.35 * np.sin(x / 0.11 + 9 * tone))) + 0.5 * fibres
    joints = np.minimum(_to_line(z, 0.14), _to_line(shifted, 1.1))
    across, along = x / 1.15, (z - 0.25) / 0.80
    far = np.hypot(across, along)
    dark = (1 - 0.35 * soft(-joints, -0.002, 0.003)) * (1 - 0.25 * np.exp(-np.maximum(far - 1, 0) / 0.02))
    planks = plain((198, 158, 114), (0.90 + 0.16 * tone + 0.035 * grain) * dark)
    rug = plain((214, 202, 184), np.ones(len(x)))
    rug = mixed(rug, (170, 92, 74), near(far - 0.86, 0.035, 0.01))
    rug = mixed(rug, (92, 112, 120), near(far - 0.76, 0.018, 0.01))
    turn = np.arctan2(across, along) * 12 / np.pi % 1.0 - 0.5
    rug = mixed(rug, (170, 92, 74), near(turn, 0.25, 0.05) * near(far - 0.60, 0.05, 0.01))
    return np.where((far < 1)[:, None], rug * (1 + 0.08 * noise(points, 0.012))[:, None], planks)


def _to_line(value: Share, step: float) -> Share:
    """Return the distance to the nearest of lines that are `step` apart, m."""
    return np.abs((value / step + 0.5) % 1.0 - 0.5) * step


def _walls(points: Points) -> Colors:
    """Return plaster over panels, a window on the left, pictures at the back."""
    x, y, z = points.T
    back, left = np.abs(z + SIZE[2] / 2) < FLAT, np.abs(x + SIZE[0] / 2) < FLAT
    colors = plain((238, 224, 202), 0.96 + 0.05 * y / SIZE[1])
    inset = np.minimum(_to_line(np.where(back, x, z), 0.425) - 0.0475, 0.33 - np.abs(y - 0.47))
    colors = mixed(
        colors, plain((172, 186, 174), 1 - 0.10 * near(inset, 0.006, 0.005) + 0.03 * (inset > 0)), soft(-y, -0.86, FLAT)
    )
    colors = mixed(colors, (246, 242, 234), near(y - 0.875, 0.022, FLAT) + soft(0.055 - y, 0, FLAT))
    colors *= (1 - 0.14 * near(y - 0.852, 0.004, FLAT))[:, None]
    colors[left] = _window(colors[left], z[left], y[left])
    for number, (u, v, wide, high) in enumerate(FRAMES):
        some = back & (np.abs(x - u) < wide + 0.04) & (np.abs(y - v) < high + 0.04)
        gap = np.maximum(np.abs(x - u) - wide, np.abs(y - v) - high)[some]
        colors[some] = _framed(number, colors[some], (x[some] - u) / wide, (y[some] - v) / high, gap)
    return colors * (1 + 0.012 * noise(points, 0.02))[:, None]


def _window(colors: Colors, z: Share, y: Share) -> Colors:
    """Return sky and hills behind panes."""
    (low, bottom), (high, top) = WINDOW
    gap = np.maximum(np.maximum(low - z, z - high), np.maximum(bottom - y, y - top))
    share = (y - bottom) / (top - bottom)
    sky = mixed(plain((226, 238, 246), np.ones(len(y))), (150, 196, 232), share)
    sky = mixed(sky, (140, 170, 120), soft(0.22 + 0.06 * np.sin(5 * z) + 0.03 * np.sin(13 * z + 1) - share, 0, 0.02))
    bars = np.minimum(np.abs(z - (low + high) / 2), np.abs(share - 0.62) * (top - bottom))
    sky = mixed(sky, (250, 248, 244), soft(0.022 - np.minimum(bars, -gap), 0, FLAT))
    colors = mixed(colors, (250, 248, 244), soft(0.07 - gap, 0, FLAT))
    colors = mixed(colors, (205, 194, 178), 0.6 * near(gap - 0.07, 0.004, FLAT))
    return mixed(colors, sky, soft(-gap, 0, FLAT))


def _framed(number: int, colors: Colors, u: Share, v: Share, gap: Share) -> Colors:
    """Return one of three pictures at places from -1 to 1, its frame and its shadow on the wall."""
    colors = colors * (1 - 0.22 * np.exp(-np.maximum(gap - 0.012, 0) / 0.012))[:, None]
    inner = plain((246, 242, 232), np.ones(len(u)))
    if number == 0:  # a sun over the sea
        inner = mixed(inner, (226, 122, 82), soft(0.42 - np.hypot(u * 0.8, v - 0.15), 0, 0.02))
        sea = soft(-0.25 + 0.12 * np.sin(4 * u) - v, 0, 0.03) * (np.abs(u) < 0.8) * (v > -0.85)
        inner = mixed(inner, (52, 84, 104), sea)
    elif number == 1:  # hills
        for hill, tone in enumerate(((206, 190, 160), (150, 168, 150), (86, 118, 116), (48, 74, 86))):
            inner = mixed(inner, tone, soft(0.45 - 0.38 * hill + 0.14 * np.sin(3 * u + 2.1 * hill) - v, 0, 0.03))
    else:  # leaves
        wide = 0.55 * np.sqrt(np.clip(1 - (v / 0.8) ** 2, 0, 1)) * (0.6 + 0.4 * np.sin(12 * v))
        inner = mixed(inner, (94, 128, 88), soft(wide - np.abs(u), 0, 0.05) * (np.abs(v) < 0.8))
    wood = ((88, 62, 44), (40, 40, 44), (196, 160, 96))[number]
    return mixed(mixed(colors, wood, soft(0.014 - gap, 0, 0.003)), inner, soft(-gap, 0.004, 0.003))


def _shelf(points: Points) -> Colors:
    """Return white wood, and books in five rows."""
    (left, _, _), (right, top, ahead) = SHELF
    x, y, z = points.T
    row, up = np.floor((y - 0.03) / 0.30), (y - 0.03) % 0.30
    place = (x + 0.013 * np.sin(7 * row)) / 0.042
    seed = np.sin(91.7 * np.floor(place) + 47.3 * row) * 4375.85
    seed -= np.floor(seed)
    spines = BOOKS[(seed * len(BOOKS)).astype(int)] * (1 - 2.4 * np.abs(place % 1.0 - 0.5) ** 3)[:, None]
    spines = mixed(spines, (240, 226, 190), 0.8 * near(up - 0.16, 0.004, 0.003))
    spines = np.where((up < 0.17 + 0.08 * (seed * 37 % 1.0))[:, None], spines, (112.0, 94.0, 78.0))
    inside = (z > ahead - FLAT) & (y < top - 0.02) & (np.abs(x - (left + right) / 2) < (right - left) / 2 - 0.025)
    inside &= (up < 0.28) & (row >= 0)
    colors = plain((236, 228, 214), np.ones(len(x)))
    colors[inside] = (spines * (0.82 + 0.18 * soft(-up, -0.26, 0.1))[:, None])[inside]
    return colors * (0.86 + 0.10 * y / top)[:, None]


def _sofa(points: Points) -> Colors:
    x, y, z = points.T
    dark = 0.30 * spot(y - 0.42, x, 0.02, 9.0) * (z > -1.1) + 0.35 * np.exp(-y / 0.10)
    dark += 0.25 * spot(x - 0.84, y, 0.012, 9.0) * (y > 0.36) * (y < 0.50)  # between its parts
    colors = plain((92, 122, 124), np.ones(len(x)))
    own = (points - CUSHION[0]) / (1.06 * CUSHION[1])
    cushion = (own * own).sum(axis=1) < 1
    colors[cushion] = (218, 158, 74)
    colors[cushion & (np.floor((x + y) / 0.035) % 2 == 0)] = (236, 222, 196)
    return colors * ((1 + 0.07 * noise(points, 0.008)) * (0.93 - dark + 0.14 * np.clip(y, 0, 0.8)))[:, None]


def _plant(points: Points) -> Colors:
    y = points[:, 1]
    leaves = plain((96, 138, 82), 0.62 + 0.38 * np.clip((y - 0.42) / 0.5, 0, 1) + 0.22 * noise(points, 0.03))
    pot = mixed(plain((214, 150, 116), 0.86 + 0.3 * np.clip(y, 0, 0.4)), (244, 232, 214), near(y - 0.26, 0.02, 0.005))
    return np.where((y > 0.40)[:, None], leaves, pot)


def _ball(points: Points) -> Colors:
    own = (points - BALL[0]) / BALL[1]
    wedge = np.floor(np.arctan2(own[:, 0], 0.8 * own[:, 1] + 0.6 * own[:, 2]) / (np.pi / 3))
    colors = np.where((wedge % 2 == 0)[:, None], (222.0, 74.0, 62.0), (246.0, 240.0, 228.0))
    return colors * (0.75 + 0.25 * np.clip(own[:, 1:2], -1, 1))
