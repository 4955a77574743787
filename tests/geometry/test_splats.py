"""Splats on a mesh: they stay where they are on finer meshes, follow the mesh, and vanish with their face."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.geometry.splats import Carrier, bind
from meshreel.geometry.topology import subdivide_midpoint
from tests.metrics.shapes import sphere
from tests.splats import some_splats

BALL = sphere(levels=1)
SPLATS = some_splats(200, len(BALL.faces))


def carrier(levels: int) -> Carrier:
    fine = subdivide_midpoint(BALL, levels)
    return Carrier(fine.vertices, fine.faces, levels)


@pytest.mark.parametrize("levels", [1, 2, 4])
def test_a_subdivision_moves_no_splat_and_turns_none(levels: int) -> None:
    coarse, fine = bind(SPLATS, carrier(0)), bind(SPLATS, carrier(levels))
    np.testing.assert_allclose(fine.means, coarse.means, atol=1e-12)
    alike = np.abs(np.einsum("nkd,nkd->nk", fine.axes, coarse.axes))  # half a turn is no turn of a Gaussian
    np.testing.assert_allclose(alike, 1, atol=1e-9)


def test_splats_move_with_their_mesh() -> None:
    turn, still = np.linalg.qr(np.array([[0.3, 1.0, 0.2], [0.5, -0.2, 0.1], [0.1, 0.4, 0.9]]))[0], carrier(2)
    turn = turn * np.linalg.det(turn)
    moved = replace(still, vertices=2 * still.vertices @ turn.T + [1.0, 2.0, 3.0], unit=2.0)
    before, after = bind(SPLATS, still), bind(SPLATS, moved)
    np.testing.assert_allclose(after.means, 2 * before.means @ turn.T + [1.0, 2.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(after.axes, before.axes @ turn.T, atol=1e-12)
    np.testing.assert_allclose(after.scales, 2 * before.scales)


def test_axes_are_right_handed_and_the_last_is_the_normal() -> None:
    found = bind(SPLATS, carrier(1))
    np.testing.assert_allclose(np.linalg.det(found.axes), 1)
    outward = np.einsum("nd,nd->n", found.axes[:, 2], found.means) / np.linalg.norm(found.means, axis=1)
    assert outward.min() > 0.8
    assert (found.scales[:, 2] < found.scales[:, 1]).all()


def test_a_splat_is_transparent_where_the_frame_lacks_its_face() -> None:
    whole = carrier(0)
    lacking = np.zeros(len(BALL.faces), bool)
    lacking[SPLATS.faces[7]] = True
    found = bind(SPLATS, replace(whole, lacking=lacking))
    gone = SPLATS.faces == SPLATS.faces[7]
    assert (found.opacities[gone] == 0).all()
    np.testing.assert_array_equal(found.opacities[~gone], SPLATS.opacities[~gone])


def test_a_splat_is_transparent_on_a_face_without_area() -> None:
    flat = replace(carrier(0), vertices=np.zeros_like(BALL.vertices))
    found = bind(SPLATS, flat)
    assert not found.opacities.any() and np.isfinite(found.means).all()
