"""Work: how often a frame is tracked and fitted, which depends on no machine."""

import numpy as np
import pytest

from meshreel.capture.recording import FusionOptions, open_recording
from meshreel.capture.simulated.demo_room import RoomOptions
from meshreel.encoder.sequence import encode
from meshreel.encoder.settings.settings import Settings
from meshreel.format.layout import Form
from meshreel.io.sequence import SequenceOptions, open_sequence
from meshreel.types import Mesh, MeshList
from tests.capture.depth_scenes import record_room
from tests.scenes import ball, with_room
from tests.shared_data import performer
from tests.small_options import quick, small
from tests.spheres import sliding_sphere

BALL = Mesh.of(sliding_sphere(1, levels=2)[0].vertices, sliding_sphere(1, levels=2)[0].faces)


def ellipsoid(seed: int) -> Mesh:
    """One that no other follows."""
    rng = np.random.default_rng(seed)
    turned = BALL.vertices * rng.uniform(0.1, 1.0, 3) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return Mesh.of(turned / np.linalg.norm(np.ptp(turned, axis=0)), BALL.faces)


@pytest.mark.slow
def test_what_cannot_be_followed_is_not_searched_frame_by_frame(tmp_path):
    summary = encode(
        MeshList(tuple(ellipsoid(k) for k in range(32))), tmp_path / "a.reel", options=quick(group_size=16)
    )
    work = summary.work
    assert sum(group.frame_count for group in summary.groups if group.form == Form.DRACO) > 24
    assert work["frames tracked"] <= 16 and work["frames fitted"] <= 8  # a few keys in each of two windows


def test_a_body_that_is_followed_is_tracked_and_fitted_once(tmp_path):
    frames = [Mesh.of(BALL.vertices * [0.28, 0.2, 0.15] + [0.01 * t, 0, 0], BALL.faces) for t in range(24)]
    work = encode(MeshList(tuple(frames)), tmp_path / "a.reel", options=quick(group_size=8)).work
    assert work["frames tracked"] <= 23 and work["frames fitted"] <= 24 and work["frames read"] == 24


def test_frames_of_a_room_are_read_once_and_tracked_and_fitted_once(tmp_path):
    frames = with_room([ball(0.5 + 0.35 * t) for t in range(4)])
    work = encode(MeshList(tuple(frames)), tmp_path / "a.reel", options=quick(group_size=4)).work
    assert work["frames read"] == 4 and work["frames fitted"] <= 4 and work["frames tracked"] <= 4


def test_each_camera_s_view_of_a_frame_is_drawn_once_and_threads_change_no_byte(tmp_path):
    record_room(tmp_path / "rig", RoomOptions(frames=3, seed=5))
    options, files = small(Settings(texture=128).resolved()), [tmp_path / f"{jobs}.reel" for jobs in (1, 3)]
    for jobs, file in zip((1, 3), files, strict=True):
        frames, _ = open_recording(tmp_path / "rig", FusionOptions(0.06))
        work = encode(frames, file, options=options, jobs=jobs).work
    cameras = len(frames.rig.color_cameras)  # whose calibration the first encode has left
    room = 3  # its faces are cut, without and with planes, and laid into an atlas
    assert cameras == 4 and work["pictures drawn"] <= cameras * (len(frames) + room)
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.slow
def test_a_hard_body_is_fitted_at_most_two_and_a_half_times_a_frame(tmp_path):
    frames = open_sequence(performer("basketball_player"), SequenceOptions(scale=0.1))
    summary = encode(frames, tmp_path / "a.reel", options=Settings().resolved())
    assert summary.work["frames fitted"] <= 2.5 * 10 and summary.work["frames tracked"] <= 2.5 * 10
    assert summary.work["frames read"] == 10 and summary.work.get("surfaces fused", 0) == 0
