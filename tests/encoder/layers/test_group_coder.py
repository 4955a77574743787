"""One group of layers: what is measured of it, and when Draco takes its place."""

from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel.analysis.fit.frame import FrameSurface
from meshreel.coding.group import decode_group
from meshreel.coding.mesh import CodedReference, code_on_lattice
from meshreel.encoder.group.forms import EncodedGroup, Fidelity, measure, target_of
from meshreel.encoder.layers import group_coder as layers_group
from meshreel.encoder.layers.group_coder import MOST_FOR_EDGES, GroupCoder
from meshreel.format.layout import Form
from meshreel.types import Mesh, MeshList
from tests.small_options import quick
from tests.spheres import sliding_sphere

OPTIONS = replace(quick(group_size=4).method, tails=False)
BALL = Mesh.of(sliding_sphere(1)[0].vertices / 12**0.5, sliding_sphere(1)[0].faces)
FRAMES = [Mesh.of(BALL.vertices + [0.01 * t, 0, 0], BALL.faces) for t in range(3)]


def coded(options=OPTIONS, errors=(0.0, 0.0, 0.0), target: Fidelity | None = None) -> EncodedGroup:
    """The three frames with the first as their template, whose vertices are off by an error in each."""
    reference, rng = template(), np.random.default_rng(0)
    off = rng.normal(size=reference.base.vertices.shape)
    positions = np.stack([reference.base.vertices + [0.01 * t, 0, 0] + error * off for t, error in enumerate(errors)])
    surfaces = [FrameSurface(frame) for frame in FRAMES]
    return GroupCoder(surfaces, target or target_of(FRAMES, options.target, 0.0), 0.0, options, options.floor).layers(
        reference, positions, None
    )[0]


def template() -> CodedReference:
    return code_on_lattice(BALL, 1e-4, 0)


@pytest.mark.parametrize(("most", "chosen"), [(1, [1]), (2, [0, 2]), (None, [0, 1, 2])])
def test_fidelity_is_that_of_the_frames_that_are_measured(most, chosen):
    options = replace(OPTIONS, measured=most, floor=False)
    group = coded(options, errors=(0.0, 0.002, 0.001))
    assert group.form == Form.LAYERS
    decoded = decode_group(group.payload, 3)
    assert group.fidelity == measure([FRAMES[k] for k in chosen], [decoded[k] for k in chosen])


def test_without_a_floor_no_draco_is_tried_where_the_layers_hold(monkeypatch: pytest.MonkeyPatch):
    tried = list[int]()
    monkeypatch.setattr(layers_group, "cheaper", lambda frames, group, _: tried.append(len(frames)) or group)
    assert coded(replace(OPTIONS, floor=False)).form == Form.LAYERS and not tried
    assert coded(OPTIONS).form == Form.LAYERS and tried == [3]


def test_a_group_whose_edges_are_lost_is_coded_one_by_one_with_its_edges():
    options, target = replace(OPTIONS, floor=False), target_of(FRAMES, OPTIONS.target, 0.0)
    flat = coded(options, errors=(0.01,) * 3, target=replace(target, angle=3.0))
    assert flat.form == Form.LAYERS and 2.5 * options.flat < flat.fidelity.angle <= 3.0 * options.flat
    sharp = coded(options, errors=(0.01,) * 3, target=replace(target, angle=2.5))
    assert sharp.form == Form.DRACO and sharp.fidelity.angle <= 2.5
    assert len(sharp.payload) <= MOST_FOR_EDGES * len(flat.payload)
    strict = replace(options, flat=1.0)
    assert coded(strict, errors=(0.01,) * 3, target=replace(target, angle=3.0)).form == Form.DRACO


def test_a_turning_body_of_few_large_faces_keeps_its_edges_however_cheap_its_motion_is(tmp_path):
    """Each corner of a prism has one normal, which a template that is subdivided does not have."""
    ring = np.exp(2j * np.pi * np.arange(5) / 5)
    ends = [np.column_stack([ring.real, ring.imag, np.full(5, z)]) for z in (-1.0, 1.0)]
    sides = [[k, (k + 1) % 5, k + 5] for k in range(5)] + [[(k + 1) % 5, (k + 1) % 5 + 5, k + 5] for k in range(5)]
    lids = [corners for k in (1, 2, 3) for corners in ([0, k + 1, k], [5, k + 5, k + 6])]
    tilted = np.concatenate(ends) @ np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]])
    angles = np.radians(4) * np.arange(16)
    turns = (np.array([[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]]) for a in angles)
    frames = [Mesh.of(tilted @ turn, sides + lids) for turn in turns]
    meshreel.encode(MeshList(tuple(frames)), tmp_path / "prism.reel")
    with meshreel.open(tmp_path / "prism.reel") as video:
        assert max(measure([frame], [shown]).angle for frame, shown in zip(frames, video, strict=True)) < 1


def test_a_template_that_has_collapsed_is_replaced_by_frames_that_stand_alone():
    options, reference = replace(OPTIONS, floor=False), template()
    surfaces = [FrameSurface(frame) for frame in FRAMES]
    coder = GroupCoder(surfaces, target_of(FRAMES, options.target, 0.0), 0.0, options, options.floor)
    group, state = coder.layers(reference, np.zeros((3, len(reference.base.vertices), 3)), None)
    assert group.form == Form.DRACO and state is None and np.isfinite(group.fidelity.distance)
