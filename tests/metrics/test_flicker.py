"""Flicker of bodies: rigid motion is none, changed normals are, and of simulations what the truth does is taken off."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from meshreel.metrics.flicker import Patch, turned

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


def rms(found):
    return np.sqrt(np.mean(found**2))


def test_a_body_that_walks_and_turns_does_not_flicker():
    for motion in ({}, {"shift": (0.12, 0.0, 0.05)}, {"turn": (0.0, 0.2, 0.0), "shift": (0.1, 0.05, 0.0)}):
        found = turned(body(), body(**motion, seed=1))
        assert len(found) > 3900 and rms(found) < 2  # its points are 1 cm apart


def test_an_arm_that_turns_by_itself_does_not_flicker():
    before, after = body(), body(seed=1)
    arm = after.points[:, 1] > 0.3
    after.points[arm] += (0.06, 0.0, 0.03)
    assert rms(turned(before, after)) < 4


def test_normals_that_change_flicker_by_as_much():
    found = turned(body(noise=0.1), body(shift=(0.1, 0.0, 0.0), noise=0.1, seed=1))
    assert rms(found) == pytest.approx(np.degrees(0.1 * 2), rel=0.1)  # two axes across a normal, in two frames


def test_bodies_apart_and_no_bodies_have_no_flicker():
    nothing = Patch(np.zeros((0, 3)), np.zeros((0, 3)))
    assert len(turned(nothing, body())) == len(turned(body(), nothing)) == 0
    assert len(turned(body(), body(shift=(9.0, 0.0, 0.0)))) == 0
