"""The room of the demo: three walls, a floor of oak, a sofa, shelves, a plant and a ball, and their colours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...types import Mesh
from .demo_room import _joined, _panel, box
from .dress import mixed, soft
from .sculpture import ball, block, meshed, rod
from .solid_colors import Colors, Points, _noise

SIZE = (3.4, 2.25, 2.8)  # m; the origin is the middle of the floor (guess)
WINDOW = ((-0.55, 0.95), (0.75, 1.95))  # m, z and y of the left wall (guess)
FRAMES = ((0.30, 1.30, 0.17, 0.22), (0.78, 1.36, 0.20, 0.15), (1.22, 1.28, 0.14, 0.18))  # m: x, y and half sides, back wall
SHELF = ((-1.62, 0.0, -1.38), (-0.92, 1.55, -1.08))
BALL = ((1.22, 0.12, 0.85), 0.12)


@dataclass(frozen=True, slots=True)
class Thing:
    """Still surface and its colours."""

    mesh: Mesh
    paint: Callable[[Points], Colors]


def things() -> list[Thing]:
    """Return the room and what stands in it."""
    x, y, z = SIZE[0] / 2, SIZE[1], SIZE[2] / 2
    panels = [
        _panel((-x, 0, z), (2 * x, 0, 0), (0, 0, -2 * z)),
        _panel((-x, 0, -z), (2 * x, 0, 0), (0, y, 0)),
        _panel((-x, 0, z), (0, 0, -2 * z), (0, y, 0)),
        _panel((x, 0, -z), (0, 0, 2 * z), (0, y, 0)),
    ]
    sofa = [
        block((0.12, 0.10, -1.36), (1.56, 0.40, -0.62), 0.05, 0.01),
        block((0.12, 0.10, -1.36), (1.56, 0.82, -1.14), 0.07, 0.01),
        block((0.08, 0.08, -1.36), (0.28, 0.60, -0.60), 0.07, 0.01),
        block((1.40, 0.08, -1.36), (1.60, 0.60, -0.60), 0.07, 0.01),
        block((0.29, 0.36, -1.18), (0.835, 0.49, -0.60), 0.045, 0.004),
        block((0.845, 0.36, -1.18), (1.39, 0.49, -0.60), 0.045, 0.004),
        ball((0.43, 0.66, -1.06), (0.19, 0.17, 0.09), 0.004),
    ]
    plant = [rod((-1.42, 0.10, 0.98), (-1.42, 0.30, 0.98), (0.13, 0.16), 0.01)]
    random = np.random.default_rng(3)
    for _ in range(16):
        at = random.normal(size=3)
        at *= 0.21 / np.sqrt((at * at).sum())
        plant.append(ball(np.array([-1.42, 0.72, 0.98]) + at * (0.85, 1.15, 0.85), (0.13, 0.11, 0.13), 0.02))
    plant.append(rod((-1.42, 0.3, 0.98), (-1.42, 0.6, 0.98), (0.03, 0.03), 0.03))
    toy = [ball(BALL[0], (BALL[1],) * 3, 0.0)]
    return [
        Thing(_joined(panels), room_paint),
        Thing(box(SHELF), shelf_paint),
        Thing(meshed(sofa, 0.02, 5000), sofa_paint),
        Thing(meshed(plant, 0.02, 3000), plant_paint),
        Thing(meshed(toy, 0.02, 800), toy_paint),
    ]


def room_paint(points: Points) -> Colors:
    """Return the colours of floor and walls, darker where light hardly comes to."""
    x, y, z = points.T
    half = np.array([SIZE[0] / 2, SIZE[2] / 2])
    colors = wall_paint(points)
    floor = y < 0.004
    colors[floor] = floor_paint(points[floor])
    gaps = np.stack([np.where(floor, 9.0, y), np.where(np.abs(x - half[0]) < 0.004, 9.0, half[0] - x), np.where(np.abs(x + half[0]) < 0.004, 9.0, half[0] + x), np.where(np.abs(z + half[1]) < 0.004, 9.0, half[1] + z)], axis=1)
    colors *= (1 - 0.16 * np.exp(-gaps / 0.20)).prod(axis=1)[:, None]
    low, high = np.array([SHELF[0], (0.08, 0.0, -1.36), (-1.55, 0, 0.85), (1.13, 0, 0.76)]), np.array([SHELF[1], (1.60, 0.82, -0.60), (-1.29, 0.3, 1.11), (1.31, 0.05, 0.94)])
    for first, last in zip(low, high, strict=True):
        gap = np.sqrt((np.maximum(np.maximum(first - points, points - last), 0) ** 2).sum(axis=1))
        colors *= (1 - 0.34 * np.exp(-gap / 0.07))[:, None]
    return colors


def floor_paint(points: Points) -> Colors:
    """Return oak planks, and a rug."""
    x, z = points[:, 0], points[:, 2]
    row = np.floor(z / 0.14)
    shifted = x + 0.37 * row
    plank = np.floor(shifted / 1.1)
    tone = np.sin(12.9898 * row + 78.233 * plank) * 43758.5453
    tone = tone - np.floor(tone)
    grain = 0.5 * np.sin(2 * np.pi * (z / 0.021 + 0.35 * np.sin(x / 0.11 + 9 * tone))) + 0.5 * _noise(np.stack([x / 12, x * 0, z], axis=1), 0.003)
    colors = np.array([198.0, 158.0, 114.0]) * (0.90 + 0.16 * tone + 0.035 * grain)[:, None]
    seam = np.minimum(np.abs((z / 0.14 + 0.5) % 1.0 - 0.5) * 0.14, np.abs((shifted / 1.1 + 0.5) % 1.0 - 0.5) * 1.1)
    colors *= (1 - 0.35 * soft(-seam, -0.002, 0.003))[:, None]
    far = np.hypot(x / 1.15, (z - 0.25) / 0.80)
    rug = mixed(np.repeat(np.array([[214.0, 202.0, 184.0]]), len(x), axis=0), (170, 92, 74), soft(0.035 - np.abs(far - 0.86), 0, 0.01))
    rug = mixed(rug, (92, 112, 120), soft(0.018 - np.abs(far - 0.76), 0, 0.01))
    rug = mixed(rug, (170, 92, 74), soft(0.25 - np.abs((np.arctan2(x / 1.15, (z - 0.25) / 0.8) * 12 / np.pi) % 1.0 - 0.5), 0, 0.05) * soft(0.05 - np.abs(far - 0.60), 0, 0.01))
    rug *= (1 + 0.08 * _noise(points, 0.012))[:, None]
    colors *= (1 - 0.25 * np.exp(-np.maximum(far - 1, 0) / 0.02))[:, None]
    return np.where((far < 1)[:, None], rug, colors)


def wall_paint(points: Points) -> Colors:
    """Return plaster over panels, a window on the left, pictures at the back."""
    x, y, z = points.T
    colors = np.repeat(np.array([[238.0, 224.0, 202.0]]), len(x), axis=0) * (0.96 + 0.05 * y / SIZE[1])[:, None]
    back = np.abs(z + SIZE[2] / 2) < 0.004
    across = np.where(back, x, z)
    panel = np.abs((across / 0.425) % 1.0 - 0.5) * 0.425
    lower = np.repeat(np.array([[172.0, 186.0, 174.0]]), len(x), axis=0)
    inset = np.minimum(0.165 - panel, 0.36 - np.abs(y - 0.47) - 0.03)
    lower *= (1 - 0.10 * soft(0.006 - np.abs(inset), 0, 0.005) + 0.03 * (inset > 0))[:, None]
    colors = mixed(colors, lower, soft(-y, -0.86, 0.004))
    colors = mixed(colors, (246, 242, 234), soft(0.022 - np.abs(y - 0.875), 0, 0.004) + soft(0.055 - y, 0, 0.004))
    colors *= (1 - 0.14 * soft(0.004 - np.abs(y - 0.852), 0, 0.004))[:, None]
    left = np.abs(x + SIZE[0] / 2) < 0.004
    colors[left] = window_paint(colors[left], z[left], y[left])
    for number, (u, v, wide, high) in enumerate(FRAMES):
        some = back & (np.abs(x - u) < wide + 0.04) & (np.abs(y - v - 0.1) < high + 0.04)
        colors[some] = picture_paint(number, colors[some], (x[some] - u) / wide, (y[some] - v - 0.1) / high, wide, high)
    return colors * (1 + 0.012 * _noise(points, 0.02))[:, None]


def window_paint(colors: Colors, z: np.ndarray, y: np.ndarray) -> Colors:
    (low, high), (bottom, top) = WINDOW
    bottom, top = bottom + 0.25, top + 0.05
    gap = np.maximum(np.maximum(low - z, z - high), np.maximum(bottom - y, y - top))
    share = (y - bottom) / (top - bottom)
    sky = mixed(np.repeat(np.array([[226.0, 238.0, 246.0]]), len(y), axis=0), (150, 196, 232), share)
    hills = soft(0.22 + 0.06 * np.sin(5 * z) + 0.03 * np.sin(13 * z + 1) - share, 0, 0.02)
    sky = mixed(sky, (140, 170, 120), hills)
    bar = np.minimum(np.minimum(np.abs(z - (low + high) / 2), np.abs(y - bottom - 0.62 * (top - bottom))), -gap)
    sky = mixed(sky, (250, 248, 244), soft(0.022 - bar, 0, 0.004))
    colors = mixed(colors, (250, 248, 244), soft(0.07 - gap, 0, 0.004))
    colors = mixed(colors, (205, 194, 178), 0.6 * soft(0.004 - np.abs(gap - 0.07), 0, 0.004))
    return mixed(colors, sky, soft(-gap, 0, 0.004))


def picture_paint(number: int, colors: Colors, u: np.ndarray, v: np.ndarray, wide: float, high: float) -> Colors:
    gap = np.maximum((np.abs(u) - 1) * wide, (np.abs(v) - 1) * high)
    frame = ((88, 62, 44), (40, 40, 44), (196, 160, 96))[number]
    colors = colors * (1 - 0.22 * np.exp(-np.maximum(gap - 0.012, 0) / 0.012))[:, None]
    inner = np.repeat(np.array([[246.0, 242.0, 232.0]]), len(u), axis=0)
    if number == 0:
        inner = mixed(inner, (226, 122, 82), soft(0.42 - np.hypot(u * 0.8, v - 0.15), 0, 0.02))
        inner = mixed(inner, (52, 84, 104), soft(-0.25 + 0.12 * np.sin(4 * u) - v, 0, 0.03) * (np.abs(u) < 0.8) * (v > -0.85))
    elif number == 1:
        for k, tone in enumerate(((206, 190, 160), (150, 168, 150), (86, 118, 116), (48, 74, 86))):
            inner = mixed(inner, tone, soft(0.45 - 0.38 * k + 0.14 * np.sin(3 * u + 2.1 * k) - v, 0, 0.03))
    else:
        leaf = np.abs(u) - 0.55 * np.sqrt(np.clip(1 - (v / 0.8) ** 2, 0, 1)) * (0.6 + 0.4 * np.sin(12 * v))
        inner = mixed(inner, (94, 128, 88), soft(-leaf, 0, 0.05) * (np.abs(v) < 0.8))
    colors = mixed(colors, frame, soft(0.014 - gap, 0, 0.003))
    return mixed(colors, inner, soft(-gap, 0.004, 0.003))


def shelf_paint(points: Points) -> Colors:
    """Return white wood, and books in five rows."""
    x, y, z = points.T
    colors = np.repeat(np.array([[236.0, 228.0, 214.0]]), len(x), axis=0)
    front = (z > SHELF[1][2] - 0.004) & (y < SHELF[1][1] - 0.02)
    tall, side = 0.30, 0.025
    row, up = np.floor((y - 0.03) / tall), (y - 0.03) % tall
    book = np.floor((x + 0.013 * np.sin(7 * row)) / 0.042)
    seed = np.sin(91.7 * book + 47.3 * row) * 4375.85
    seed -= np.floor(seed)
    palette = np.array([[176, 74, 60], [54, 84, 110], [214, 170, 88], [96, 124, 98], [226, 214, 192], [120, 72, 84], [70, 110, 120]], float)
    spine = palette[np.minimum((seed * 7).astype(int), 6)]
    edge = np.abs(((x + 0.013 * np.sin(7 * row)) / 0.042) % 1.0 - 0.5)
    spine = spine * (1 - 0.5 * edge**3 * 8 * 0.6)[:, None]
    spine = mixed(spine, (240, 226, 190), 0.8 * soft(0.004 - np.abs(up - 0.16), 0, 0.003))
    top = 0.17 + 0.08 * (seed * 37 % 1.0)
    inside = front & (x > SHELF[0][0] + side) & (x < SHELF[1][0] - side) & (up < tall - 0.02) & (row >= 0)
    recess = np.repeat(np.array([[112.0, 94.0, 78.0]]), len(x), axis=0)
    content = np.where((up < top)[:, None], spine, recess)
    colors = np.where(inside[:, None], content * (0.82 + 0.18 * soft(-up, -0.26, 0.1))[:, None], colors)
    return colors * (0.86 + 0.10 * np.clip(y, 0, 1.5) / 1.5)[:, None]


def sofa_paint(points: Points) -> Colors:
    x, y, z = points.T
    weave = 1 + 0.07 * _noise(points, 0.008)
    colors = np.repeat(np.array([[92.0, 122.0, 124.0]]), len(x), axis=0)
    pillow = ((x - 0.43) / 0.20) ** 2 + ((y - 0.66) / 0.18) ** 2 + ((z + 1.06) / 0.10) ** 2 < 1
    colors[pillow] = (218, 158, 74)
    colors[pillow & (np.floor((x + y) / 0.035) % 2 == 0)] = (236, 222, 196)
    dark = 0.30 * np.exp(-np.abs(y - 0.42) / 0.02) * (z > -1.1) + 0.35 * np.exp(-y / 0.10) + 0.25 * np.exp(-np.abs(x - 0.84) / 0.012) * (y > 0.36) * (y < 0.50)
    return colors * (weave * (0.93 - dark + 0.14 * np.clip(y, 0, 0.8)))[:, None]


def plant_paint(points: Points) -> Colors:
    y = points[:, 1]
    leaves = np.array([96.0, 138.0, 82.0]) * (0.62 + 0.38 * np.clip((y - 0.42) / 0.5, 0, 1) + 0.22 * _noise(points, 0.03))[:, None]
    pot = np.array([214.0, 150.0, 116.0]) * (0.86 + 0.3 * np.clip(y, 0, 0.4))[:, None]
    pot = mixed(pot, (244, 232, 214), soft(0.02 - np.abs(y - 0.26), 0, 0.005))
    return np.where((y > 0.40)[:, None], leaves, pot)


def toy_paint(points: Points) -> Colors:
    own = points - BALL[0]
    around = np.floor(np.arctan2(own[:, 0], own[:, 1] * 0.8 + own[:, 2] * 0.6) / (np.pi / 3))
    colors = np.where((around % 2 == 0)[:, None], (222.0, 74.0, 62.0), (246.0, 240.0, 228.0))
    return colors * (0.75 + 0.25 * np.clip(own[:, 1:2] / BALL[1], -1, 1))
