"""Procedural shapes: closed pieces that move rigidly, and gears whose teeth fit."""

from __future__ import annotations

import numpy as np
import pytest
from meshreel_bench.datasets import SHAPES, Store
from meshreel_bench.datasets.remesh import MODULE, TEETH, gears, prism

from meshreel.analysis.survey import bodies_of, pieces_of
from meshreel.geometry.closest_points import distances
from meshreel.geometry.inside import winding_inside
from meshreel.geometry.topology import border_edges, components, face_normals
from meshreel.types import Mesh


def pieces(mesh):
    """The pieces of a mesh, each alone."""
    label = components(mesh.faces, len(mesh.vertices))
    starts = np.cumsum(np.bincount(label)) - np.bincount(label)
    return [
        Mesh.of(mesh.vertices[label == k], mesh.faces[label[mesh.faces[:, 0]] == k] - s) for k, s in enumerate(starts)
    ]


def volume(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return np.einsum("nd,nd->", a, np.cross(b, c)) / 6


@pytest.mark.parametrize(("make", "count"), [(gears, 2), (prism, 1)])
def test_pieces_are_closed_and_move_rigidly_on_one_connectivity(make, count):
    first, *others = map(pieces, make(3))
    assert len(first) == count
    for piece in first:
        assert not len(border_edges(piece)) and volume(piece) > 0 and face_normals(piece)[1].min() > 0
    for before, after in ((a, b) for other in others for a, b in zip(first, other, strict=True)):
        assert np.array_equal(before.faces, after.faces) and not np.allclose(before.vertices, after.vertices)
        some = np.arange(0, len(before.vertices), 7)
        apart = [np.linalg.norm(m.vertices[some] - m.vertices[some[0]], axis=1) for m in (before, after)]
        assert np.allclose(*apart, atol=1e-12)


@pytest.mark.parametrize("frame", range(5))  # a pitch of teeth
def test_gears_touch_at_every_angle_and_never_cut_each_other(frame):
    one, other = pieces(gears(frame + 1)[frame])
    assert distances(one.vertices, other).min() < 0.01 * MODULE
    assert not winding_inside(other, one.vertices).any() and not winding_inside(one, other.vertices).any()
    assert sum(len(piece.vertices) for piece in (one, other)) == sum(TEETH) * 512


def test_each_gear_is_a_body_that_is_coded_apart():
    found = bodies_of([pieces_of(mesh) for mesh in gears(3)])
    assert found is not None and [body.tolist() for body in found] == [[0, 1]] * 3


def test_shapes_are_sequences_by_name_without_data(tmp_path):
    store = Store(tmp_path / "none")
    assert [len(store.open(name).sequence) for name in SHAPES] == [24, 24]
    assert len(store.open("prism", 3).sequence[0].vertices) == 10 and store.digest("gears") is None
