"""Poses that are wrong by known amounts, and what is left of the errors."""

import numpy as np
from scipy.spatial.transform import Rotation

from meshreel.capture.rig.cameras import posed


def direction(random):
    found = random.normal(size=3)
    return found / np.linalg.norm(found)


def wrong(cameras, random, degrees=1.0, metres=0.02):
    """Cameras each turned about its own place and shifted, in random directions."""
    found = []
    for camera in cameras:
        pose = camera.view.pose.to_world.copy()
        pose[:3, :3] = Rotation.from_rotvec(degrees * direction(random), degrees=True).as_matrix() @ pose[:3, :3]
        pose[:3, 3] += metres * direction(random)
        found.append(posed(camera, pose))
    return tuple(found)


def errors(poses, truth):
    """Degrees and metres by which poses are wrong, after the motion of all of them together that mends most.

    That is the mean rotation, and the shift between the mean places.
    """
    poses, truth = np.array(poses), np.array(truth)
    turns = poses[:, :3, :3] @ truth[:, :3, :3].transpose(0, 2, 1)
    mean = Rotation.from_matrix(turns).mean()
    angles = (mean.inv() * Rotation.from_matrix(turns)).magnitude()
    apart = poses[:, :3, 3] - mean.apply(truth[:, :3, 3])
    return np.degrees(angles), np.linalg.norm(apart - apart.mean(axis=0), axis=1)
