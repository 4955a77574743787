import contextlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from meshreel import _core
from meshreel.coding.group import continue_group, decode_group, payload_bytes_by_purpose
from meshreel.coding.layers.coder import encode_layers
from meshreel.coding.layers.patches import decode_patches, decode_runs, encode_patches, encode_runs
from meshreel.errors import FormatError, InputError
from meshreel.format.budget import LIMITS
from meshreel.format.records import pack
from meshreel.types import Mesh, Placement

from ..bodies import ball, moving
from ..paper.test_laplacian import icosahedron

FRAMES, STEP_LEVEL = 4, 72
BALL = ball()
CODED = encode_layers(BALL, moving(BALL, FRAMES))
FACES = len(BALL.base.faces)
SPHERE = icosahedron(1)
MESHES = tuple(Mesh.of(0.05 * SPHERE.vertices - 0.1 * t, SPHERE.faces) for t in range(FRAMES - 1)) + (Mesh.empty(),)
DROPPED = np.zeros((FRAMES, FACES), bool)
DROPPED[1:, 100:140] = True
DROPPED[2, 120:200] = True
RECORD, DECODED = encode_patches(DROPPED, MESHES, STEP_LEVEL)
PAYLOAD = CODED.payload + pack(RECORD)


@given(arrays(bool, st.tuples(st.integers(1, 5), st.integers(1, 40))))
def test_runs_of_a_mask_decode_to_the_mask(dropped: np.ndarray) -> None:
    runs = encode_runs(dropped)
    np.testing.assert_array_equal(decode_runs(runs, *dropped.shape), dropped)
    assert len(runs) == 0 or dropped.any()


@given(st.lists(st.integers(-(2**31), 2**31 - 1) | st.integers(0, 6), max_size=12))
def test_any_runs_give_a_mask_that_has_them_or_are_refused(runs: list[int]) -> None:
    values = np.array(runs, np.int32)
    with contextlib.suppress(FormatError):
        mask = decode_runs(values, 3, 10)
        assert mask.shape == (3, 10)


@pytest.mark.parametrize("runs", [[10], [11, 1], [3, 0, 7, 9], [3, 7, 21, 1], [3, 7, 20], [-1, 11], [3, 2, 5], [0, 10]])
def test_runs_that_do_not_fill_the_mask_are_refused(runs: list[int]) -> None:
    with pytest.raises(FormatError):
        decode_runs(np.array(runs, np.int32), 3, 10)


def test_a_mask_that_lasts_costs_little_more_than_one_frame() -> None:
    generator = np.random.default_rng(1)
    once = generator.random((1, 4000)) < 0.02
    assert len(encode_runs(np.repeat(once, 16, axis=0))) <= len(encode_runs(once)) + 1


def test_decoding_gives_the_mask_and_the_meshes_to_the_bit() -> None:
    patches = decode_patches(RECORD, FRAMES, FACES)
    np.testing.assert_array_equal(patches.dropped, DROPPED)
    for mine, theirs, wanted in zip(patches.meshes, DECODED, MESHES, strict=True):
        np.testing.assert_array_equal(mine.vertices, theirs.vertices)
        np.testing.assert_array_equal(mine.faces, theirs.faces)
        assert len(mine.faces) == len(wanted.faces)
        if not wanted.is_empty:
            apart = np.linalg.norm(mine.vertices[:, None] - wanted.vertices, axis=2).min(axis=1)
            assert apart.max() < 2.0 ** (-STEP_LEVEL / 8)


def test_frames_are_shown_without_the_faces_and_with_the_meshes() -> None:
    frames = decode_group(PAYLOAD, FRAMES)
    for t, (frame, plain) in enumerate(zip(frames, decode_group(CODED.payload, FRAMES), strict=True)):
        count = FACES - int(DROPPED[t].sum())
        np.testing.assert_array_equal(frame.faces[:count], plain.faces[~DROPPED[t]])
        np.testing.assert_array_equal(frame.vertices[: len(plain.vertices)], plain.vertices)
        np.testing.assert_array_equal(frame.faces[count:] - len(plain.vertices), DECODED[t].faces)
        np.testing.assert_array_equal(frame.vertices[len(plain.vertices) :], DECODED[t].vertices)


def test_decoding_with_a_placement_equals_placing_the_decoded_group() -> None:
    place = Placement(1.7, (3.0, -0.25, 1e6))
    for payload in (PAYLOAD, CODED.payload):
        for levels in (None, 0, 1, BALL.levels + 1):
            placed = _core.Group(payload, FRAMES, levels, None, (place.scale, place.origin))
            plain = decode_group(payload, FRAMES, levels)
            for (vertices, faces, *_), mesh in zip(placed.frames(), plain, strict=True):
                np.testing.assert_array_equal(vertices, place.of(mesh).vertices)
                np.testing.assert_array_equal(faces, mesh.faces)


@given(st.lists(st.tuples(st.booleans(), st.integers(1, 20)), max_size=9))
def test_the_faces_that_are_kept_are_those_not_dropped(runs: list[tuple[bool, int]]) -> None:
    gone = np.repeat(np.array([bit for bit, _ in runs], bool), [length for _, length in runs])
    faces = np.arange(3 * len(gone), dtype=np.int32).reshape(-1, 3)
    room = np.full((len(faces) + 1, 3), -1, np.int32)
    count = _core.keep_faces(faces, gone.view(np.uint8), room)
    np.testing.assert_array_equal(room[:count], faces[~gone])
    assert (room[count:] == -1).all()
    if len(faces):
        with pytest.raises(ValueError, match="sizes"):
            _core.keep_faces(faces, gone.view(np.uint8), room[: len(faces) - 1])


def test_without_their_layer_the_group_is_as_it_was() -> None:
    ends = (*CODED.layers, len(PAYLOAD))
    for levels in range(BALL.levels + 1):
        for data in (PAYLOAD, PAYLOAD[: ends[levels]]):
            frames = decode_group(data, FRAMES, levels)
            for mine, theirs in zip(frames, decode_group(CODED.payload, FRAMES, levels), strict=True):
                np.testing.assert_array_equal(mine.vertices, theirs.vertices)
                np.testing.assert_array_equal(mine.faces, theirs.faces)
    assert len(decode_group(PAYLOAD, FRAMES, BALL.levels + 1)[0].vertices) > len(BALL.base.vertices)


def test_the_next_group_is_predicted_as_if_nothing_were_patched() -> None:
    state = continue_group(PAYLOAD, FRAMES, None, None)[1]
    assert state is not None
    np.testing.assert_array_equal(state.base, CODED.state.base)


def test_the_parts_of_a_payload_are_all_its_bytes() -> None:
    parts = payload_bytes_by_purpose(PAYLOAD)
    assert sum(parts.values()) == len(PAYLOAD)
    assert parts["dropped faces"] == len(RECORD.dropped) and parts["patches"] == len(RECORD.mesh)


def test_nothing_to_change_takes_a_handful_of_bytes() -> None:
    record, _ = encode_patches(np.zeros((3, 9), bool), [Mesh.empty()] * 3, STEP_LEVEL)
    assert len(pack(record)) <= 5
    patches = decode_patches(record, 3, 9)
    assert not patches.dropped.any() and all(mesh.is_empty for mesh in patches.meshes)


def test_all_faces_may_go() -> None:
    record, _ = encode_patches(np.ones((FRAMES, FACES), bool), [Mesh.empty()] * FRAMES, STEP_LEVEL)
    assert all(mesh.is_empty for mesh in decode_group(CODED.payload + pack(record), FRAMES))


def test_meshes_too_wide_for_the_lattice_are_refused() -> None:
    wide = [Mesh.of(300 * SPHERE.vertices, SPHERE.faces)] * FRAMES
    with pytest.raises(InputError, match="raise the step"):
        encode_patches(DROPPED, wide, 100)


@pytest.mark.parametrize(
    "damage",
    [
        {"runs": RECORD.runs + 1},
        {"runs": 2**40},
        {"dropped": b""},
        {"step_level": 200},
        {"width": 0},
        {"width": 1},
        {"width": RECORD.width // 2},
        {"width": 2**53 - 1},
        {"mesh": b"DRACO"},
        {"mesh": RECORD.mesh[:-3]},
    ],
    ids=str,
)
def test_a_damaged_record_is_refused(damage: dict[str, object]) -> None:
    with pytest.raises(FormatError):
        decode_patches(replace(RECORD, **damage), FRAMES, FACES)  # type: ignore[arg-type]


def test_a_mask_over_other_faces_is_refused() -> None:
    with pytest.raises(FormatError):
        decode_patches(RECORD, FRAMES, FACES - 1)


def test_patches_of_absurd_size_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meshreel.coding.mesh.LIMITS", replace(LIMITS, faces=100))
    with pytest.raises(FormatError, match="over 100"):
        decode_patches(RECORD, FRAMES, FACES)
