"""Embedded deformation against motions with known answers."""

import numpy as np

from meshreel.analysis.fit.frame import FrameSurface
from meshreel.analysis.follow.embedded import EmbeddedOptions, Stage, Tracker
from meshreel.analysis.follow.embedded_graph import Motion, Pose
from meshreel.analysis.follow.embedded_graph import moved as moved_by
from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.geometry.topology import concatenate, drop_unreferenced, face_normals
from meshreel.types import Mesh
from tests.analysis.fit.test_surface_fit import ball, sheet

SMALL = EmbeddedOptions(
    coarse=Stage(40, (0.1, 0.08, 0.06, 0.045, 0.03), (10.0, 3.0, 1.0, 0.5, 0.2)),
    fine=Stage(150, (0.024, 0.018, 0.012, 0.012), (0.3, 0.1, 0.1, 0.05)),
    samples=1500,
)
AXES = np.array([0.3, 0.12, 0.18])
RADIUS, LENGTH, SIDES = 0.03, 0.4, 24


def ellipsoid(levels: int = 4) -> Mesh:
    mesh = ball(levels, 1.0)
    return Mesh(mesh.vertices * AXES, mesh.faces)


def shuffled(mesh: Mesh, seed: int) -> Mesh:
    order = np.random.default_rng(seed).permutation(len(mesh.vertices))
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return Mesh.of(mesh.vertices[order], rank[mesh.faces])


def turn(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def tube(path: np.ndarray) -> Mesh:
    """A closed tube around a path in the plane z = 0, with a tip at each end."""
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    side = along @ turn(np.pi / 2).T
    angles = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
    around = np.cos(angles)[None, :, None] * side[:, None] + np.sin(angles)[None, :, None] * np.array([0, 0, 1.0])
    rings = len(path)
    tips = [path[0] - RADIUS * along[0], path[-1] + RADIUS * along[-1]]
    vertices = np.concatenate([(path[:, None] + RADIUS * around).reshape(-1, 3), tips])
    i = np.arange(SIDES)
    j = (i + 1) % SIDES
    faces = [np.stack([s + i, s + SIDES + i, s + j], axis=1) for s in SIDES * np.arange(rings - 1)]
    faces += [np.stack([s + j, s + SIDES + i, s + SIDES + j], axis=1) for s in SIDES * np.arange(rings - 1)]
    first, last = SIDES * rings, SIDES * (rings - 1)
    faces += [np.stack([i, j, np.full(SIDES, first)], axis=1)]
    faces += [np.stack([last + j, last + i, np.full(SIDES, first + 1)], axis=1)]
    return Mesh.of(vertices, np.concatenate(faces)[:, ::-1])


def arm(angle: float, rings: int) -> Mesh:
    """A straight tube whose second half turns by `angle`, bent over a fifth of its length."""
    s = np.linspace(-LENGTH / 2, LENGTH / 2, rings)
    heading = angle * np.clip(s / (0.2 * LENGTH) + 0.5, 0, 1)
    step = np.stack([np.cos(heading), np.sin(heading), np.zeros(rings)], axis=1) * (s[1] - s[0])
    path = np.concatenate([np.zeros((1, 3)), np.cumsum((step[1:] + step[:-1]) / 2, axis=0)])
    return tube(path - [LENGTH / 2, 0, 0])


def legs(angle: float, rings: int) -> Mesh:
    """A tube bent to a U, whose legs stand 0.02 apart and open by `angle` each."""
    bend, leg = 0.04, 0.3
    total = 2 * leg + np.pi * bend
    s = np.linspace(-total / 2, total / 2, rings)
    heading = np.clip(s / (np.pi * bend / 2), -1, 1) * (np.pi / 2 - angle)
    step = np.stack([np.cos(heading), -np.sin(heading), np.zeros(rings)], axis=1) * (s[1] - s[0])
    path = np.concatenate([np.zeros((1, 3)), np.cumsum((step[1:] + step[:-1]) / 2, axis=0)])
    return tube(path - path[rings // 2])


def register(key_mesh: Mesh, frames: list[Mesh], key: int, options: EmbeddedOptions) -> Motion:
    """Track the key frame's mesh through all frames, outward from the key."""
    tracker = Tracker(key_mesh, key, options)
    for frame in [*range(key + 1, len(frames)), *range(key - 1, -1, -1)]:
        tracker.step(frame, FrameSurface(frames[frame]))
    return tracker.motion(range(len(frames)))


def move(motion: Motion, points: np.ndarray, normals: np.ndarray | None = None) -> np.ndarray:
    """Move points on or near the key mesh to each frame."""
    binding = motion.bound(points, normals)
    poses = (Pose(r, p) for r, p in zip(motion.rotations, motion.positions, strict=True))
    return np.stack([moved_by(points, motion.graph.nodes, binding, pose) for pose in poses])


def test_a_rigid_motion_is_found_exactly() -> None:
    mesh = ellipsoid()
    shift = np.array([0.02, -0.01, 0.015])
    frames = [shuffled(Mesh(mesh.vertices @ turn(0.12 * k).T + k * shift, mesh.faces), k) for k in range(4)]
    motion = register(mesh, frames, 0, SMALL)
    for k, moved in enumerate(move(motion, mesh.vertices)):
        assert np.abs(moved - (mesh.vertices @ turn(0.12 * k).T + k * shift)).max() < 1e-4
    assert motion.residuals[0] == 0 and motion.residuals.max() < 1e-4


def test_a_bending_arm_is_followed() -> None:
    angles, rings = (0.0, 0.25, 0.5, 0.75), (121, 101, 111, 131)
    frames = [arm(angle, count) for angle, count in zip(angles, rings, strict=True)]
    motion = register(frames[0], frames, 0, SMALL)
    truth = arm(angles[-1], rings[0]).vertices
    assert motion.residuals.max() < 0.001
    assert np.sqrt(np.mean(np.sum((move(motion, frames[0].vertices)[-1] - truth) ** 2, axis=1))) < 0.003


def test_near_legs_share_no_node_and_part_without_sticking() -> None:
    angles, rings = (0.0, 0.1, 0.2, 0.3), (161, 151, 171, 141)
    frames = [legs(angle, count) for angle, count in zip(angles, rings, strict=True)]
    motion = register(frames[0], frames, 0, SMALL)
    graph = motion.graph
    low = graph.nodes[:, 1] < -0.12
    left, right = low & (graph.nodes[:, 0] < 0), low & (graph.nodes[:, 0] > 0)
    assert left.sum() > 10 and right.sum() > 10
    assert not right[graph.hood[left][graph.hood[left] >= 0]].any()
    assert motion.residuals.max() < 0.001
    off = move(motion, frames[0].vertices)[-1] - legs(angles[-1], rings[0]).vertices
    assert np.linalg.norm(off, axis=1).max() < 0.02


def test_fast_steps_are_followed_from_the_speed_of_the_ones_before() -> None:
    mesh = ellipsoid()
    places = (0.0, 0.06, 0.13, 0.21, 0.3)
    frames = [shuffled(Mesh(mesh.vertices * [0.4, 1, 0.4] + [0, x, 0], mesh.faces), k) for k, x in enumerate(places)]
    motion = register(frames[0], frames, 0, SMALL)
    assert motion.residuals.max() < 0.001


def test_several_bodies_go_their_own_ways() -> None:
    one = ball(3, 1.0)

    def both(t: int) -> Mesh:
        shapes = [one.vertices * [0.1, 0.06, 0.08] + [0.13 + 0.02 * t, 0, 0]]
        shapes += [one.vertices * [0.06, 0.09, 0.1] - [0.08, 0.02 * t, 0]]
        return concatenate([Mesh(shape, one.faces) for shape in shapes])

    frames = [shuffled(both(t), t) if t else both(t) for t in range(4)]
    moved = move(register(frames[0], frames, 0, SMALL), frames[0].vertices)
    assert np.abs(moved[3] - both(3).vertices).max() < 0.003


def test_an_open_mesh_is_followed_and_its_border_does_not_pull() -> None:
    whole = ellipsoid()
    kept = whole.vertices[whole.faces].mean(axis=1)[:, 0] < 0.2
    mesh = drop_unreferenced(Mesh(whole.vertices, whole.faces[kept]))
    frames = [mesh, Mesh(mesh.vertices @ turn(0.1).T, mesh.faces)]
    moved = move(register(mesh, frames, 0, SMALL), mesh.vertices)
    assert np.abs(moved[1] - frames[1].vertices).max() < 0.002


def test_a_frame_that_is_something_else_has_a_large_residual_and_stays_finite() -> None:
    tracker = Tracker(ellipsoid(3), 0, SMALL)
    assert tracker.step(1, FrameSurface(Mesh(ball(3, 0.02).vertices + 0.4, ball(3).faces))) > 0.1
    spike = Mesh.of(np.random.default_rng(0).normal(0, 0.2, (300, 3)), np.arange(300).reshape(-1, 3))
    tracker.step(2, FrameSurface(spike))
    assert np.isfinite(move(tracker.motion([1, 2]), np.zeros((1, 3)))).all()


def test_the_smallest_meshes_are_legal() -> None:
    corner = Mesh.of(0.1 * np.concatenate([np.zeros((1, 3)), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    frames = [corner, Mesh(corner.vertices + 0.01, corner.faces), Mesh.of(np.eye(3), [[0, 1, 2]])]
    motion = register(corner, frames, 0, SMALL)
    assert np.abs(move(motion, corner.vertices)[1] - frames[1].vertices).max() < 0.003
    assert move(motion, np.zeros((0, 3))).shape == (3, 0, 3)


def test_normals_keep_a_point_off_a_near_sheet_that_faces_away() -> None:
    frames = [concatenate([sheet(25, gap, up=False), sheet(25)]) for gap in (0.01, 0.02)]
    asked = np.array([[0.1, 0.1, 0.006]])
    up = np.array([[0.0, 0.0, 1.0]])
    motion = register(frames[0], frames, 0, SMALL)
    assert abs(move(motion, asked, -up)[1, 0, 2] - move(motion, asked, up)[1, 0, 2] - 0.01) < 0.002


def test_a_noisy_body_keeps_its_area_from_frame_to_frame() -> None:
    """A motion that follows the noise crumples the surface more in each frame, and what is torn is left out."""
    bodies = list(soft_bodies(SoftBodiesOptions(frames=11, people=1, spacing=0.03)))
    random, noise = np.random.default_rng(0), 0.002
    frames = [
        Mesh(mesh.vertices / bodies[0].diagonal + random.normal(0, noise, mesh.vertices.shape), mesh.faces)
        for mesh in bodies
    ]
    tracker = Tracker(frames[0], 0, EmbeddedOptions(), noise)
    for number, frame in enumerate(frames[1:], 1):
        assert tracker.step(number, FrameSurface(frame)) < tracker.lost
    back = tracker.motion([10]).back(0, frames[10])
    assert 0.97 < face_normals(back)[1].sum() / face_normals(frames[10])[1].sum() < 1.03
