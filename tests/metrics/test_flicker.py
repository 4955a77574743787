"""Flicker of bodies: motion is none, changed normals are."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from meshreel.metrics.depth import Patch, angles_after_motion
from meshreel.types import Mesh

AXES = np.array([0.3, 0.9, 0.2])  # m, of an ellipsoid like a person


def body(turn=(0.0, 0.0, 0.0), shift=(0.0, 0.0, 0.0), noise=0.0, seed=0):
    """Points of a body, each time others, with normals that are off by `noise` along each axis."""
    random = np.random.default_rng(seed)
    ways = random.standard_normal((20_000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    normals = ways / AXES / np.linalg.norm(ways / AXES, axis=1, keepdims=True)
    normals += noise * random.standard_normal(normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    rotation = Rotation.from_rotvec(turn).as_matrix()
    return Patch(ways * AXES @ rotation.T + shift, normals @ rotation.T)


def rms(before, after):
    """Flicker from a patch to the next, whose surface is a small triangle at each point."""
    across = np.cross(after.normals, [0.31, 0.95, 0.02])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    other = np.cross(after.normals, across)
    corners = [after.points + 1e-4 * (np.cos(a) * across + np.sin(a) * other) for a in np.radians([0, 120, 240])]
    surface = Mesh.of(np.stack(corners, axis=1).reshape(-1, 3), np.arange(3 * len(after.points)).reshape(-1, 3))
    found = angles_after_motion(before, after, surface)
    assert len(found) > 3900
    return np.sqrt(np.mean(found**2))


def test_a_body_that_walks_and_turns_does_not_flicker():
    for motion in ({}, {"shift": (0.12, 0.0, 0.05)}, {"turn": (0.0, 0.2, 0.0), "shift": (0.1, 0.05, 0.0)}):
        assert rms(body(), body(**motion, seed=1)) < 2  # its points are 1 cm apart


def test_an_arm_that_turns_by_itself_does_not_flicker():
    before, after = body(), body(seed=1)
    arm = after.points[:, 1] > 0.3
    after.points[arm] += (0.06, 0.0, 0.03)
    assert rms(before, after) < 4


def test_normals_that_change_flicker_by_as_much():
    found = rms(body(noise=0.1), body(shift=(0.1, 0.0, 0.0), noise=0.1, seed=1))
    assert found == pytest.approx(np.degrees(0.1 * 2), rel=0.1)  # two axes across a normal, in two frames


def test_bodies_apart_and_no_bodies_have_no_flicker():
    nothing = Patch(np.zeros((0, 3)), np.zeros((0, 3)))
    assert (
        len(angles_after_motion(nothing, body(), Mesh.empty()))
        == len(angles_after_motion(body(), nothing, Mesh.empty()))
        == 0
    )
    far = Patch(body().points + (9.0, 0.0, 0.0), body().normals)
    triangle = Mesh.of(np.eye(3), [[0, 1, 2]])
    assert len(angles_after_motion(body(), far, triangle)) == 0
