"""Shapes with sharp edges that move rigidly, in metres, 30 frames/s: two gears in mesh, a prism of 10 vertices."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh, MeshList

FRAMES = 24
TEETH = (24, 16)  # of the two gears
MODULE = 0.01  # m: diameter of the pitch circle over the number of teeth
PRESSURE = np.radians(20)  # of the flanks, the usual angle of involute gears
ADDENDUM, DEDENDUM = 1.0, 1.25  # height of a tooth above and below the pitch circle, in modules: the usual ones
BORE, WIDTH = 0.25, 0.04  # radius of the bore over that of the pitch circle; thickness, m
FLANK, RINGS, LAYERS = 8, 12, 6  # points of a flank, of a side face from the bore to the teeth, and of the thickness
TURN = 0.25  # of the first gear's pitch of teeth, in a frame
PRISM_SIDES, PRISM_TURN = 5, np.radians(4)  # a frame


def gears(frames: int = FRAMES) -> MeshList:
    """Return two gears that drive each other: two pieces in contact, but for a hair, of 20k vertices in all."""
    (first, faces), (second, more) = map(_gear, TEETH)
    place = np.array([MODULE * sum(TEETH) / 2, 0.0, 0.0])
    facing = np.pi + np.pi / TEETH[1]  # a gap of the second gear is where a tooth of the first one is
    meshes = []
    for number in range(frames):
        turn = 2 * np.pi * TURN * number  # of a pitch of teeth
        wheels = (first @ _about_z(turn / TEETH[0]).T, second @ _about_z(facing - turn / TEETH[1]).T + place)
        meshes.append(concatenate([Mesh.of(wheels[0], faces), Mesh.of(wheels[1], more)]))
    return MeshList(tuple(meshes))


def prism(frames: int = FRAMES) -> MeshList:
    """Return a five-sided prism of 10 vertices that turns about an axis that is none of its own."""
    n = PRISM_SIDES
    ring = _on_circle(2 * np.pi * np.arange(n) / n)
    vertices = np.concatenate([np.column_stack([ring, np.full(n, z)]) for z in (-1.0, 1.0)])
    at = np.arange(n)
    sides = [(at, (at + 1) % n, at + n), ((at + 1) % n, (at + 1) % n + n, at + n)]
    lid = np.column_stack([np.full(n - 2, 0), at[1:-1], at[2:]])
    faces = np.concatenate([*(np.column_stack(corners) for corners in sides), lid[:, ::-1], lid + n])
    tilted = vertices @ np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]])
    return MeshList(tuple(Mesh.of(tilted @ _about_z(PRISM_TURN * k).T, faces) for k in range(frames)))


def _gear(teeth: int) -> tuple[Float64[np.ndarray, "V 3"], Int64[np.ndarray, "F 3"]]:
    """Return an involute gear about the z axis, with the middle of a tooth at angle 0: a closed grid, as of a torus."""
    outline = _outline(teeth)
    evenly = 2 * np.pi * (np.arange(len(outline)) - FLANK + 0.5) / len(outline)  # 0 between the two points of a tip
    bore = BORE * MODULE * teeth / 2 * _on_circle(evenly)
    shares, heights = np.linspace(0, 1, RINGS), np.linspace(-WIDTH / 2, WIDTH / 2, LAYERS)
    out, up = np.stack([shares, np.full(RINGS, heights[0])], axis=1), np.stack([np.ones(LAYERS), heights], axis=1)
    section = np.concatenate([out, up[1:], (out * (1, -1))[-2::-1], (up * (0, -1))[1:-1]])  # once around, from the bore
    share, height = section[:, 0, None, None], section[:, 1, None]
    ring = bore + share * (outline - bore)
    vertices = np.concatenate([ring, np.broadcast_to(height[..., None], (*ring.shape[:2], 1))], axis=2)
    grid = np.arange(len(section) * len(outline)).reshape(len(section), len(outline))
    right, above = np.roll(grid, -1, axis=1), np.roll(grid, -1, axis=0)
    beyond = np.roll(right, -1, axis=0)
    faces = np.concatenate([np.stack([grid, right, beyond], axis=-1), np.stack([grid, beyond, above], axis=-1)])
    return vertices.reshape(-1, 3), faces.reshape(-1, 3)


def _outline(teeth: int) -> Float64[np.ndarray, "P 2"]:
    """Return the outline of an involute gear, counterclockwise, `2 * FLANK` points a tooth."""
    pitch = MODULE * teeth / 2
    radii = np.linspace(pitch - DEDENDUM * MODULE, pitch + ADDENDUM * MODULE, FLANK)
    steep = np.arccos(np.minimum(pitch * np.cos(PRESSURE) / radii, 1))  # 0 below the base circle: flanks are radial
    at_pitch = np.pi / (2 * teeth) + np.tan(PRESSURE) - PRESSURE
    half = at_pitch - np.tan(steep) + steep  # angle from the middle of a tooth to its flank
    flanks = np.concatenate([np.stack([radii, -half], axis=1), np.stack([radii, half], axis=1)[::-1]])
    middles = 2 * np.pi * np.arange(teeth) / teeth
    radius, angle = np.tile(flanks[:, 0], teeth), (middles[:, None] + flanks[:, 1]).ravel()
    return radius[:, None] * _on_circle(angle)


def _on_circle(angles: Float64[np.ndarray, " P"]) -> Float64[np.ndarray, "P 2"]:
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _about_z(angle: float) -> Float64[np.ndarray, "3 3"]:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
