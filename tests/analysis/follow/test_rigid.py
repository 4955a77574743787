"""Rigid bodies: a box that turns is found again under noise, an arm that bends is not taken for one."""

import numpy as np
import pytest

from meshreel.analysis.fit.frame import FrameSurface
from meshreel.analysis.follow.rigid import RigidBody, RigidMotion
from meshreel.capture.simulated.demo_room import box
from meshreel.geometry.strict import rotations_of
from meshreel.geometry.topology import concatenate, subdivide_midpoint
from meshreel.types import Mesh

NOISE = 0.003
STILL = RigidMotion(np.eye(3), np.zeros(3))
BOX = subdivide_midpoint(box(((-0.4, -0.25, -0.05), (0.4, 0.25, 0.05))), 4)


def turn(degrees: float) -> np.ndarray:
    half = np.radians(degrees) / 2
    return rotations_of(np.array([[np.cos(half), 0.0, np.sin(half), 0.0]]))[0]


def seen(mesh: Mesh, seed: int) -> FrameSurface:
    """The mesh as noise leaves it."""
    return FrameSurface(
        Mesh(mesh.vertices + np.random.default_rng(seed).normal(0, NOISE, mesh.vertices.shape), mesh.faces)
    )


@pytest.mark.parametrize("degrees, shift", [(0.0, 0.0), (4.0, 0.02), (6.0, 0.03)])
def test_a_box_that_moves_is_found_where_it_is(degrees, shift):
    true = RigidMotion(turn(degrees), np.array([shift, 0.0, shift]))
    frame = seen(Mesh(true.of(BOX.vertices), BOX.faces), 1)
    body = RigidBody(seen(BOX, 0).mesh, NOISE)
    found = body.brought(frame, STILL)
    assert np.abs(found.of(BOX.vertices) - true.of(BOX.vertices)).max() < NOISE
    assert body.holds(frame, found, found.of(BOX.vertices), NOISE)


def test_a_body_noisier_than_told_is_rigid_where_bending_leaves_hardly_less():
    frame, body = seen(BOX, 1), RigidBody(seen(BOX, 0).mesh, NOISE / 2)
    motion = body.brought(frame, STILL)
    left, _, _ = body.residual(frame, motion)
    assert body.holds(frame, motion, motion.of(BOX.vertices), left / 1.2)
    assert not body.holds(frame, motion, motion.of(BOX.vertices), left / 2.5)


def test_a_plate_that_bends_is_no_rigid_body():
    bent = BOX.vertices + [0.0, 0.0, 0.1] * np.maximum(BOX.vertices[:, :1], 0) ** 2 / 0.16
    frame, body = seen(Mesh(bent, BOX.faces), 1), RigidBody(seen(BOX, 0).mesh, NOISE)
    motion = body.brought(frame, STILL)
    assert not body.holds(frame, motion, bent, NOISE)


def test_a_rod_that_swings_is_no_part_of_a_rigid_body_and_one_that_is_hidden_is():
    rod = subdivide_midpoint(box(((0.4, -0.02, -0.02), (0.9, 0.02, 0.02))), 4)
    swung = (rod.vertices - [0.4, 0.0, 0.0]) @ turn(80).T + [0.4, 0.0, 0.0]
    key, frame = concatenate([BOX, rod]), seen(concatenate([BOX, Mesh(swung, rod.faces)]), 1)
    body = RigidBody(seen(key, 0).mesh, NOISE)
    motion = body.brought(frame, STILL)
    assert not body.holds(frame, motion, np.concatenate([BOX.vertices, swung]), NOISE)
    assert body.holds(seen(BOX, 1), motion, motion.of(key.vertices), NOISE)


def test_a_body_far_from_a_frame_does_not_hold():
    away = Mesh(BOX.vertices + [5.0, 0, 0], BOX.faces)
    body = RigidBody(BOX, NOISE)
    assert not body.holds(FrameSurface(away), body.brought(FrameSurface(away), STILL), away.vertices, NOISE)
