"""The core's embedded deformation against the formulas that it computes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from meshreel import _core
from meshreel.analysis.fit.frame import FrameSurface
from meshreel.analysis.follow.embedded_graph import Pose, build_graph, farthest_first
from meshreel.geometry.closest_points import area_samples
from meshreel.geometry.topology import vertex_normals
from meshreel.types import Mesh
from tests.analysis.fit.test_core_fit import bumpy
from tests.analysis.fit.test_surface_fit import ball, sheet, stretched
from tests.analysis.follow.formulas import Graph, deformed, holds, pairs

GATE, RIGIDITY, TORN, PLACE, LEAST, SAMPLES, NODES = 0.08, 0.3, 0.5, 0.01, 0.3, 150, 14


def graph_on(mesh: Mesh) -> Graph:
    samples = area_samples(mesh, SAMPLES)
    graph = build_graph(mesh, farthest_first(mesh, samples, NODES))
    points, bound = mesh.vertices[samples], graph.bind(mesh.vertices[samples], graph.cells[samples])
    held, normals = np.random.default_rng(0).uniform(0.2, 1, len(graph.edges)), vertex_normals(mesh)[samples]
    edges, indices = graph.edges.astype(np.int32), bound.indices.astype(np.int32)
    return Graph(graph.nodes, edges, held, points, normals, indices, bound.weights)


def in_the_core(graph: Graph) -> _core.Deformation:
    return _core.Deformation(*vars(graph).values())


def rounds(count: int) -> tuple[np.ndarray, np.ndarray, float, float, float, float, int]:
    return np.full(count, GATE), np.full(count, RIGIDITY), TORN, PLACE, LEAST, 1e-7, 600


def shaken(graph: Graph, turn: float) -> Pose:
    random, shape = np.random.default_rng(1), graph.nodes.shape
    turns = Rotation.from_rotvec(random.normal(0, turn, shape)).as_matrix()
    return Pose(turns, graph.nodes + random.normal(0, 0.01, shape))


@pytest.mark.parametrize(("mesh", "frame"), [(ball(3), stretched(ball(4))), (sheet(15), bumpy(sheet(21), 1))])
@pytest.mark.parametrize("turn", [0.1, 0.7])  # the second takes nodes to the largest turn of a step
def test_a_round_is_a_gauss_newton_step_on_its_pairs(mesh: Mesh, frame: Mesh, turn: float) -> None:
    graph, there = graph_on(mesh), FrameSurface(frame)
    core, target, pose = in_the_core(graph), there.sampled(SAMPLES), shaken(graph, turn)
    found = pairs(graph, pose, there, SAMPLES, GATE, LEAST)
    assert core.matched(target, pose.rotations, pose.positions, GATE, LEAST) == pytest.approx(found.weights.sum())
    np.testing.assert_allclose(core.holds(pose.rotations, pose.positions, TORN), holds(graph, pose, TORN), rtol=1e-9)
    rotations, positions = core.deform(target, pose.rotations, pose.positions, *rounds(1))
    wanted = deformed(graph, pose, found, RIGIDITY, TORN, PLACE)
    assert max(np.abs(rotations - wanted.rotations).max(), np.abs(positions - wanted.positions).max()) < 2e-6
    assert np.abs(wanted.positions - pose.positions).max() > 0.01


def test_later_rounds_find_the_pairs_that_a_first_one_would() -> None:
    graph, target = graph_on(ball(3)), FrameSurface(stretched(ball(4))).sampled(SAMPLES)
    core, pose = in_the_core(graph), shaken(graph, 0.1)
    twice = core.deform(target, pose.rotations, pose.positions, *rounds(2))
    once = core.deform(target, pose.rotations, pose.positions, *rounds(1))
    again = core.deform(target, *once, *rounds(1))
    assert all(np.array_equal(a, b) for a, b in zip(again, twice, strict=True))


def test_arrays_that_do_not_fit_are_refused() -> None:
    graph, frame = graph_on(ball(2)), FrameSurface(ball(2))
    core, target, pose = in_the_core(graph), frame.sampled(SAMPLES), Pose.at(graph.nodes)
    with pytest.raises(ValueError, match="sizes do not fit"):
        core.deform(target, pose.rotations[1:], pose.positions, *rounds(1))
    with pytest.raises(ValueError, match="sizes do not fit"):
        in_the_core(replace(graph, weights=graph.weights[:, 1:]))
    with pytest.raises(ValueError, match="not finite"):
        core.deform(target, pose.rotations, pose.positions, np.zeros(1), *rounds(1)[1:])
    for wrong in (replace(graph, edges=graph.edges + 999), replace(graph, bound=graph.bound - 1)):
        with pytest.raises(ValueError, match="out of range"):
            in_the_core(wrong).deform(target, pose.rotations, pose.positions, *rounds(1))
