"""Segments become groups of layers: what follows is predicted, what cannot be followed is cut, nothing is lost."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import overload

import numpy as np
import pytest

import meshreel
from meshreel.analysis.fit.frame import FrameSurface
from meshreel.analysis.plan import Plan
from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.coding.group import continue_group
from meshreel.encoder.group.forms import EncodedGroup, measure
from meshreel.encoder.group.interval import Interval
from meshreel.encoder.layers import recipe as layered
from meshreel.encoder.layers.group_coder import GroupCoder
from meshreel.encoder.layers.recipe import LayersRecipe
from meshreel.format.layout import Form
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh
from tests.crossed_arms import FRAMES, arms, stray_share
from tests.small_options import quick
from tests.spheres import sliding_sphere

OPTIONS = quick(group_size=4).method
BALL = Mesh.of(sliding_sphere(1, levels=2)[0].vertices / 12**0.5, sliding_sphere(1, levels=2)[0].faces)  # diagonal 1
FINE = Mesh.of(sliding_sphere(1)[0].vertices / 12**0.5, sliding_sphere(1)[0].faces)  # 258 vertices


def moved(mesh: Mesh, *by: float) -> Mesh:
    return Mesh.of(mesh.vertices + by, mesh.faces)


def decoded(groups: Sequence[EncodedGroup]) -> list[Mesh]:
    """The frames from the payloads alone, a predicted group from what the one before it left."""
    meshes, state = [], None
    for group in groups:
        found, state = continue_group(group.payload, group.frame_count, None, state if group.predicted else None)
        meshes += found
    return meshes


def coded(frames: Sequence[Mesh], options=OPTIONS) -> list[EncodedGroup]:
    """The groups, after a look at what holds for all: frames are all there, and qualities are those of the bytes."""
    groups = list(LayersRecipe(options).encode(Interval(frames)))
    assert sum(group.frame_count for group in groups) == len(frames)
    assert max(group.frame_count for group in groups) <= options.group_size or groups[0].form == Form.EMPTY
    assert not groups[0].predicted
    assert all(group.layers[-1] == len(group.payload) for group in groups if group.layers)
    found, at = decoded(groups), 0
    for group in groups:
        end = at + group.frame_count
        again = measure(frames[at:end], found[at:end])
        assert again.distance == pytest.approx(group.fidelity.distance, rel=1e-6, abs=1e-12)
        at = end
    return groups


def test_of_a_body_that_stands_still_all_groups_but_the_first_are_predicted_and_tiny():
    groups = coded([FINE] * 7, quick(group_size=3).method)
    assert [(group.frame_count, group.predicted) for group in groups] == [(3, False), (3, True), (1, True)]
    assert len(groups[-1].payload) < 0.15 * len(groups[0].payload)
    assert max(group.fidelity.distance for group in groups) < 4e-4


def test_a_body_that_slides_is_followed_across_groups():
    groups = coded([moved(FINE, 0.01 * t, 0, 0) for t in range(6)], quick(group_size=3).method)
    assert [(group.form, group.predicted) for group in groups] == [(Form.LAYERS, False), (Form.LAYERS, True)]
    assert len(groups[1].payload) < 0.6 * len(groups[0].payload)


def test_a_body_that_becomes_another_cuts_the_group_there():
    other = Mesh.of(BALL.vertices * [1.6, 0.3, 0.8] + [0, 0.3, 0], BALL.faces)
    groups = coded([BALL, BALL, BALL, other, other], quick(group_size=5).method)
    starts = np.cumsum([0, *(group.frame_count for group in groups)]).tolist()
    assert 3 in starts
    assert max(group.fidelity.worst for group in groups) < 1e-3


def test_a_frame_is_prepared_once_for_all_that_is_tried_with_it(monkeypatch: pytest.MonkeyPatch):
    prepared = list[Mesh]()

    class Counted(FrameSurface):
        def __init__(self, mesh: Mesh, *rest: None) -> None:
            prepared.append(mesh)
            super().__init__(mesh, *rest)

    monkeypatch.setattr(layered, "FrameSurface", Counted)
    other = Mesh.of(BALL.vertices * [1.6, 0.3, 0.8] + [0, 0.3, 0], BALL.faces)
    first = next(LayersRecipe(quick(group_size=5).method).encode(Interval([BALL, BALL, BALL, other, other])))
    assert first.frame_count < 5 and len(prepared) == 5  # though it is cut, and tried anew


def test_of_two_close_plans_the_one_whose_groups_turn_out_cheaper_is_taken(monkeypatch: pytest.MonkeyPatch):
    """The rival cuts in two; every group of both is coded once."""
    frames, sizes = [moved(FINE, 0.01 * t, 0, 0) for t in range(4)], list[int]()
    encode = GroupCoder.layers

    def counted(self: GroupCoder, *rest):
        sizes.append(len(self.surfaces))
        return encode(self, *rest)

    def cut(plan: Plan, *_: object) -> Plan:
        (group,) = plan.groups
        return replace(plan, groups=(replace(group, stop=2), replace(group, first=2)))

    monkeypatch.setattr(GroupCoder, "layers", counted)
    monkeypatch.setattr(layered, "rival", cut)
    for sign, count in ((1, 4), (-1, 2)):  # as if fewer groups were cheaper, or more
        monkeypatch.setattr(layered, "_cost", lambda groups, *_, sign=sign: sign * len(groups))
        sizes.clear()
        first = next(LayersRecipe(OPTIONS).encode(Interval(frames)))
        assert first.frame_count == count and sorted(sizes) == [2, 2, 4]


def test_a_body_that_jumps_is_followed_or_cut_but_never_lost():
    groups = coded([BALL, BALL, moved(BALL, 0.4, 0, 0), moved(BALL, 0.4, 0, 0)])
    assert max(group.fidelity.worst for group in groups) < 1e-3


def test_frames_without_surface_are_one_empty_group_however_many():
    (group,) = coded([Mesh.empty()] * 7)
    assert (group.form, group.frame_count, group.payload[0]) == (Form.EMPTY, 7, Form.EMPTY)


def test_an_open_sheet_keeps_its_borders():
    x, z = (c.reshape(-1) for c in np.meshgrid(np.linspace(-0.3, 0.3, 12), np.linspace(-0.3, 0.3, 12)))
    corner = (np.arange(11)[:, None] * 12 + np.arange(11)).reshape(-1)
    halves = ((corner, corner + 1, corner + 13), (corner, corner + 13, corner + 12))
    faces = np.concatenate([np.stack(half, axis=1) for half in halves])
    frames = [Mesh.of(np.stack([x, 0.05 * np.sin(8 * x + 0.3 * t), z], axis=1), faces) for t in range(4)]
    groups = coded(frames)
    assert max(group.fidelity.worst for group in groups) < 2e-3
    for frame, found in zip(frames, decoded(groups), strict=True):
        assert abs(np.ptp(found.vertices, axis=0) - np.ptp(frame.vertices, axis=0)).max() < 0.01


def test_two_bodies_that_go_apart_stay_two():
    small = Mesh.of(0.5 * BALL.vertices, BALL.faces)
    frames = [concatenate([moved(small, -0.2 - 0.01 * t, 0, 0), moved(small, 0.2 + 0.01 * t, 0, 0)]) for t in range(4)]
    groups = coded(frames)
    assert max(group.fidelity.worst for group in groups) < 1e-3
    for mesh in decoded(groups):
        sides = np.sign(mesh.vertices[mesh.faces][:, :, 0])
        assert (abs(sides.sum(axis=1)) == 3).all()  # no triangle bridges them


def test_a_sphere_that_becomes_two_is_never_lost():
    small = Mesh.of(0.6 * BALL.vertices, BALL.faces)
    frames = [BALL] * 2 + [concatenate([moved(small, -0.16, 0, 0), moved(small, 0.16, 0, 0)])] * 2
    groups = coded(frames)
    assert len(groups) > 1
    assert max(group.fidelity.worst for group in groups) < 2e-3


@pytest.mark.parametrize("count", [1, 3])
def test_meshes_of_one_face_are_kept(count: int):
    triangle = Mesh.of([[0, 0, 0], [0.5, 0, 0], [0, 0.5, 0]], [[0, 1, 2]])
    groups = coded([triangle] * count)
    assert max(group.fidelity.worst for group in groups) < 2e-3


def test_bodies_that_are_not_clean_are_kept():
    a, b, _ = BALL.faces[0]
    fin = Mesh.of([*BALL.vertices, 1.2 * BALL.vertices[a]], [*BALL.faces, [a, b, len(BALL.vertices)]])
    speck = concatenate([BALL, Mesh.of([[0.4, 0, 0], [0.402, 0, 0], [0.4, 0.002, 0]], [[0, 1, 2]])])
    groups = coded([fin, fin, speck, speck])
    found = decoded(groups)
    forward = [measure([BALL], [mesh]).distance for mesh in found]
    assert max(forward) < 0.02


class Asked(Sequence[Mesh]):
    """Remembers which frames were asked for."""

    def __init__(self, frames: Sequence[Mesh]) -> None:
        self.frames, self.asked = frames, list[int]()

    def __len__(self) -> int:
        return len(self.frames)

    @overload
    def __getitem__(self, index: int) -> Mesh: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Mesh]: ...
    def __getitem__(self, index: int | slice) -> Mesh | Sequence[Mesh]:
        assert isinstance(index, int), "frames are asked for one by one"
        self.asked.append(index)
        return self.frames[index]


def test_only_the_frames_of_one_group_are_asked_for_at_a_time():
    frames = Asked([BALL] * 6)
    groups = LayersRecipe(replace(OPTIONS, group_size=2)).encode(Interval(frames))
    for number in range(3):
        frames.asked.clear()
        next(groups)
        assert set(frames.asked) - {0} == set(range(2 * number, 2 * number + 2)) - {0}  # whether 0 is empty is asked


def test_a_body_with_new_connectivity_in_every_frame_is_followed():
    meshes = list(soft_bodies(SoftBodiesOptions(frames=3, people=1, spacing=0.06)))
    low = np.min([mesh.vertices.min(axis=0) for mesh in meshes], axis=0)
    high = np.max([mesh.vertices.max(axis=0) for mesh in meshes], axis=0)
    scale = np.linalg.norm(high - low)
    frames = [Mesh.of((mesh.vertices - (low + high) / 2) / scale, mesh.faces) for mesh in meshes]
    groups = coded(frames, quick(quality=20).method)
    assert max(group.fidelity.worst for group in groups) < 4e-3


@pytest.mark.slow
def test_arms_that_uncross_leave_no_shards(tmp_path: Path) -> None:
    frames = [arms(number) for number in range(FRAMES)]
    meshreel.encode(frames, tmp_path / "arms.reel")
    assert max(map(stray_share, frames, meshreel.open(tmp_path / "arms.reel"))) <= 0.001
