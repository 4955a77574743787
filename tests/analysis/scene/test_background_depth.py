"""Background from depth pictures: noise, a body in front, and pixels between two surfaces."""

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from meshreel.analysis.scene.background import Moment, fuse_still_depth, usual_pictures
from meshreel.capture.recording import FusionOptions, fuse_depths
from meshreel.geometry.closest_points import distances
from meshreel.geometry.drawing import draw
from meshreel.types import Mesh
from tests.capture.depth_scenes import RADIUS, WALL, camera, measured

VOXEL = 0.02
AHEAD = camera("ahead", 0)
SHARP = camera("sharp", 0, size=192)
SIGMA = 8.0  # mm


def noisy(depth: np.ndarray, seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0, SIGMA, depth.shape)
    return np.where(depth > 0, np.maximum(depth + noise, 0), 0).astype(np.uint16)


def moments(depths: list[np.ndarray], moves: float | None = None):
    """Frames with their meshes; what is nearer than `moves` along z, m, is not still."""
    found = []
    for depth in depths:
        mesh = fuse_depths([AHEAD.picture(AHEAD.in_range(depth))], FusionOptions(voxel=VOXEL))
        still = np.ones(len(mesh.faces), bool)
        if moves is not None:
            still = mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > moves
        found.append(Moment([AHEAD.picture(depth)], mesh, still))
    return found


def wall_error(mesh: Mesh) -> float:
    wall = mesh.vertices[mesh.vertices[:, 2] > 1]
    assert len(wall) > 100
    return float(np.sqrt(((wall[:, 2] - WALL) ** 2).mean()))


def test_noise_goes_with_the_frames():
    depths = [noisy(measured(AHEAD), seed) for seed in range(16)]
    errors = [wall_error(fuse_still_depth(moments(depths[:count]), VOXEL)) for count in (1, 16)]
    assert errors[1] < 0.5 * errors[0]


def test_the_shadow_of_a_body_that_moves_away_is_filled_and_the_body_is_gone():
    with_ball, without = measured(AHEAD), measured(AHEAD, ball=(9.0, 0.0, 0.0))
    mesh = fuse_still_depth(moments([with_ball, with_ball, without, with_ball], moves=RADIUS + 0.2), VOXEL)
    assert mesh.vertices[:, 2].min() > RADIUS + 0.2
    assert np.linalg.norm(mesh.vertices[:, :2], axis=1).min() < 0.05  # the wall behind him


def test_a_body_that_never_leaves_casts_a_shadow():
    mesh = fuse_still_depth(moments([measured(AHEAD)] * 3, moves=RADIUS + 0.2), VOXEL)
    assert np.linalg.norm(mesh.vertices[:, :2], axis=1).min() > RADIUS


def test_the_usual_depth_is_the_median_of_enough_measured_depths(monkeypatch):
    depth = np.full((AHEAD.view.height, AHEAD.view.width), 1000, np.uint16)
    others = [depth, np.where(np.arange(AHEAD.view.width) < 8, 0, depth + 4), depth + 400]
    nothing = Mesh.empty(), np.zeros(0, bool)
    pictures = [Moment([AHEAD.picture(one.astype(np.uint16))], *nothing) for one in others]
    usual = usual_pictures(pictures)[0].depth
    assert (usual[:, 8:] == 1004).all() and (usual[:, :8] == 1200).all()  # the mean of the middle two
    monkeypatch.setattr("meshreel.analysis.scene.background.SHARED", 0.9)
    usual = usual_pictures(pictures)[0].depth
    assert (usual[:, :8] == 0).all() and (usual[:, 8:] == 1004).all()


def test_faces_that_no_camera_sees_from_the_front_are_dropped(monkeypatch):
    depth = measured(AHEAD)
    front = fuse_still_depth(moments([depth]), VOXEL)
    monkeypatch.setattr("meshreel.analysis.scene.background.FACING", 0.0)
    all_of_it = fuse_still_depth(moments([depth]), VOXEL)
    assert len(front.faces) < len(all_of_it.faces)
    assert distances(front.vertices, all_of_it).max() < 1e-6


@pytest.mark.parametrize(
    "pictures", [[None], [], [AHEAD.picture(np.zeros((AHEAD.view.height, AHEAD.view.width), np.uint16))]]
)
def test_of_nothing_there_is_nothing(pictures):
    empty = Moment(pictures, Mesh.empty(), np.zeros(0, bool))
    assert fuse_still_depth([empty] * 3, VOXEL).is_empty


def test_a_door_that_opens_soon_is_no_room_where_nothing_is_behind_it():
    depth = np.full((AHEAD.view.height, AHEAD.view.width), 2000.0)
    opened = np.where(np.arange(AHEAD.view.width) < 20, 0, depth)
    moments_ = [Moment([AHEAD.picture(one.astype(np.uint16))], Mesh.empty(), np.zeros(0, bool))
                for one in [depth] * 2 + [opened] * 8]  # fmt: skip
    usual = usual_pictures(moments_)[0].depth
    assert (usual[:, :20] == 0).all() and (usual[:, 20:] == 2000).all()


def test_a_floor_seen_at_a_grazing_angle_has_no_cracks():
    rows = (np.arange(AHEAD.view.height) + 0.5 - AHEAD.view.center[1]) / AHEAD.view.focal[1]
    with np.errstate(divide="ignore"):
        below = np.where(rows > 0, 1.2 / np.where(rows > 0, rows, 1), 0)
    depth = np.where((below > 1) & (below < 4), below * 1000, 0)[:, None] * np.ones(AHEAD.view.width)
    picture = AHEAD.picture(depth.astype(np.uint16))
    mesh = fuse_still_depth([Moment([picture], Mesh.empty(), np.zeros(0, bool))], VOXEL)
    seen = draw(mesh, AHEAD.view).depth
    inside = binary_erosion(depth > 0, iterations=2)
    assert np.mean(np.isfinite(seen[inside])) > 0.99


def slits(depth: np.ndarray) -> int:
    """Samples, four a pixel each way, that see no fused surface amid measured depth."""
    picture = SHARP.picture(depth)
    mesh = fuse_still_depth([Moment([picture], Mesh.empty(), np.zeros(0, bool))], VOXEL)
    inside = np.repeat(np.repeat(binary_erosion(depth > 0, iterations=6), 4, axis=0), 4, axis=1)
    return int((inside & ~np.isfinite(draw(mesh, picture.finer(4).camera).depth)).sum())


def test_a_step_and_what_it_hides_leave_no_slit_between_them():
    depth = np.full((SHARP.view.height, SHARP.view.width), 3000, np.uint16)
    depth[:, SHARP.view.width // 2 :] = 2000
    assert slits(depth) == 0


def test_what_a_camera_does_not_measure_is_closed_if_small():
    depth = np.full((AHEAD.view.height, AHEAD.view.width), 2000, np.uint16)
    depth[40:43, 40:43] = 0
    mesh = fuse_still_depth([Moment([AHEAD.picture(depth)], Mesh.empty(), np.zeros(0, bool))], VOXEL)
    assert np.isfinite(draw(mesh, AHEAD.view).depth[38:46, 38:46]).all()
    depth[30:60, 30:60] = 0
    mesh = fuse_still_depth([Moment([AHEAD.picture(depth)], Mesh.empty(), np.zeros(0, bool))], VOXEL)
    assert not np.isfinite(draw(mesh, AHEAD.view).depth[40:50, 40:50]).any()
