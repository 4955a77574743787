import contextlib
import dataclasses
import math
from dataclasses import replace

import numpy as np
import pytest

from meshreel.coding import entropy
from meshreel.coding.paper import displacements
from meshreel.coding.paper.allocation import DisplacementOptions
from meshreel.coding.paper.displacements import decode_displacements, encode_displacements, layer_sizes
from meshreel.coding.steps import RUNGS, rung_of, step_of
from meshreel.errors import FormatError, InputError
from meshreel.format import records
from meshreel.format.budget import LIMITS
from meshreel.format.layout import AnchorRule, Component, DisplacementHead
from meshreel.types import Mesh

from .test_laplacian import icosahedron, spoiled


def moving(base: Mesh, frames: int = 5, seed: int = 0) -> np.ndarray:
    """A smooth motion of low rank with a little noise, about a tenth of the diagonal in size."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames)
    x = base.vertices
    wave = [np.sin(x @ rng.normal(size=3) + k)[:, None, None] * np.cos(t * 0.3 * k)[None, :, None] for k in range(3)]
    smooth = sum(w * rng.normal(size=3) for w in wave)
    return np.ascontiguousarray(0.05 * smooth + 1e-4 * rng.normal(size=(len(x), frames, 3)))


def rms(difference: np.ndarray) -> float:
    return float(np.sqrt((difference**2).sum(axis=-1).mean()))


BASE = icosahedron(3)
FIELD = moving(BASE)
DATA = encode_displacements(FIELD, BASE, DisplacementOptions())


@pytest.mark.parametrize("base", [BASE, spoiled()], ids=["sphere", "spoiled"])
@pytest.mark.parametrize("step", [1e-2, 1.2e-3, 1e-4])
def test_the_error_stays_in_proportion_to_the_step(base: Mesh, step: float) -> None:
    field = moving(base)
    decoded = decode_displacements(encode_displacements(field, base, DisplacementOptions(step=step)), base)
    assert rms(decoded - field) < 2 * step
    assert np.abs(decoded - field).max() < 12 * step


@pytest.mark.parametrize("rule", list(AnchorRule))
@pytest.mark.parametrize("count", [0, 3, 100, 10_000])
def test_any_anchors_decode(rule: AnchorRule, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meshreel.coding.paper.displacements.ANCHORS", rule)
    monkeypatch.setattr("meshreel.coding.paper.allocation.PRICE", 0.0)
    options = DisplacementOptions(anchor_count=count, anchor_weight=3)
    decoded = decode_displacements(encode_displacements(FIELD, BASE, options), BASE)
    assert rms(decoded - FIELD) < 20e-3


def test_a_finer_step_costs_more_and_errs_less() -> None:
    sizes, errors = [], []
    for step in (8e-3, 2e-3, 5e-4):
        data = encode_displacements(FIELD, BASE, DisplacementOptions(step=step))
        sizes.append(len(data))
        errors.append(rms(decode_displacements(data, BASE) - FIELD))
    assert sizes == sorted(sizes)
    assert errors == sorted(errors, reverse=True)


@pytest.mark.parametrize("count", [0, 1, 3, 15, 99])
def test_basis_size_is_the_number_of_components(count: int) -> None:
    data = encode_displacements(FIELD, BASE, DisplacementOptions(basis_size=count))
    assert len(layer_sizes(data)) - 1 == min(count, 15)


def test_the_first_components_decode_from_their_bytes_alone() -> None:
    sizes = np.cumsum(layer_sizes(DATA)).tolist()
    assert sizes[-1] == len(DATA)
    assert len(sizes) > 3
    errors = []
    for count, size in enumerate(sizes):
        part = decode_displacements(DATA[:size], BASE, count)
        np.testing.assert_array_equal(part, decode_displacements(DATA, BASE, count))
        errors.append(rms(part - FIELD))
    assert errors == sorted(errors, reverse=True)
    np.testing.assert_array_equal(decode_displacements(DATA, BASE, 99), decode_displacements(DATA, BASE))


def test_a_component_that_is_cut_is_refused() -> None:
    sizes = np.cumsum(layer_sizes(DATA)).tolist()
    with pytest.raises(FormatError, match="truncated"):
        decode_displacements(DATA[: sizes[2] - 1], BASE, 2)


def test_nothing_moves_or_nothing_is_there() -> None:
    for base in (BASE, Mesh.empty(), Mesh.of(np.eye(3), np.zeros((0, 3)))):
        for frames in (1, 4):
            still = np.zeros((len(base.vertices), frames, 3))
            data = encode_displacements(still, base, DisplacementOptions())
            assert len(data) < 40
            np.testing.assert_array_equal(decode_displacements(data, base), still)


def test_a_rigid_shift_travels_in_the_mean() -> None:
    field = np.zeros((len(BASE.vertices), 3, 3)) + np.array([[0.1, 0, 0], [0.2, 0, 0], [0.3, 0.01, 0]])
    data = encode_displacements(field, BASE, DisplacementOptions())
    assert len(layer_sizes(data)) == 1
    np.testing.assert_allclose(decode_displacements(data, BASE), field, atol=1e-4)


@pytest.mark.parametrize(
    "change", [{"frames": 0}, {"anchor_weight": 0}, {"mean_bits": 31}, {"frames": 65535}, {"anchor_count": 2**53 - 1}]
)
def test_absurd_heads_are_refused(change: dict[str, int]) -> None:
    head, offset = records.unpack(DisplacementHead, DATA)
    with pytest.raises(FormatError):
        decode_displacements(records.pack(dataclasses.replace(head, **change)) + DATA[offset:], BASE)


@pytest.mark.parametrize("change", [{"basis_bits": 31}, {"step_level": RUNGS}, {"deltas_size": 2**53 - 1}])
def test_absurd_components_are_refused(change: dict[str, int]) -> None:
    head, offset = records.unpack(DisplacementHead, DATA)
    components = (dataclasses.replace(head.components[0], **change), *head.components[1:])
    with pytest.raises(FormatError):
        decode_displacements(records.pack(dataclasses.replace(head, components=components)) + DATA[offset:], BASE)


def test_another_base_is_refused_or_gives_a_field_of_its_own_size() -> None:
    other = icosahedron(2)
    with contextlib.suppress(FormatError):
        assert len(decode_displacements(DATA, other)) == len(other.vertices)


def test_a_base_that_no_payload_can_have_is_refused() -> None:
    for bad in (Mesh(BASE.vertices * np.nan, BASE.faces), Mesh(BASE.vertices, BASE.faces + 1)):
        with pytest.raises(FormatError):
            decode_displacements(DATA, bad)


def still_payload(base: Mesh, frames: int, anchors: int) -> bytes:
    """A payload that is right in itself: one component without any motion."""
    symbols = np.zeros((len(base.vertices), 1), np.int32)
    [deltas] = entropy.encode_weights(symbols, entropy.causal_neighbours(base.faces, len(base.vertices)))
    fixed = entropy.encode_integers(np.zeros(anchors, np.int32))
    basis = entropy.encode_integers(np.zeros(6 * frames, np.int32))
    component = Component(10, 40, len(fixed), len(deltas))
    head = DisplacementHead(frames, AnchorRule.FARTHEST, anchors, 1, 10, (component,), basis)
    return records.pack(head) + fixed + deltas


def test_parts_that_only_a_collapsed_face_ties_are_refused() -> None:
    solid = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    points = np.concatenate([np.eye(4)[:, :3], np.eye(4)[:, :3] + 3])
    apart = Mesh.of(points, np.concatenate([solid, solid + 4]))
    assert not decode_displacements(still_payload(apart, 2, 2), apart).any()
    tied = Mesh.of(points, np.concatenate([apart.faces, [[0, 0, 4]]]))
    with pytest.raises(FormatError, match="no solution"):
        decode_displacements(still_payload(tied, 2, 1), tied)


def test_a_field_of_absurd_size_is_refused_before_memory_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    data = still_payload(BASE, 4, 1)
    assert decode_displacements(data, BASE).shape == (len(BASE.vertices), 4, 3)
    monkeypatch.setattr(displacements, "LIMITS", replace(LIMITS, numbers=3 * 4 * len(BASE.vertices) - 1))
    with pytest.raises(FormatError, match="4 frames"):
        decode_displacements(data, BASE)


def test_displacements_that_are_not_normalised_are_refused() -> None:
    for bad in (np.nan, np.inf, 1e6):
        with pytest.raises(InputError, match="normalise"):
            encode_displacements(FIELD * bad, BASE, DisplacementOptions())
    with pytest.raises(InputError, match="0 frames"):
        encode_displacements(FIELD[:, :0], BASE, DisplacementOptions())


def test_the_ladder_of_steps_is_exact_and_falls_by_the_eighth_root_of_two() -> None:
    for rung in range(RUNGS):
        assert math.isclose(step_of(rung), 2 ** (-rung / 8), rel_tol=1e-9)
        assert rung_of(step_of(rung)) == rung


def test_the_head_takes_less_than_half_of_a_payload() -> None:
    assert displacements.layer_sizes(DATA)[0] < len(DATA) / 2
