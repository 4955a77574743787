"""Models of depth sensors: their places, their measurements of clean depths, and seven of the market."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, UInt16

from ...errors import InputError
from ...geometry.cameras import Camera, CameraPose, looking_at
from ..rig.cameras import DepthCamera

Depth = Float64[np.ndarray, "H W"]  # m
Point = Float64[np.ndarray, " 3"]  # m
DEEPEST = 65_535  # units, largest value of a 16-bit depth picture
JUMP = 0.05  # m between neighbouring pixels: where they are farther apart, flying pixels come up (guess)
MIXED = 1.0  # pixels of disparity by which surfaces in a window differ where the nearer one wins (guess)


@dataclass(frozen=True, slots=True)
class SensorOptions:
    """Errors of a depth camera; one that is 0 leaves the picture as it is."""

    noise: float = 0.4  # times `deviation`, standard deviation
    grazing: float = 80.0  # degrees between ray and normal above which nothing is measured
    holes: float = 0.002  # share of the pixels that measure nothing
    flying: float = 0.3  # share of the pixels beside a jump that measure a depth between both sides
    pose_error: tuple[float, float] = (0.0, 0.0)  # m, degrees: standard deviations of the errors in the rig's file
    seed: int = 0
    deviation: tuple[float, float, float] = (0.005, 0.005, 0.0)  # m, of 1, z and z^2 at a depth z: `depth_noise`
    rim: tuple[float, float] = (0.0, 0.0)  # at the corners, less with the square towards the middle: m too far, as by
    # light that comes around; share by which noise is larger
    baseline: float = 0.0  # m, to the other lens or projector on the right: what it does not see is not measured
    window: int = 1  # pixels, side of a square in which noise is alike; with a baseline, near surface is wider by half
    step: float = 0.0  # pixels of disparity that depths are rounded to
    smooth: float = 0.0  # pixels, standard deviation of a filter over the picture
    trusted: float = math.inf  # share of the depth by which the filter may change it; more has no confidence

    def __post_init__(self) -> None:
        numbers = (self.noise, *self.pose_error, *self.deviation, *self.rim, self.baseline, self.step, self.smooth)
        good = all(math.isfinite(value) and value >= 0 for value in numbers) and self.window >= 1 and self.trusted > 0
        if not (good and 0 < self.grazing <= 90 and 0 <= self.holes <= 1 and 0 <= self.flying <= 1):
            text = "give numbers from 0 on, a window from 1 on, degrees up to 90 and shares up to 1"
            raise InputError(f"{self}: {text}")
        if self.step and not self.baseline:
            raise InputError(f"step {self.step:g}: of disparities, which have a baseline; give one, m")


def _camera(width: int, height: int, focal: float, near: float, far: float) -> DepthCamera:
    return DepthCamera("at", Camera(width, height, (focal, focal), (width / 2, height / 2)), depth_range=(near, far))


# Cameras on the market, at the origin, and their errors. A number that the source does not give is a guess.
SENSORS = {
    # Structured light. Khoshelham and Elberink 2012: focal length 586 pixels, 0.5 to 5 m, deviation 1.425e-3 z^2 m,
    # half a step of disparity, .41 unrounded. Konolige and Mihelich, ROS kinect_calibration: baseline 7.5 cm,
    # windows of 9 x 9 pixels, steps of 1/8 pixel.
    "kinect_v1": (
        _camera(640, 480, 586.0, 0.5, 5.0),
        SensorOptions(1.0, 75.0, 0.005, 0.0, deviation=(0.0, 0.0, 1.17e-3), baseline=0.075, window=9, step=1 / 8),
    ),
    # Time of flight. Microsoft: 512 x 424 pixels of 70 x 60 degrees, 0.5 to 4.5 m. Fankhauser et al. 2015 (ICAR):
    # deviation of about 1.3, 1.7 and 4.3 mm at 1, 2 and 4 m. Yang et al. 2015 (IEEE Sensors J. 15(8)): errors below
    # 2 mm in the middle, above 4 mm in the corners.
    "kinect_v2": (
        _camera(512, 424, 365.0, 0.5, 4.5),
        SensorOptions(1.0, 80.0, 0.002, 0.5, deviation=(0.001, 0.0, 2e-4), rim=(0.004, 1.0)),
    ),
    # Time of flight. Microsoft, Azure Kinect DK hardware specifications, NFOV unbinned: 640 x 576 pixels of 75 x 65
    # degrees, 0.5 to 3.86 m, deviation up to 17 mm, here at the far end; systematic error up to 11 mm + 0.1 %
    # of depth, here at the corners. Focal length: that of its calibrations, for the lens bends (guess).
    "azure_kinect": (
        _camera(640, 576, 504.0, 0.5, 3.86),
        SensorOptions(1.0, 80.0, 0.002, 0.3, deviation=(0.0, 0.0, 1.14e-3), rim=(0.011, 0.5)),
    ),
    # Active stereo. Intel, D400 datasheet: 848 x 480 pixels of 87 x 58 degrees, baselines of 50 and 95 mm; Tuning depth
    # cameras: deviation of .08 pixels, z^2 / (f b) times that. windows of 7 x 7 pixels (guess).
    "d435": (
        _camera(848, 480, 447.0, 0.28, 4.0),
        SensorOptions(1.0, 80.0, 0.005, 0.0, deviation=(0.0, 0.0, 3.58e-3), baseline=0.05, window=7, step=1 / 32),
    ),
    "d455": (
        _camera(848, 480, 447.0, 0.6, 6.0),
        SensorOptions(1.0, 80.0, 0.005, 0.0, deviation=(0.0, 0.0, 1.88e-3), baseline=0.095, window=7, step=1 / 32),
    ),
    # Scanning LiDAR. Intel, L515 datasheet: 1024 x 768 pixels of 70 x 55 degrees, 0.25 to 6.5 m, deviation 2.5 mm at
    # 1 m and 15.5 mm at 9 m, which are of 640 x 480 pixels.
    "l515": (
        _camera(1024, 768, 734.0, 0.25, 6.5),
        SensorOptions(1.0, 80.0, 0.005, 0.2, deviation=(8.75e-4, 1.625e-3, 0.0)),
    ),
    # LiDAR of phones. Apple, ARKit sceneDepth: 256 x 192 pixels, to 5 m, with a confidence, between 24 x 24 spots, 8 to
    # 11 pixels apart. Luetzenburg et al. 2021 (Sci. Rep. 11): small objects are right to 1 cm; as noise, a guess.
    "iphone_lidar": (
        _camera(256, 192, 193.0, 0.2, 5.0),
        SensorOptions(1.0, 80.0, 0.002, 0.3, deviation=(0.01, 0.0, 0.0), window=9, smooth=1.0, trusted=0.05),
    ),
}


@dataclass(frozen=True, slots=True)
class Mount:
    """Places of cameras around a box, and what they look at: its middle."""

    height: float = 0.9  # of the box's, where they stand
    away: float = math.sqrt(2)  # of half its sides, from its middle axis; the default: through its vertical edges
    target: float = 0.4  # of its height, where they look


CORNERS, OVERHEAD, LOW_DOWN = Mount(), Mount(1.0, 0.5, 0.0), Mount(0.15)


def mounted(
    camera: DepthCamera, low: Point, high: Point, count: int = 4, mount: Mount = CORNERS
) -> tuple[DepthCamera, ...]:
    """Return copies of a camera on an ellipse around a box (m, y up) with these corners, the first at 45 degrees."""
    middle, half = (low + high) / 2, (high - low) / 2
    heights = [low[1] + share * (high[1] - low[1]) for share in (mount.height, mount.target)]
    cameras = []
    for number in range(count):
        angle = math.pi / 4 + 2 * math.pi * number / count
        across = mount.away * half * (math.sin(angle), 0.0, math.cos(angle))
        eye, target = (np.array([middle[0], height, middle[2]]) for height in heights)
        pose = CameraPose.of_camera(looking_at(eye + across, target))
        cameras.append(replace(camera, name=f"{camera.name}{number}", view=replace(camera.view, pose=pose)))
    return tuple(cameras)


def measured(
    clean: Depth, camera: DepthCamera, sensor: SensorOptions, random: np.random.Generator
) -> UInt16[np.ndarray, "H W"]:
    """Measure clean depths, infinite where there is no surface, by a sensor, in units of its camera; 0 is nothing."""
    from scipy.ndimage import gaussian_filter, uniform_filter

    strength = camera.view.focal[0] * sensor.baseline  # m pixels: depth times disparity
    depth = _flown(_matched(clean, strength, sensor.window), sensor.flying, random)
    seen = np.isfinite(depth) & (random.random(depth.shape) >= sensor.holes)
    depth = np.where(seen, depth, 0.0)
    if sensor.smooth:
        share = gaussian_filter(seen.astype(np.float64), sensor.smooth)
        filtered = gaussian_filter(depth, sensor.smooth) / np.maximum(share, 1e-9)
        if math.isfinite(sensor.trusted):
            seen &= np.abs(filtered - depth) <= sensor.trusted * depth
        depth = filtered
    white = random.standard_normal(depth.shape)
    if sensor.window > 1:
        white = uniform_filter(white, sensor.window, mode="wrap") * sensor.window  # of the same deviation
    rows, columns = (np.linspace(-1, 1, count) ** 2 / 2 for count in depth.shape)
    away = rows[:, None] + columns  # squared distance from the middle of the picture: 1 at its corners
    constant, linear, square = sensor.deviation
    deviation = sensor.noise * (constant + linear * depth + square * depth**2) * (1 + sensor.rim[1] * away)
    depth += deviation * white + sensor.rim[0] * away
    if sensor.step:
        disparity = sensor.step * np.rint(strength / np.maximum(depth, 1e-3) / sensor.step)
        seen &= disparity > 0
        depth = strength / np.where(seen, disparity, 1.0)
    units = np.rint(depth / camera.depth_unit)
    return camera.in_range(np.where(seen & (units > 0) & (units <= DEEPEST), units, 0).astype(np.uint16))


def _matched(depth: Depth, strength: float, window: int) -> Depth:
    """Return the depths that both lenses of a pair see: without shadows, near surface wider by half of the window."""
    if not strength:
        return depth
    from scipy.ndimage import minimum_filter

    disparity = strength / depth
    other = np.arange(depth.shape[1]) - disparity  # the column in the picture of the lens or projector on the right
    nearest = np.minimum.accumulate(other[:, ::-1], axis=1)[:, ::-1]  # surface farther right that lies before it there
    wider = minimum_filter(depth, window)
    hidden = (nearest < other) | (other < 0)
    return np.where(strength / wider - disparity > MIXED, wider, np.where(hidden, np.inf, depth))


def _flown(depth: Depth, flying: float, random: np.random.Generator) -> Depth:
    """Mix the depths of both sides at some pixels beside a jump (flying pixels)."""
    found = depth.copy()
    for axis in (0, 1):
        beside = np.roll(depth, 1, axis=axis)
        with np.errstate(invalid="ignore"):  # two misses side by side
            jumps = np.isfinite(depth) & np.isfinite(beside) & (np.abs(depth - beside) > JUMP)
        np.moveaxis(jumps, axis, 0)[0] = False  # the first row has no neighbour
        mixed = jumps & (random.random(depth.shape) < flying)
        share = random.random(depth.shape)
        found[mixed] = share[mixed] * depth[mixed] + (1 - share[mixed]) * beside[mixed]
    return found
