"""Models of sensors: deviations as published, steps of disparity, shadows, fattening, a rim, confidence, seeds."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.capture.simulated.sensors import CORNERS, LOW_DOWN, OVERHEAD, SENSORS, SensorOptions, measured, mounted
from meshreel.errors import InputError

EXACT = SensorOptions(noise=0.0, holes=0.0, flying=0.0)
PUBLISHED = {  # m, at 2 m: Khoshelham and Elberink, Yang et al., Microsoft, Intel, Intel, Intel, Luetzenburg et al.
    "kinect_v1": 5.7e-3,
    "kinect_v2": 2e-3,
    "azure_kinect": 4.6e-3,
    "d435": 14.3e-3,
    "d455": 7.5e-3,
    "l515": 4.1e-3,
    "iphone_lidar": 10e-3,
}
STEREO = SENSORS["d455"][0]


def taken(depth, camera, errors, seed=0):
    """What a sensor measures of depths that are 2 m away where no other is given, m."""
    view = camera.view
    picture = np.broadcast_to(np.asarray(depth, float), (view.height, view.width))
    return measured(picture, camera, errors, np.random.default_rng(seed)) * camera.depth_unit


def step(camera, near=1.5, far=3.0):
    """A square of 200 pixels before a wall."""
    depth = np.full((camera.view.height, camera.view.width), far)
    depth[140:340, 300:500] = near
    return depth


@pytest.mark.parametrize("name", SENSORS)
def test_a_plane_at_two_metres_deviates_as_is_published(name):
    camera, errors = SENSORS[name]
    pictures = np.stack([taken(2.0, camera, errors, seed) for seed in range(6)])
    high, wide = camera.view.height, camera.view.width
    middle = pictures[:, high // 2 - high // 8 : high // 2 + high // 8, wide // 2 - wide // 8 : wide // 2 + wide // 8]
    found = middle[middle > 0]
    assert found.std() == pytest.approx(PUBLISHED[name], rel=0.2) and found.mean() == pytest.approx(2.0, abs=4e-3)
    band = int(camera.view.focal[0] * errors.baseline / 2.0) + 2  # columns that the other lens does not have
    assert (pictures[:, :, band:] > 0).mean() > 0.99


def test_the_rim_of_a_time_of_flight_camera_measures_too_far_and_noisier():
    camera, errors = SENSORS["azure_kinect"]
    assert taken(2.0, camera, replace(errors, noise=0.0))[0, 0] == pytest.approx(2.011, abs=1e-3)
    pictures = np.stack([taken(2.0, camera, errors, seed) for seed in range(20)])
    corner, middle = (p[p > 0].std() for p in (pictures[:, :20, :20], pictures[:, 278:298, 310:330]))
    assert corner == pytest.approx(1.5 * middle, rel=0.1)


@pytest.mark.parametrize("depth", [1.0, 2.0, 4.0])
def test_structured_light_measures_in_steps_of_disparity(depth):
    camera, errors = SENSORS["kinect_v1"]
    slope = np.linspace(depth - 0.1, depth + 0.1, camera.view.width)
    found = np.unique(taken(slope, camera, replace(errors, noise=0.0, holes=0.0)))
    wanted = depth**2 / (586.0 * 0.075) / 8
    assert np.median(np.diff(found)) == pytest.approx(wanted, abs=1.1e-3)  # depths are whole millimetres


def test_beside_near_surface_the_projector_casts_a_shadow_as_wide_as_the_disparities_differ():
    camera = SENSORS["kinect_v1"][0]
    holes = taken(step(camera), camera, replace(EXACT, baseline=0.075)) == 0
    band = int(586 * 0.075 / 3)  # columns that the other lens does not have
    assert holes[:, :band].all()
    rows, columns = np.nonzero(holes[:, band + 1 :])
    assert set(rows) == set(range(140, 340)) and columns.max() == 298 - band  # on the left: light comes from the right
    assert holes[240, band + 1 :].sum() == pytest.approx(586 * 0.075 * (1 / 1.5 - 1 / 3), abs=1)


def test_fattening_widens_a_silhouette_by_half_the_window():
    wide = taken(step(STEREO), STEREO, replace(EXACT, baseline=0.095, window=9)) == 1.5
    rows, columns = np.nonzero(wide)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (136, 343, 296, 503) and wide[
        136:344, 296:504
    ].all()
    slope = np.linspace(1.0, 3.0, 480)[:, None]  # as of a floor, steep but without a step
    found = taken(slope, STEREO, replace(EXACT, baseline=0.095, window=9))
    assert abs(found - slope)[:, int(STEREO.view.focal[0] * 0.095) + 1 :].max() < 1e-3  # others the other lens lacks


def test_noise_is_alike_in_a_window():
    errors = replace(EXACT, noise=1.0, window=9)
    found = taken(2.0, STEREO, errors) - 2.0
    alike = [np.corrcoef(found[:, :-k].ravel(), found[:, k:].ravel())[0, 1] for k in (3, 12)]
    assert alike[0] > 0.5 and abs(alike[1]) < 0.05


def test_a_phone_smooths_and_has_no_confidence_in_what_mixes_surfaces():
    camera = SENSORS["iphone_lidar"][0]
    depth = np.full((192, 256), 3.0)
    depth[:, :128] = 2.0
    mixed = taken(depth, camera, replace(EXACT, smooth=1.0))
    assert ((mixed > 2.2) & (mixed < 2.8)).any()
    sure = taken(depth, camera, replace(EXACT, smooth=1.0, trusted=0.05))
    assert not ((sure > 2.11) & (sure < 2.85)).any() and 0 < (sure == 0).mean() < 0.02


@pytest.mark.parametrize("name", SENSORS)
def test_a_seed_gives_equal_bits(name):
    camera, errors = SENSORS[name]
    first, again, other = (taken(step(camera), camera, errors, seed) for seed in (1, 1, 2))
    assert np.array_equal(first, again) and not np.array_equal(first, other)


def test_cameras_look_from_corners_from_above_or_from_low_down():
    low, high = np.array([-2.0, 0.0, -1.5]), np.array([2.0, 2.5, 1.5])
    for mount, height, steep in ((CORNERS, 2.25, 0.4), (OVERHEAD, 2.5, 0.9), (LOW_DOWN, 0.375, -0.3)):
        poses = [one.view.pose.to_world for one in mounted(STEREO, low, high, mount=mount)]
        assert [pose[1, 3] for pose in poses] == pytest.approx([height] * 4)
        assert all(-pose[1, 2] >= steep for pose in poses)  # of the optical axis, downwards


@pytest.mark.parametrize("wrong", [{"window": 0}, {"rim": (-1.0, 0.0)}, {"trusted": 0.0}, {"smooth": float("nan")}])
def test_impossible_sensors_are_refused(wrong):
    with pytest.raises(InputError, match="give numbers from 0 on"):
        SensorOptions(**wrong)
    with pytest.raises(InputError, match="give one, m"):
        SensorOptions(step=0.125)
