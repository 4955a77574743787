"""Tests of the direction in which people face: of simulated people, whose headings are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from meshreel.analysis.front import bodies_of, frames_looked_at, front_of
from meshreel.capture.simulated.figure import Pose, figure
from meshreel.capture.simulated.implicit import polygonize
from meshreel.capture.simulated.procedural import grid_of_frame
from meshreel.geometry.topology import part_of
from meshreel.types import UPRIGHT, Mesh

RATE, SPACING = 30.0, 0.028  # 1/s, m
ASIDE = np.array([0.6, 0.8])


def person(heading: float, step: float = 0.0, stride: float = 0.0, place: tuple[float, float] = (0.0, 0.0)) -> Mesh:
    """A person in a pose of a walk, y up, m."""
    pose = Pose(np.array([place[0], 0.0, place[1]]), heading, step, stride)
    return polygonize((figure(pose, 0.7 * SPACING),), 0.02, grid_of_frame(int(abs(100 * heading)), SPACING, 0))


def walk(heading: float, frames: int = 4) -> list[Mesh]:
    """A person who walks 0.45 m in 0.4 s."""
    ahead = np.array([math.sin(heading), math.cos(heading)])
    return [person(heading, 0.125 * k, 0.6, tuple(0.15 * k * ahead)) for k in range(frames)]


def error_of(frames: list[list[Mesh]], heading: float, up: str = "y", rate: float = RATE) -> float:
    """Degrees between the front that is found and a heading."""
    front = front_of({number: bodies_of(meshes, up) for number, meshes in enumerate(frames)}, rate, ASIDE)
    assert front is not None and math.hypot(*front) == pytest.approx(1)
    return math.degrees(math.acos(min(1.0, float(front @ [math.sin(heading), math.cos(heading)]))))


@pytest.mark.parametrize("degrees", [0, 50, 140, 180, 250, 310])
def test_a_standing_person_is_met_from_in_front(degrees):
    heading = math.radians(degrees)
    assert error_of([[person(heading)]], heading) < 10


@pytest.mark.parametrize(("scale", "noise", "up"), [(1e-3, 0.0, "z"), (1000.0, 0.0, "-y"), (1.0, 0.012, "-z")])
def test_unit_noise_and_up_axis_do_not_turn_the_front(scale, noise, up):
    heading, generator = math.radians(200), np.random.default_rng(1)
    meshes = [person(heading, step, 0.4) for step in (0.0, 0.2, 0.4, 0.6)]
    noisy = [mesh.at(mesh.vertices + generator.normal(0, noise, mesh.vertices.shape)) for mesh in meshes]
    turned = [[mesh.at(scale * mesh.vertices @ np.array(UPRIGHT[up]))] for mesh in noisy]
    assert error_of(turned, heading, up) < 25


@pytest.mark.parametrize("degrees", [30, 270])
def test_a_walk_leads_ahead_without_feet_and_head(degrees):
    """What is left of a person whom cameras saw from the shins to the chest walks ahead."""
    heading = math.radians(degrees)
    frames = [[part_of(mesh, between(mesh, 0.3, 1.3))] for mesh in walk(heading)]
    assert error_of(frames, heading, rate=7.5) < 25


def between(mesh: Mesh, low: float, high: float) -> np.ndarray:
    heights = mesh.vertices[mesh.faces][:, :, 1]
    return (heights.min(axis=1) > low) & (heights.max(axis=1) < high)


@pytest.mark.parametrize("facing", [1.0, -1.0])
def test_people_who_face_each_other_are_seen_from_the_side(facing):
    """On their left and on their right it is the side nearer to the usual view."""
    pair = [person(math.pi / 2 * facing, place=(-0.8, 0.0)), person(-math.pi / 2 * facing, place=(0.8, 0.0))]
    front = front_of({0: bodies_of(pair, "y")}, RATE, ASIDE)
    assert front is not None and front[1] > 0.97


def test_the_beginning_counts_where_it_has_bodies():
    """A person who is there from the fourth second on is met then; one who turns later is met at first."""
    late = {0: [], 120: bodies_of([person(1.0)], "y")}
    turns = {0: bodies_of([person(1.0)], "y")} | {k: bodies_of([person(1.0 + math.pi)], "y") for k in (90, 120, 150)}
    for frames in (late, turns):
        front = front_of(frames, RATE, ASIDE)
        assert front is not None and math.atan2(*front) == pytest.approx(1.0, abs=0.2)


def test_what_is_no_person_has_no_front():
    corners = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 1.0)])
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    assert front_of({0: bodies_of([Mesh.of(corners, faces), Mesh.empty()], "y")}, RATE, ASIDE) is None
    flat = Mesh.of(np.zeros((3, 3)), [[0, 1, 2]])
    assert front_of({0: bodies_of([flat], "y"), 1: []}, RATE, ASIDE) is None


def test_frames_are_sampled_from_all_and_from_the_beginning():
    numbers = frames_looked_at(3000, 30.0)
    assert numbers[0] == 0 and numbers[-1] == 2999
    assert sum(number < 60 for number in numbers) >= 12 and len(numbers) <= 24
    assert frames_looked_at(1, 30.0) == [0]
