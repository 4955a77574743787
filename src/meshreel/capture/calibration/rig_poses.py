"""Other poses for the cameras of a rig, and its description with them.

A colour camera beside a depth camera goes with it: how they stand to each other is known better than where they are.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from ...errors import InputError
from ...geometry import strict
from ...geometry.cameras import Matrix
from ...io.read import read_json
from ..rig.cameras import posed
from ..rig.rig import RIG, Rig
from .poses import pose_for


def with_poses(rig: Rig, depth: Mapping[str, Matrix], color: Mapping[str, Matrix]) -> Rig:
    """Return a rig with other poses, by the names of depth cameras and of colour cameras; others stay."""
    eyes, cameras, motions = {eye.beside: eye for eye in rig.color_cameras}, [], []
    for number, camera in enumerate(rig.cameras):
        pose = depth.get(camera.name, camera.view.pose.to_world)
        if (eye := eyes.get(number)) is not None and eye.name in color:
            pose = strict.products(color[eye.name], strict.products(strict.inverse(eye.view.pose.to_world), pose))
        cameras.append(posed(camera, pose))
        motions.append(strict.products(pose, strict.inverse(camera.view.pose.to_world)))
    colors = []
    for eye in rig.color_cameras:
        pose = color.get(eye.name, eye.view.pose.to_world)
        if eye.beside is not None:
            pose = strict.products(motions[eye.beside], eye.view.pose.to_world)
        colors.append(posed(eye, pose))
    return replace(rig, cameras=tuple(cameras), color_cameras=tuple(colors))


def posed_by(rig: Rig, poses: Mapping[str, Matrix], kind: str, where: Path) -> tuple[Rig, list[str]]:
    """Return a rig with the poses of a file, which are those of its depth or its colour cameras (`kind`).

    Also return a warning that names cameras without one. Raises InputError where it has none of any camera.
    """
    names = [camera.name for camera in (rig.cameras if kind == "depth" else rig.color_cameras)]
    if not names:
        raise InputError(f"{rig.folder}: has no {kind} cameras, whose poses {where} is said to have; check --poses-of")
    try:
        found = {name: pose for name in names if (pose := pose_for(name, poses, kind)) is not None}
        posed = with_poses(rig, *((found, {}) if kind == "depth" else ({}, found)))
    except InputError as error:  # of a pose that is no camera's, or of one name for several
        raise InputError(f"{where}: {error}") from None
    if not found:
        text = f"has poses of {', '.join(list(poses)[:8])} and of none of the {kind} cameras {', '.join(names)}"
        raise InputError(f"{where}: {text}; name them alike in {RIG}")
    lost = [name for name in names if name not in found]
    warnings = [f"{where}: has no pose of {', '.join(lost)}, which stay where they were"] if lost else []
    return posed, warnings


def described(rig: Rig) -> bytes:
    """Return the rig's description, `rig.json`, with its poses; all else is as in the file."""
    record = read_json(rig.folder / RIG, "give JSON")
    entries = record["cameras"]
    for entry, camera in zip(entries, rig.cameras, strict=True):
        entry["camera_to_world"] = camera.view.pose.to_world.tolist()
    alone = iter(record.get("color_cameras", []))
    for eye in rig.color_cameras:
        entry = next(alone) if eye.beside is None else entries[eye.beside]["color"]
        if isinstance(entry, dict) and "camera_to_world" in entry:
            entry["camera_to_world"] = eye.view.pose.to_world.tolist()
    return (json.dumps(record, indent=1) + "\n").encode()
