import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel import _core
from meshreel.coding.entropy import encode_integers
from meshreel.coding.layers import fields, orthonormal
from meshreel.coding.layers.fields import Rate, SurfaceWeight, decode_field, encode_field
from meshreel.coding.layers.graph import hierarchy, siblings
from meshreel.coding.steps import RUNGS
from meshreel.errors import FormatError, InputError
from meshreel.format.layout import CodedField
from meshreel.format.records import pack, unpack
from meshreel.geometry.topology import subdivide, vertex_normals

from ..bodies import ball, moving

REFERENCE = ball(1)
MESH = REFERENCE.mesh
ORDER, GRAPH = hierarchy(MESH)
COUNT = len(MESH.vertices)


ROUND = SurfaceWeight(np.tile(vertex_normals(MESH)[ORDER], 4), 0.4)


def trajectories(frames: int = 4) -> np.ndarray:
    offsets = moving(REFERENCE, frames)[:, :COUNT] - MESH.vertices
    return np.ascontiguousarray(np.moveaxis(offsets, 0, 1)[ORDER].reshape(COUNT, -1))


@settings(max_examples=60)
@given(st.integers(1, 40), st.integers(0, 40), st.integers(0, 2**32), st.sampled_from([2.0, 30.0, 5000.0, 2.0**24]))
def test_a_basis_comes_back_orthonormal_and_near(width: int, count: int, seed: int, scale: float) -> None:
    count = min(count, width)
    wanted = np.linalg.qr(np.random.default_rng(seed).normal(size=(width, width)))[0][:count]
    symbols = orthonormal.forward(wanted, np.full(count, scale))
    assert len(symbols) == count * width - count * (count - 1) // 2
    found = orthonormal.inverse(symbols, count, width)
    np.testing.assert_allclose(found @ found.T, np.eye(count), atol=1e-12)
    if scale > 1000 and count < width:
        np.testing.assert_allclose(found, wanted, atol=3 * width / scale)


def test_a_vector_without_direction_is_refused() -> None:
    with pytest.raises(FormatError):
        orthonormal.inverse(np.array([3, 1, 0], np.int32), 2, 2)
    with pytest.raises(FormatError):
        orthonormal.inverse(np.array([3, 1, 0, 0], np.int32), 2, 2)


@pytest.mark.parametrize("level", [40, 72, 100])
@pytest.mark.parametrize("head", [0, 13])
def test_a_field_decodes_to_the_encoders_reconstruction_which_is_near_the_input(level: int, head: int) -> None:
    rate, wanted = Rate(level, 0.1), trajectories()
    coded = encode_field(wanted, GRAPH, rate, ROUND if head else None, np.arange(head, dtype=np.int32))
    decoded = decode_field(coded.record, GRAPH, wanted.shape[1], head)
    np.testing.assert_array_equal(decoded, coded.decoded)
    assert np.abs(decoded - wanted).max() < 4 * rate.step


def test_without_a_price_errors_stay_below_half_a_step_a_column(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fields, "FINENESS", 1e4)
    rate, wanted = Rate(104, 0.0), trajectories()
    coded = encode_field(wanted, GRAPH, rate)
    assert coded.record.columns == wanted.shape[1]
    assert np.linalg.norm(coded.decoded - wanted, axis=1).max() <= rate.step / 2 * wanted.shape[1] ** 0.5 + 1e-9


def test_a_price_on_bits_saves_more_than_it_spoils() -> None:
    wanted = trajectories(8)
    plain, priced = (encode_field(wanted, GRAPH, Rate(64, price)) for price in (0.0, 0.12))
    assert len(priced.record.symbols) < 0.95 * len(plain.record.symbols)


def test_columns_as_weak_as_noise_are_left_out() -> None:
    clean = np.outer(np.linspace(-1, 1, COUNT), np.ones(8)) * 0.05
    noisy = clean + np.random.default_rng(0).normal(0, 1e-3, clean.shape)
    every, strong = (encode_field(noisy, GRAPH, Rate(72, 0.08, least)) for least in (0.0, 1.25e-3))
    assert every.record.columns > 4 and strong.record.columns == 1
    assert ((strong.decoded - clean) ** 2).mean() < 0.5 * ((every.decoded - clean) ** 2).mean()


def test_errors_move_to_where_they_do_not_show() -> None:
    wanted, errors, bits = trajectories(), [], []
    for tangential in (1.0, 0.3):
        coded = encode_field(wanted, GRAPH, Rate(72, 0.12), SurfaceWeight(ROUND.normals, tangential))
        error = (coded.decoded - wanted).reshape(COUNT, -1, 3)
        errors.append(((error * ROUND.normals.reshape(COUNT, -1, 3)).sum(axis=2) ** 2).mean())
        bits.append(len(coded.record.symbols))
    assert errors[1] < errors[0] and bits[1] < 1.02 * bits[0]


@settings(max_examples=60)
@given(st.integers(0, 2**32), st.integers(1, 6), st.floats(0, 31))
def test_any_symbols_come_back_from_one_stream(seed: int, columns: int, size: float) -> None:
    generator = np.random.default_rng(seed)
    level = subdivide(MESH.faces, COUNT)
    near = siblings(level)
    sizes = np.exp2(generator.uniform(0, size, (columns, len(level.edges)))) - 1
    symbols = np.rint(generator.choice([-1, 1], sizes.shape) * sizes * (generator.random(sizes.shape) < 0.5))
    symbols = symbols.astype(np.int32)
    graph = near.graph(0)  # no value is predicted from others
    stream, shares = _core.encode_field(symbols, graph.core)
    assert abs(int(shares.sum()) - len(stream)) < 6
    basis = encode_integers(orthonormal.forward(np.eye(columns), np.ones(columns)))
    whole = CodedField(columns, 0, basis, stream)  # in steps of 1, along the axes: rows are symbols
    np.testing.assert_array_equal(decode_field(whole, graph, columns).T, symbols)
    for damaged in (stream[:-1], stream + b"\0"):
        with pytest.raises(FormatError, match="symbols"):
            decode_field(dataclasses.replace(whole, symbols=damaged), graph, columns)


def test_zeros_cost_next_to_nothing() -> None:
    stream, _ = _core.encode_field(np.zeros((4, COUNT), np.int32), GRAPH.core)
    assert len(stream) < 6


@pytest.mark.parametrize("change", [{"columns": 13}, {"step_level": RUNGS}, {"columns": 2**53 - 1}, {"symbols": b""}])
def test_absurd_records_are_refused(change: dict[str, object]) -> None:
    coded = encode_field(trajectories(), GRAPH, Rate(72, 0.1), ROUND)
    with pytest.raises(FormatError):
        decode_field(dataclasses.replace(coded.record, **change), GRAPH, 12)
    with pytest.raises(FormatError):
        decode_field(coded.record, GRAPH, 12, 1)


def test_trajectories_too_long_for_the_step_are_refused() -> None:
    with pytest.raises(InputError, match="too long"):
        encode_field(1e4 * trajectories(), GRAPH, Rate(RUNGS - 1, 0.1))


@settings(max_examples=300)
@given(st.data())
def test_damaged_records_decode_to_rows_or_to_an_error_of_the_format(data: st.DataObject) -> None:
    coded = encode_field(trajectories(), GRAPH, Rate(72, 0.1), ROUND)
    record = bytearray(pack(coded.record))
    for _ in range(data.draw(st.integers(0, 2))):
        record[data.draw(st.integers(0, len(record) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    damaged = bytes(record[: data.draw(st.integers(0, len(record)))]) + data.draw(st.binary(max_size=2))
    try:
        rows = _core.decode_field(damaged, GRAPH.core, 12, 0)
    except FormatError:
        return
    assert rows.shape == (COUNT, 12)
    assert unpack(CodedField, damaged)[1] == len(damaged)
