"""Poses of cameras that move, refined on what stands still: trackers of phones drift, and jump when they find back.

Some frames of a path, the keys, are as many cameras: the surfaces that they see of one room must lie on each other. One
least-squares problem has the motions of all keys, as that of a rig's cameras has. What surfaces leave open, as along a
corridor, goes on as the tracker says: errors of successive keys are alike. Other frames are laid on keys near them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from ...geometry import strict
from ...geometry.cameras import Matrix
from ...io.write import write_file
from ..rig.cameras import at_frame
from ..rig.rig import Rig, packed_path, read_path, read_rig
from .calibrate import LONGEST, REACH, Poses, Scene, largest_motion
from .poses import poses_between, turns_between
from .still_view import StillView, still_view

WAY, TURN = 0.15, 8.0  # m, degrees, from one key to the next, at most (guess)
MOST_KEYS = 64  # of a path; a longer one has keys farther apart (guess)
WIDEST = 256  # pixels of a picture; of a wider one, every second or so is enough (guess)
POINTS = 1000  # of a key, about (guess)
NEAR = 4  # keys that another frame is laid on: those before and after it, and two that share much with these (guess)
NEARER = 0.95  # of the distance before: what comes no nearer than this is left as it is (guess)
LEAST_GAIN = 1e-4  # m, by which it must come nearer: less is below a step of depth (guess)
LEAST_SHARED = 0.9  # of the points that were shared before: poses that lose more fit only what is left (guess)
DONE = 1e-4  # m, of a step that ends a round (guess)
STEPS = 20  # of a round, at most (guess)
SHARED = 0.2  # least share of a key's points that another one sees, of those that are compared (guess)
PARTNERS = 8  # keys that a key is compared with, at most: those that share most, near and far in time (guess)
DRIFT = 0.003  # m over `WAY`, standard deviation of how the errors of successive keys differ (guess)


def refine_paths(folder: Path) -> list[str]:
    """Refine the poses of the cameras of a rig that move, in their files; return what it did, for the user.

    A file as it was is kept beside the new one, see `kept`. Cameras are refined one by one: how they stand to each
    other is as recorded.
    """
    rig, remarks, moved = read_rig(folder), list[str](), dict[Path, dict[int, Matrix]]()
    for number, camera in enumerate(rig.cameras):
        if camera.path and (found := refined(rig, number)) is not None:
            poses, before, after = found
            frames = sorted(camera.path)
            given = np.stack([camera.path[frame].to_world for frame in frames])
            motions = strict.products(poses, strict.inverses(given))
            eyes = [(eye.name, eye.path) for eye in rig.color_cameras if eye.beside == number]
            for name, path in ((camera.name, camera.path), *eyes):
                # Colour may have frames in which this camera measured nothing.
                nearest = np.abs(np.array(list(path))[:, None] - np.array(frames)).argmin(axis=1)
                there = zip(path, motions[nearest], strict=True)
                ways = {frame: strict.products(motion, path[frame].to_world) for frame, motion in there}
                moved.setdefault(rig.paths[name], {}).update(ways)
            away = np.linalg.norm(poses[:, :3, 3] - given[:, :3, 3], axis=1).max()
            text = f"camera {camera.name} moves: surfaces seen twice lie {1000 * after:.1f} mm apart, in the median"
            text += f", {1000 * before:.1f} mm by its recorded poses; these are corrected by up to"
            remarks.append(f"{text} {1000 * away:.0f} mm and {turns_between(poses, given).max():.1f} degrees")
    for file, poses_of in moved.items():
        if not kept(file).exists():  # that of the first time stays, also where that was interrupted
            write_file(kept(file), file.read_bytes())
        write_file(file, packed_path(read_path(file) | poses_of))
    if alone := [eye.name for eye in rig.color_cameras if eye.path and eye.beside is None and remarks]:
        remarks.append(
            f"{folder}: the poses of {', '.join(alone)}, which stands beside no depth camera, stay as recorded"
        )
    return remarks


def kept(file: Path) -> Path:
    """Return the file in which poses are kept as they were recorded."""
    return file.with_name(f"{file.stem}.before{file.suffix}")


def refined(rig: Rig, number: int) -> tuple[Poses, float, float] | None:
    """Return the refined poses of a camera in all its frames, and how far apart surfaces lie, m, before and after.

    None where no two keys see the same surface, or where it lies no nearer afterwards.
    """
    path, frames = rig.cameras[number].path, sorted(rig.cameras[number].path)
    given = np.stack([path[frame].to_world for frame in frames])
    seen = {key: _view(rig, number, frames[key]) for key in _keys(given)}
    views = {key: view for key, view in seen.items() if view.known.any()}
    keys = list(views)
    if len(keys) < 2:
        return None
    shares = _shares(Scene([*views.values()], POINTS // 4), given[keys])
    partners = [[int(j) for j in np.argsort(-row, kind="stable")[:PARTNERS] if row[j] >= SHARED] for row in shares]
    pairs = sorted({(min(i, j), max(i, j)) for i, some in enumerate(partners) for j in some})
    if not pairs:
        return None
    scene, gaps = Scene([*views.values()], POINTS, pairs), _gaps(given[keys])
    poses = _solved(scene, given[keys], _smooth(np.maximum(gaps, 1.0)))
    (before, shared), (after, still_shared) = (_apart(scene, each) for each in (given[keys], poses))
    if after > min(NEARER * before, before - LEAST_GAIN) or still_shared < LEAST_SHARED * shared:
        return None
    motions = strict.products(poses, strict.inverses(given[keys]))
    found = strict.products(poses_between(np.array(keys, np.float64), motions, np.arange(len(frames)) * 1.0), given)
    for at in range(len(frames)):
        if at not in views and (view := seen.get(at) or _view(rig, number, frames[at])).known.any():
            after_key = int(np.clip(np.searchsorted(keys, at), 1, len(keys) - 1))
            sharing = zip(partners[after_key - 1], partners[after_key], strict=False)
            near = [*dict.fromkeys([after_key - 1, after_key, *chain(*sharing)])][:NEAR]
            around = Scene([view, *(views[keys[k]] for k in near)], POINTS, [(0, k + 1) for k in range(len(near))])
            found[at] = _solved(around, np.concatenate([found[at : at + 1], poses[near]]), 2 * np.eye(1) / DRIFT**2)[0]
    return found, before, after


def _gaps(poses: Poses) -> Float64[np.ndarray, " G"]:
    """Return how far each key is from the one before, in the distances at which keys usually follow each other."""
    ways = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) / WAY
    return np.maximum(ways, turns_between(poses[1:], poses[:-1]) / TURN)


def _smooth(gaps: Float64[np.ndarray, " G"]) -> Float64[np.ndarray, "K K"]:
    """Return the matrix by which the errors of successive keys are alike, less over wide gaps."""
    steps = np.eye(len(gaps) + 1)[1:] - np.eye(len(gaps) + 1)[:-1]
    return strict.products(steps.T / (DRIFT * gaps) ** 2, steps)


def _solved(scene: Scene, poses: Poses, stiff: Float64[np.ndarray, "M M"]) -> Poses:
    """Return poses of which the first M are moved so that surfaces lie on each other, against `stiff` (1/m^2)."""
    size, given = 6 * len(stiff), poses
    smooth, total = np.kron(stiff, np.eye(6)), np.zeros(6 * len(poses))  # motions are in m, also turns: see Scene
    for reach in REACH:
        for _ in range(STEPS):
            matrix, gradient = scene.problem(poses, reach)
            held = matrix[:size, :size] + smooth + 1e-9 * np.trace(matrix) / size * np.eye(size)
            slope = gradient[:size] + strict.products(smooth, total[:size, None])[:, 0]
            step = np.zeros_like(total)
            step[:size] = -strict.products(strict.inverse(held), slope[:, None])[:, 0]
            longest = largest_motion(step)
            step *= min(1.0, LONGEST / max(longest, 1e-12))
            poses, total = scene.moved(poses, step), total + step
            if longest < DONE:
                break
    return poses if np.isfinite(poses).all() else given


def _view(rig: Rig, number: int, frame: int) -> StillView:
    """Return the planes that a camera sees in a frame, in a picture of at most `WIDEST` pixels."""
    camera = at_frame(rig.cameras[number], frame)
    view, every = camera.view, math.ceil(camera.view.width / WIDEST)
    depth = rig.depth(number, frame)[::every, ::every] * camera.depth_unit
    focal, center = ((x / every, y / every) for x, y in (view.focal, (view.center[0] - 0.5, view.center[1] - 0.5)))
    center = (center[0] + 0.5, center[1] + 0.5)
    small = replace(view, width=depth.shape[1], height=depth.shape[0], focal=focal, center=center)
    return still_view(replace(camera, view=small, path={}), [depth])


def _apart(scene: Scene, poses: Poses) -> tuple[float, int]:
    """Return the median distance of the surfaces that pairs of keys see, m, and how many points they share."""
    found = [np.abs(way.distances) for _, ways in scene.overlaps(poses, REACH[1]) for way in ways]
    joined = np.concatenate([np.zeros(0), *found])
    return (float(np.median(joined)) if len(joined) else np.inf), len(joined)


def _keys(poses: Poses) -> list[int]:
    """Return the numbers of the poses that are keys, the first and the last among them."""
    times = 1.0
    while True:
        keys = [0]
        for number in range(1, len(poses)):
            last = poses[keys[-1]]
            far = np.linalg.norm(poses[number, :3, 3] - last[:3, 3]) >= times * WAY
            if far or turns_between(poses[number : number + 1], last[None])[0] >= times * TURN:
                keys.append(number)
        keys = keys if keys[-1] == len(poses) - 1 else [*keys, len(poses) - 1]
        if len(keys) <= MOST_KEYS:
            return keys
        times *= 1.25


def _shares(scene: Scene, poses: Poses) -> Float64[np.ndarray, "K K"]:
    """Return the share of the points of a key that another one sees, the larger one of both."""
    shares = np.zeros((len(poses), len(poses)))
    for (i, j), ways in scene.overlaps(poses, REACH[0]):
        shares[i, j] = shares[j, i] = scene.overlap((i, j), ways)
    return shares
