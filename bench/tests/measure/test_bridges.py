"""Bridges and slivers: triangles that should not be."""

from __future__ import annotations

import numpy as np
from meshreel_bench.measure.metrics import count_bridges, count_degenerate

from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh
from tests.spheres import sliding_sphere

BALL = sliding_sphere(1, levels=2)[0]
TWO = concatenate([BALL, Mesh.of(BALL.vertices + (3.0, 0, 0), BALL.faces)])


def test_a_triangle_that_joins_two_bodies_is_a_bridge():
    count = len(BALL.vertices)
    joined = Mesh.of(TWO.vertices, np.concatenate([TWO.faces, [[0, 1, count]]]))
    assert count_bridges(TWO, TWO) == 0 and count_bridges(TWO, joined) == 1 and count_bridges(BALL, BALL) == 0


def test_a_triangle_without_area_is_counted():
    flat = Mesh.of(BALL.vertices, np.concatenate([BALL.faces, [[0, 0, 1]]]))
    assert count_degenerate(BALL) == 0 and count_degenerate(flat) == 1
