import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from meshreel.coding.layers.fields import Rate
from meshreel.coding.layers.trajectories import decode_trajectories, encode_trajectories
from meshreel.coding.steps import rung_of
from meshreel.format.layout import CodedField, Form, LayersGroup, Origin, SharedMotion
from meshreel.format.records import pack
from meshreel.types import Mesh

from ..bodies import sheet

BASE = sheet().mesh
RATE = Rate(rung_of(2e-3), 0.08)
AXIS = np.array([0.6, 0.0, 0.8])


def turning(angle: float, frames: int = 16, bend: float = 0.0) -> np.ndarray:
    """A sheet that turns by an angle a frame, rad, drifts, and bends."""
    time = np.arange(frames)[:, None, None]
    points = BASE.vertices + bend * np.sin(9 * BASE.vertices[:, [1, 2, 0]] + 0.4 * time)
    turns = Rotation.from_rotvec(angle * time[:, :, 0] * AXIS).as_matrix()
    return np.einsum("tij,tvj->tvi", turns, points) + 0.02 * time * AXIS


def coded(positions: np.ndarray, base: Mesh = BASE) -> tuple[SharedMotion, CodedField, np.ndarray]:
    """What moves all vertices alike, the field, and the places that they decode to."""
    shared, field = encode_trajectories(positions, base, RATE, 0.4)
    head = LayersGroup(Form.LAYERS, Origin.PREVIOUS, len(positions), 0, 1.0, b"", shared, field)
    return shared, field, np.moveaxis(decode_trajectories(pack(head), base, len(positions)), 2, 0)


@pytest.mark.parametrize("angle", [0.05, 0.3, 1.4])
def test_a_rigid_motion_takes_a_pose_a_frame_and_nothing_else(angle: float) -> None:
    shared, field, decoded = coded(turning(angle))
    assert shared == SharedMotion.POSES and field.columns == 0
    assert len(field.basis) < 16 * 6 * 2  # two bytes for each of six numbers a frame
    assert np.abs(decoded - turning(angle)).max() < 2e-3  # a step


def test_a_body_that_bends_as_it_turns_has_poses_and_columns() -> None:
    wanted = turning(0.2, bend=0.01)
    shared, field, decoded = coded(wanted)
    assert shared == SharedMotion.POSES and field.columns > 0
    assert np.sqrt(((decoded - wanted) ** 2).sum(axis=2).mean()) < 3e-3


@pytest.mark.parametrize("positions", [turning(0.0, bend=0.03), turning(1.7)], ids=["bends", "turns too far a frame"])
def test_other_motion_has_shifts(positions: np.ndarray) -> None:
    assert coded(positions)[0] == SharedMotion.SHIFTS


def test_a_motion_of_one_vertex_is_coded() -> None:
    one = Mesh(np.ascontiguousarray(BASE.vertices[:1]), BASE.faces[:0])
    assert np.abs(coded(np.repeat(one.vertices[None], 3, axis=0), one)[2] - one.vertices).max() < 2e-3
