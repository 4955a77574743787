"""Points spread over a mesh lie on its surface, in equal shares of area, and are the same each time."""

import numpy as np

from meshreel.metrics.surface_samples import scatter
from meshreel.types import Mesh
from tests.metrics.shapes import plane


def test_points_lie_on_the_chosen_faces_in_shares_of_their_area():
    mesh = Mesh.of(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 0, 0], [12, 0, 0], [9, 1, 0]], [[0, 1, 2], [3, 4, 5], [0, 2, 1]]
    )
    found = scatter(mesh, np.array([True, True, False]), 4000)
    assert len(found) == 4000 and found.area == 2.0
    assert np.bincount(found.faces).tolist() == [1000, 3000]
    assert np.allclose(found.barycentric.sum(axis=1), 1) and found.barycentric.min() >= 0
    middle = found.points[found.faces == 0].mean(axis=0)
    assert np.allclose(middle, [1 / 3, 1 / 3, 0], atol=0.01)


def test_a_plane_is_covered_without_gaps():
    found = scatter(plane(cells=1), np.ones(2, bool), 1024)
    cells = np.bincount((found.points[:, 0] * 8).astype(int) * 8 + (found.points[:, 1] * 8).astype(int), minlength=64)
    assert cells.min() >= 8 and cells.max() <= 24  # 16 in each on average


def test_without_area_there_are_no_points():
    flat = Mesh.of(np.zeros((3, 3)), [[0, 1, 2]])
    for mesh, chosen in ((flat, [True]), (Mesh.empty(), []), (plane(), [False] * 200)):
        found = scatter(mesh, np.array(chosen, bool), 10)
        assert len(found) == 0 and found.area == 0
