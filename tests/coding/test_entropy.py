"""The range coder: inverse laws, rate against the entropy of its own contexts, hostile bytes."""

import contextlib

import hypothesis.extra.numpy as hnp
import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from meshreel import _core
from meshreel.coding import entropy
from meshreel.errors import FormatError

INT32 = st.integers(-(2**31), 2**31 - 1)
Body = tuple[np.ndarray, entropy.Neighbours, list[bytes]]
GOLDEN_INTEGERS = "ff3e06a8c57c7dc8fef3bc63d3022fff"
GOLDEN_WEIGHTS = ["25b64d5a7fbd0b", "04860f25fe383fc0bb47"]
SMALL_OR_ANY = st.one_of(st.integers(-3, 3), st.integers(-3000, 3000), INT32)


@given(st.lists(SMALL_OR_ANY, max_size=60))
def test_integers_survive_a_round_trip(values: list[int]) -> None:
    array = np.array(values, np.int32)
    assert np.array_equal(entropy.decode_integers(entropy.encode_integers(array), len(array)), array)


@given(hnp.arrays(np.int32, st.tuples(st.integers(0, 40), st.integers(0, 4)), elements=SMALL_OR_ANY), st.data())
def test_weights_survive_a_round_trip_on_any_faces(symbols: np.ndarray, data: st.DataObject) -> None:
    count = len(symbols)
    index = st.integers(0, max(count - 1, 0))
    shape = st.tuples(st.integers(0, 50 if count else 0), st.just(3))
    neighbours = entropy.causal_neighbours(data.draw(hnp.arrays(np.int32, shape, elements=index)), count)
    streams = entropy.encode_weights(symbols, neighbours)
    assert np.array_equal(entropy.decode_weights(streams, count, neighbours), symbols)


def test_extreme_values_cost_their_bits_and_no_more() -> None:
    values = np.array([2**31 - 1, -(2**31)] * 500, np.int32)
    data = entropy.encode_integers(values)
    assert np.array_equal(entropy.decode_integers(data, 1000), values)
    assert len(data) <= 1000 * 33 / 8 * 1.02


def test_one_symbol_takes_a_few_bytes_and_an_empty_array_none() -> None:
    no_neighbours = entropy.causal_neighbours(np.zeros((0, 3), np.int32), 1)
    streams = entropy.encode_weights(np.array([[0, 1, -5]], np.int32), no_neighbours)
    assert max(map(len, streams)) <= 3
    assert entropy.encode_integers(np.zeros(0, np.int32)) == b""


def test_a_column_of_zeros_is_next_to_free() -> None:
    neighbours = entropy.causal_neighbours(_grid(100), 10_000)
    assert max(len(s) for s in entropy.encode_weights(np.zeros((10_000, 3), np.int32), neighbours)) <= 4


def test_causal_neighbours_are_the_smaller_ones_sorted() -> None:
    neighbours = entropy.causal_neighbours(np.array([[0, 1, 2], [2, 1, 3], [3, 3, 0]], np.int32), 5)
    assert neighbours.indptr.tolist() == [0, 0, 1, 3, 6, 6]
    assert neighbours.indices.tolist() == [0, 0, 1, 0, 1, 2]


def test_any_prefix_of_the_columns_decodes_alike(body: Body) -> None:
    symbols, neighbours, streams = body
    for columns in range(symbols.shape[1] + 1):
        prefix = entropy.decode_weights(streams[:columns], len(symbols), neighbours)
        assert np.array_equal(prefix, symbols[:, :columns])


def test_the_rate_is_within_three_percent_of_the_entropy_of_its_contexts(body: Body) -> None:
    symbols, neighbours, streams = body
    bound = _context_entropy(symbols, neighbours)
    assert 8 * sum(map(len, streams)) <= 1.03 * bound
    plain = sum(_entropy(symbols[:, c], np.zeros(len(symbols))) for c in range(symbols.shape[1]))
    assert bound < 0.97 * plain  # contexts are worth something on a mesh whose scale varies


def test_the_rate_is_near_that_of_an_ideal_coder_with_the_same_contexts(body: Body) -> None:
    """constriction's ANS with each context's empirical distribution is the oracle of the bound above."""
    pytest.importorskip("constriction", reason="no wheel for this platform")
    symbols, neighbours, streams = body
    sizes, signs = _contexts(symbols, neighbours)
    bits = 0
    for c in range(symbols.shape[1]):
        column, moves = symbols[:, c], symbols[:, c] != 0
        bits += _ans_bits(np.abs(column), sizes[:, c]) + _ans_bits((column < 0)[moves], signs[moves, c])
    assert bits == pytest.approx(_context_entropy(symbols, neighbours), rel=0.005)
    assert 8 * sum(map(len, streams)) <= 1.03 * bits


def test_columns_that_move_together_predict_each_other(body: Body) -> None:
    symbols, neighbours, streams = body
    lead = symbols[:, :1]
    first, second = entropy.encode_weights(np.concatenate([lead, -lead], axis=1), neighbours)
    assert len(second) < 0.5 * len(first)
    assert first == streams[0]


@given(st.lists(SMALL_OR_ANY, min_size=1, max_size=30), st.integers(0, 255))
def test_every_truncation_and_an_extra_byte_are_errors_for_integers(values: list[int], extra: int) -> None:
    data = entropy.encode_integers(np.array(values, np.int32))
    for bad in [data[:k] for k in range(len(data))] + [data + bytes([extra])]:
        with pytest.raises(FormatError):
            entropy.decode_integers(bad, len(values))


@given(seed=st.integers(0, 2**32 - 1), scale=st.sampled_from([0.02, 0.3, 5.0, 1e6]), extra=st.integers(0, 255))
def test_every_truncation_and_an_extra_byte_are_errors_for_weights(seed: int, scale: float, extra: int) -> None:
    symbols = np.random.default_rng(seed).laplace(0, scale, (64, 2)).astype(np.int32)
    neighbours = entropy.causal_neighbours(_grid(8), 64)
    first, second = entropy.encode_weights(symbols, neighbours)
    for bad in [second[:k] for k in range(len(second))] + [second + bytes([extra])]:
        with pytest.raises(FormatError, match="column 1"):
            entropy.decode_weights([first, bad], 64, neighbours)


def test_the_last_bytes_cannot_be_dropped_even_where_the_rest_is_silence() -> None:
    values = np.zeros(5000, np.int32)
    values[:40] = np.arange(40)
    data = entropy.encode_integers(values)
    for k in range(len(data)):
        with pytest.raises(FormatError):
            entropy.decode_integers(data[:k], len(values))


@given(position=st.integers(0, 10**6), value=st.integers(1, 255))
def test_a_flipped_byte_gives_other_symbols_or_an_error(position: int, value: int) -> None:
    symbols = np.random.default_rng(1).laplace(0, 2, (64, 1)).astype(np.int32)
    neighbours = entropy.causal_neighbours(_grid(8), 64)
    stream = bytearray(entropy.encode_weights(symbols, neighbours)[0])
    stream[position % len(stream)] ^= value
    _assert_refused_or_other(bytes(stream), symbols, neighbours)


@given(st.binary(max_size=200), st.integers(0, 64))
def test_garbage_never_crashes(data: bytes, count: int) -> None:
    neighbours = entropy.causal_neighbours(np.zeros((0, 3), np.int32), count)
    with contextlib.suppress(FormatError):
        entropy.decode_integers(data, count)
    with contextlib.suppress(FormatError):
        entropy.decode_weights([data], count, neighbours)


@pytest.mark.parametrize("count", [-1, 2**31, 2**62])
def test_an_absurd_count_is_refused_before_memory_is_allocated(count: int) -> None:
    with pytest.raises(FormatError, match=str(count)):
        entropy.decode_integers(b"\x80\x00\x00", count)


@pytest.mark.parametrize("bad", [-1, 3, 2**31 - 1])
def test_a_face_out_of_range_is_refused(bad: int) -> None:
    with pytest.raises(FormatError, match=str(bad)):
        entropy.causal_neighbours(np.array([[0, 1, bad]], np.int32), 3)


def test_neighbours_that_are_not_causal_are_refused() -> None:
    loop = entropy.Neighbours(np.array([0, 1, 1], np.int64), np.array([1], np.int32))
    with pytest.raises(ValueError, match="smaller"):
        entropy.encode_weights(np.zeros((2, 1), np.int32), loop)


def test_golden_bytes_decode_for_ever() -> None:
    values = np.array([0, 1, -1, 300, -(2**31), 2**31 - 1, 7, 7], np.int32)
    assert entropy.encode_integers(values).hex() == GOLDEN_INTEGERS
    assert np.array_equal(entropy.decode_integers(bytes.fromhex(GOLDEN_INTEGERS), len(values)), values)
    neighbours = entropy.causal_neighbours(_grid(4), 16)
    symbols = np.stack([np.arange(16) % 5 - 2, (np.arange(16) * 37) % 11 - 5], axis=1).astype(np.int32)
    assert [s.hex() for s in entropy.encode_weights(symbols, neighbours)] == GOLDEN_WEIGHTS
    golden = [bytes.fromhex(s) for s in GOLDEN_WEIGHTS]
    assert np.array_equal(entropy.decode_weights(golden, 16, neighbours), symbols)


@pytest.fixture(scope="module")
def body() -> Body:
    """20 736 x 4 Laplacian symbols on a grid whose scale varies over the surface, and their streams."""
    side = 144
    x, y = np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side))
    scale = np.exp(2 * np.sin(7 * x) * np.cos(5 * y)).ravel()[:, None] * np.array([3.0, 1.5, 0.8, 0.4])
    symbols = np.rint(np.random.default_rng(0).laplace(0, scale)).astype(np.int32)
    neighbours = entropy.causal_neighbours(_grid(side), side * side)
    return symbols, neighbours, entropy.encode_weights(symbols, neighbours)


def _grid(side: int) -> np.ndarray:
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    lower = np.stack([corner, corner + 1, corner + side], axis=1)
    upper = np.stack([corner + 1, corner + side + 1, corner + side], axis=1)
    return np.concatenate([lower, upper]).astype(np.int32)


def _entropy(values: np.ndarray, context: np.ndarray) -> float:
    """Bits of the values under each context's own empirical distribution."""
    bits = 0.0
    for index in np.unique(context):
        counts = np.unique(values[context == index], return_counts=True)[1]
        bits -= float((counts * np.log2(counts / counts.sum())).sum())
    return bits


def _context_entropy(symbols: np.ndarray, neighbours: entropy.Neighbours) -> float:
    sizes, signs = _contexts(symbols, neighbours)
    bits = 0.0
    for c in range(symbols.shape[1]):
        moves = symbols[:, c] != 0
        bits += _entropy(np.abs(symbols[:, c]), sizes[:, c]) + _entropy(symbols[moves, c] < 0, signs[moves, c])
    return bits


def _ans_bits(values: np.ndarray, context: np.ndarray) -> int:
    import constriction

    coder = constriction.stream.stack.AnsCoder()
    for index in np.unique(context):
        alphabet, coded, counts = np.unique(values[context == index], return_inverse=True, return_counts=True)
        if len(alphabet) > 1:
            model = constriction.stream.model.Categorical((counts / counts.sum()).astype(np.float32), perfect=False)
            coder.encode_reverse(coded.astype(np.int32), model)
    return int(coder.num_valid_bits())


def _assert_refused_or_other(stream: bytes, symbols: np.ndarray, neighbours: entropy.Neighbours) -> None:
    try:
        decoded = entropy.decode_weights([stream], len(symbols), neighbours)
    except FormatError:
        return
    assert not np.array_equal(decoded, symbols)  # streams are canonical


def _contexts(symbols: np.ndarray, neighbours: entropy.Neighbours) -> tuple[np.ndarray, np.ndarray]:
    """The contexts in which the coder codes each symbol's magnitude (< 15) and sign (< 48; 0 for a zero)."""
    columns = np.array(symbols.T, dtype=np.int32, order="C")
    sizes, signs = np.zeros(columns.shape, np.uint8), np.zeros(columns.shape, np.uint8)
    _core.weight_contexts(columns, neighbours.indptr, neighbours.indices, sizes, signs)
    return sizes.T, signs.T
