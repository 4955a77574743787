"""Frames fused into one surface: sheets with holes, borders and noise whose truth is known."""

import numpy as np

from meshreel.analysis.fit.frame import FrameSurface
from meshreel.analysis.follow.embedded_graph import Motion, build_graph, farthest_first
from meshreel.analysis.follow.template import fused_mesh
from meshreel.geometry.closest_points import Surface, area_samples
from meshreel.geometry.topology import clean
from meshreel.types import Mesh
from tests.metrics.shapes import moved, plane

SIDE, CELLS = 0.5, 40  # of the sheet
HOLE = 0.06  # half a hole's side


def sheet(height: float = 0.0) -> Mesh:
    """A gently curved square, open all round."""
    flat = moved(plane(SIDE, CELLS, height), (-SIDE / 2, -SIDE / 2, 0))
    return Mesh.of(flat.vertices + 0.5 * flat.vertices[:, :1] ** 2 * (0, 0, 1), flat.faces)


def with_hole(mesh: Mesh, x: float, y: float, half: float = HOLE) -> Mesh:
    middles = mesh.vertices[mesh.faces].mean(axis=1)[:, :2]
    return clean(Mesh(mesh.vertices, mesh.faces[(np.abs(middles - (x, y)) > half).any(axis=1)]))


def noisy(mesh: Mesh, deviation: float, seed: int) -> Mesh:
    away = np.random.default_rng(seed).normal(0, deviation, len(mesh.vertices))
    return Mesh(mesh.vertices + away[:, None] * (0, 0, 1.0), mesh.faces)


def moving(key: Mesh, count: int, turn: float = 0.1) -> Motion:
    """The key goes up by .05 a frame and turns about the axis z: rotations and places of its nodes."""
    graph = build_graph(key, farthest_first(key, area_samples(key, 500), 60))
    angles = turn * np.arange(count)
    zero, one = np.zeros(count), np.ones(count)
    c, s = np.cos(angles), np.sin(angles)
    turns = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=1).reshape(count, 3, 3)
    rotations = np.repeat(turns[:, None], len(graph.nodes), axis=1)
    places = np.einsum("tij,nj->tni", turns, graph.nodes) + 0.05 * np.arange(count)[:, None, None] * (0, 0, 1.0)
    return Motion(key, graph, rotations, places, zero)


def carried(frames: list[Mesh], motion: Motion) -> list[FrameSurface]:
    """Frames given in the key's pose, moved as the motion says."""
    turns, lifts = motion.rotations[:, 0], 0.05 * np.arange(len(frames))
    meshes = (
        Mesh(f.vertices @ turn.T + (0, 0, lift), f.faces) for f, turn, lift in zip(frames, turns, lifts, strict=True)
    )
    return [FrameSurface(mesh) for mesh in meshes]


def holey(count: int) -> list[Mesh]:
    return [with_hole(sheet(), x, 0.05) for x in np.linspace(-0.15, 0.15, count)]


def gaps(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(Surface(mesh).closest(points).points - points, axis=1))


def test_a_mesh_that_was_moved_goes_back_exactly() -> None:
    key = sheet()
    motion = moving(key, 3)
    frame = carried([key] * 3, motion)[2].mesh
    np.testing.assert_allclose(motion.back(2, frame).vertices, key.vertices, atol=1e-9)


def test_faces_that_the_motion_tears_apart_are_left_out() -> None:
    key = sheet()
    motion = moving(key, 1)
    away = motion.graph.nodes[:, 0] > 0.4 * SIDE / 2
    motion.positions[0, away] += (0.1, 0, 0)  # though the sheet rests
    back = motion.back(0, key)
    longest = np.linalg.norm(back.vertices[back.faces] - back.vertices[np.roll(back.faces, 1, axis=1)], axis=2).max()
    assert longest < 2.01 * np.sqrt(2) * SIDE / CELLS * 1.1
    assert 0.7 < len(back.faces) / len(key.faces) < 0.99


def test_a_hole_that_moves_over_time_is_closed() -> None:
    frames = holey(6)
    motion = moving(frames[0], 6)
    fused = fused_mesh(motion, carried(frames, motion), 0.001)
    assert gaps(frames[0], sheet().vertices).max() > 0.8 * HOLE
    inner = sheet().vertices[np.abs(sheet().vertices[:, :2]).max(axis=1) < 0.45 * SIDE]
    assert gaps(fused, inner).max() < 0.003


def test_a_border_that_is_always_open_stays_where_it_is() -> None:
    frames = [sheet()] * 5
    motion = moving(frames[0], 5)
    fused = fused_mesh(motion, carried(frames, motion), 0.001)
    spacing = SIDE / CELLS
    assert np.abs(fused.vertices[:, :2]).max() < SIDE / 2 + spacing
    assert gaps(fused, sheet().vertices).max() < spacing


def test_a_hole_that_is_always_there_stays_open() -> None:
    frames = [with_hole(sheet(), 0.0, 0.0)] * 5
    motion = moving(frames[0], 5)
    fused = fused_mesh(motion, carried(frames, motion), 0.001)
    assert gaps(fused, np.array([[0.0, 0.0, 0.0]]))[0] > 0.5 * HOLE


def test_surface_that_only_one_frame_has_is_left_out() -> None:
    frames = [with_hole(sheet(), 0.0, 0.0), *[with_hole(sheet(), 0.0, 0.0)] * 6, sheet()]
    motion = moving(frames[0], 8)
    fused = fused_mesh(motion, carried(frames, motion), 0.001)
    assert gaps(fused, np.array([[0.0, 0.0, 0.0]]))[0] > 0.5 * HOLE


def test_noise_averages_out_by_the_root_of_the_number_of_frames() -> None:
    deviation, left = 0.004, {}
    for count in (4, 16, 64):
        frames = [noisy(sheet(), deviation, seed) for seed in range(count)]
        motion = moving(frames[0], count, 0.0)
        fused = fused_mesh(motion, carried(frames, motion), deviation)
        inner = np.abs(fused.vertices[:, :2]).max(axis=1) < 0.4 * SIDE
        left[count] = float(np.sqrt(np.mean(gaps(sheet(), fused.vertices[inner]) ** 2)))
    assert left[4] < deviation / 1.6
    assert 1.5 < left[4] / left[16] < 2.6
    assert 1.4 < left[16] / left[64] < 2.6


def test_frames_without_surface_in_common_give_the_empty_mesh() -> None:
    frames = [Mesh(sheet().vertices + (3.0 * n, 0, 0), sheet().faces) for n in range(3)]
    motion = moving(sheet(), 3, 0.0)
    assert fused_mesh(motion, carried(frames, motion), 0.001).is_empty
