"""Backgrounds and their changes: round trips, and refused payloads."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshreel import _core
from meshreel.coding.background import decode_background, decode_change, encode_background, encode_change
from meshreel.coding.entropy import encode_integers
from meshreel.coding.mesh import encode_empty, encode_intra, encode_mesh
from meshreel.errors import FormatError, InputError
from meshreel.format.budget import LIMITS
from meshreel.format.layout import Form, StaticPatch
from meshreel.format.records import pack, unpack_all
from meshreel.types import Mesh, Placement

from .paper.test_laplacian import icosahedron

STEP = 1e-3
PLACE = Placement(1.7, (3.0, -0.25, 1e6))
BALL = icosahedron(2)
WHOLE = encode_background(BALL, STEP)
BEFORE = decode_background(WHOLE)
KNOB = Mesh.of(0.2 * icosahedron(1).vertices + [1.0, 0.5, 0.0], icosahedron(1).faces)
GONE = BEFORE.vertices[BEFORE.faces][:, :, 0].min(axis=1) > 0.3
CHANGE = encode_change(BEFORE, GONE, KNOB, STEP)
RECORD = unpack_all(StaticPatch, CHANGE)


def test_a_background_is_back_within_half_a_step_along_each_axis() -> None:
    gaps = np.abs(BEFORE.vertices[:, None] - BALL.vertices[None]).max(axis=2).min(axis=1)
    assert len(BEFORE.faces) == len(BALL.faces) and gaps.max() <= STEP / 2 * (1 + 1e-3)
    assert decode_background(encode_background(Mesh.empty(), STEP)).is_empty


def test_a_background_beyond_the_unit_box_is_none_the_worse() -> None:
    room = Mesh.of(40 * BALL.vertices + 3.0, BALL.faces)
    back = decode_background(encode_background(room, STEP))
    assert np.abs(back.vertices[:, None] - room.vertices[None]).max(axis=2).min(axis=1).max() <= STEP / 2 * (1 + 1e-3)
    with pytest.raises(InputError, match="raise the step"):
        encode_background(Mesh.of(40_000 * BALL.vertices, BALL.faces), STEP)


def test_after_a_change_there_are_the_faces_left_and_behind_them_those_added() -> None:
    after = decode_change(CHANGE, BEFORE)
    left = len(BEFORE.faces) - int(GONE.sum())
    np.testing.assert_array_equal(after.vertices[after.faces[:left]], BEFORE.vertices[BEFORE.faces[~GONE]])
    assert len(after.faces) - left == len(KNOB.faces)
    added = after.vertices[after.faces[left:]]
    assert np.abs(added - np.round(added / STEP) * STEP).max() == 0
    assert added.min(axis=(0, 1)) == pytest.approx(KNOB.vertices.min(axis=0), abs=STEP)
    assert set(after.faces.reshape(-1).tolist()) == set(range(len(after.vertices)))  # no vertex without a face


@given(st.lists(st.booleans(), min_size=len(BEFORE.faces), max_size=len(BEFORE.faces)))
def test_any_faces_may_go_and_no_others_do(bits: list[bool]) -> None:
    dropped = np.array(bits)
    after = decode_change(encode_change(BEFORE, dropped, Mesh.empty(), STEP), BEFORE)
    np.testing.assert_array_equal(after.vertices[after.faces], BEFORE.vertices[BEFORE.faces[~dropped]])


def test_a_change_of_nothing_is_the_mesh_itself_in_a_dozen_bytes() -> None:
    nothing = encode_change(BEFORE, np.zeros(len(BEFORE.faces), bool), Mesh.empty(), STEP)
    assert len(nothing) <= 12 and decode_change(nothing, BEFORE) is BEFORE


def test_changes_of_changes_and_of_an_empty_background() -> None:
    after = decode_change(CHANGE, BEFORE)
    all_gone = decode_change(encode_change(after, np.ones(len(after.faces), bool), Mesh.empty(), STEP), after)
    assert all_gone.is_empty and len(all_gone.vertices) == 0
    anew = decode_change(encode_change(all_gone, np.zeros(0, bool), BALL, STEP), all_gone)
    np.testing.assert_array_equal(anew.vertices, BEFORE.vertices)
    np.testing.assert_array_equal(anew.faces, BEFORE.faces)


def test_decoding_with_a_placement_equals_placing_the_decoded_background() -> None:
    before = _core.Background(WHOLE, None, (PLACE.scale, PLACE.origin))
    np.testing.assert_array_equal(before.arrays()[0], PLACE.of(BEFORE).vertices)
    after = _core.Background(CHANGE, before, (PLACE.scale, PLACE.origin)).arrays()
    wanted = PLACE.of(decode_change(CHANGE, BEFORE))
    np.testing.assert_array_equal(after[0], wanted.vertices)
    np.testing.assert_array_equal(after[1], wanted.faces)


@pytest.mark.parametrize("meshes", [0, 2])
def test_a_background_of_no_mesh_or_two_is_refused(meshes: int) -> None:
    with pytest.raises(FormatError, match=f"{meshes} meshes"):
        decode_background(encode_intra([BALL] * meshes, STEP, 0))


def test_other_payloads_are_no_background_and_no_change() -> None:
    for other in (b"", encode_empty(), CHANGE):
        with pytest.raises(FormatError):
            decode_background(other)
    for other in (b"", encode_empty(), WHOLE, pack(replace(RECORD, form=Form.DRACO))):
        with pytest.raises(FormatError):
            decode_change(other, BEFORE)


def test_a_change_of_another_background_is_refused() -> None:
    fewer = Mesh(BEFORE.vertices, BEFORE.faces[:-1])
    more = Mesh(BEFORE.vertices, np.concatenate([BEFORE.faces, BEFORE.faces[:1]]))
    for other in (fewer, more, Mesh.empty()):
        with pytest.raises(FormatError):
            decode_change(CHANGE, other)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "damage",
    [
        {"step": 0.0},
        {"step": -1e-3},
        {"step": 5e-324},
        {"runs": RECORD.runs + 1},
        {"runs": RECORD.runs - 1},
        {"runs": 0},
        {"runs": 2**40},
        {"runs": len(BEFORE.faces) + 2},
        {"dropped": b""},
        {"mesh": b"DRACO"},
        {"mesh": RECORD.mesh[:-3]},
    ],
    ids=str,
)
def test_a_damaged_change_is_refused(damage: dict[str, object]) -> None:
    with pytest.raises(FormatError):
        decode_change(pack(replace(RECORD, **damage)), BEFORE)  # type: ignore[arg-type]


@pytest.mark.parametrize("runs", [[320], [319, 1, 0], [0, 0, 320], [300, 21], [300, 19], [-1, 321], [0, 320, 1]])
def test_runs_that_say_nothing_or_something_else_are_refused(runs: list[int]) -> None:
    assert len(BEFORE.faces) == 320
    coded = encode_integers(np.array(runs, np.int32))
    with pytest.raises(FormatError):
        decode_change(pack(StaticPatch(Form.PATCH, STEP, len(runs), coded, b"")), BEFORE)


def test_a_background_that_grows_beyond_all_bounds_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    data = encode_change(BEFORE, np.zeros(len(BEFORE.faces), bool), KNOB, STEP)
    together = len(BEFORE.faces) + len(KNOB.faces)
    monkeypatch.setattr("meshreel.coding.mesh.LIMITS", replace(LIMITS, faces=together))
    assert len(decode_change(data, BEFORE).faces) == together
    for most in (together - 1, len(KNOB.faces) - 1):
        monkeypatch.setattr("meshreel.coding.mesh.LIMITS", replace(LIMITS, faces=most))
        with pytest.raises(FormatError, match=f"over {most}"):
            decode_change(data, BEFORE)


def test_a_mesh_to_add_that_claims_more_than_its_bytes_can_hold_is_refused() -> None:
    mesh = bytearray(encode_mesh(KNOB, STEP))
    mesh[12:16] = b"\xff\xff\xff\x7f"
    with pytest.raises(FormatError, match="claim"):
        decode_change(pack(replace(RECORD, mesh=bytes(mesh))), BEFORE)
