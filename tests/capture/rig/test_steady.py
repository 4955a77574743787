"""Sensors that measure a frame as a whole too far or too near: corrected where pixels agree, and only there."""

import numpy as np
import pytest

from meshreel.capture.recording import open_recording
from meshreel.capture.rig.rig import read_rig
from meshreel.capture.rig.steady import SteadyDepth
from meshreel.io.pictures import read_depth
from meshreel.io.write import write_picture
from tests.capture.depth_scenes import camera, record

ERRORS = [0.0, 0.02, -0.01, 0.0, 0.005, 0.03, 0.0, -0.02, 0.0]  # shares of the depth, by frame; their median is 0
BALLS = [(0.05 * k - 0.2, 0.0, 0.0) for k in range(len(ERRORS))]


def rig_of(folder, errors, noise=0.0):
    """The ball passes in front of the wall; in each frame all depths are too large by a share, and noisy."""
    record(folder, [camera()], BALLS)
    random, exact = np.random.default_rng(0), []
    for number, error in enumerate(errors):
        path = folder / "front" / "depth" / f"depth_{number:05}.png"
        exact.append(read_depth(path).astype(float))
        wrong = exact[-1] * (1 + error + noise * random.normal(size=exact[-1].shape))
        write_picture(np.where(exact[-1] > 0, np.rint(wrong), 0).astype(np.uint16), path)
    return exact


@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_what_a_frame_is_off_as_a_whole_is_taken_out_of_still_and_moving_surface(tmp_path, noise):
    exact = rig_of(tmp_path, ERRORS, noise)
    steady = SteadyDepth(read_rig(tmp_path))
    for number, depth in enumerate(exact):
        [picture] = steady.pictures(number)
        assert abs(np.median(picture.depth[depth > 0] - depth[depth > 0])) <= 0.001 * np.median(depth)
        ball = (depth > 0) & (depth < 2500)
        assert abs(np.median(picture.depth[ball] - depth[ball])) <= 3


def test_errors_below_those_of_single_pixels_are_left_alone(tmp_path):
    rig_of(tmp_path, [error / 20 for error in ERRORS], 0.004)
    rig = read_rig(tmp_path)
    for number in range(len(ERRORS)):
        assert np.array_equal(SteadyDepth(rig).pictures(number)[0].depth, rig.depth_pictures(number)[0].depth)


def test_what_is_corrected_is_said(tmp_path):
    rig_of(tmp_path, ERRORS)
    [warning] = [text for text in open_recording(tmp_path)[1] if "as a whole" in text]
    assert warning.startswith("camera front measures 5 of 9 frames") and "3.0 % of the depth" in warning


def test_a_frame_without_a_measurement_is_no_error(tmp_path):
    record(tmp_path, [camera()], BALLS)
    write_picture(np.zeros((96, 96), np.uint16), tmp_path / "front" / "depth" / "depth_00003.png")
    assert SteadyDepth(read_rig(tmp_path)).errors(range(9)) == [[0.0] * 9]


@pytest.mark.parametrize("count", [3, 9])
def test_a_body_that_fills_the_picture_and_moves_is_no_error(tmp_path, count):
    """Of a ball alone, all pixels agree on how far it has moved from its usual place."""
    record(tmp_path, [camera()], [(0.0, 0.0, 0.01 * k) for k in range(count)], wall=False)
    rig = read_rig(tmp_path)
    for number in range(count):
        assert np.array_equal(SteadyDepth(rig).pictures(number)[0].depth, rig.depth_pictures(number)[0].depth)
