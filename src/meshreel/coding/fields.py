"""Fields of trajectories <-> CodedField: KLT over time, closed-loop prediction over a causal graph, one entropy stream.

In: V trajectories of C numbers, a graph of their V vertices. Out: a CodedField, and the trajectories as it decodes to.
The basis is orthonormal but for its rounding, so all columns share one step. A column is kept where it pays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int32

from .. import _core
from ..errors import FormatError, InputError
from ..format.layout import CodedField
from . import entropy, klt
from .graph import Graph
from .steps import LEVELS, step_of

MOST_BITS = 30
FINENESS = 4.0  # a basis vector's rounding moves its column's typical weight by 1 / (2 FINENESS) steps


@dataclass(frozen=True, slots=True)
class Rate:
    """What a field is coded with."""

    step_level: int
    price: float  # of a bit, squared steps

    @property
    def step(self) -> float:
        """The quantiser's step, units of the field."""
        return step_of(self.step_level)


@dataclass(frozen=True, slots=True)
class EncodedField:
    """A field's record and what both sides know of it."""

    record: CodedField
    has_mean: bool
    decoded: Float64[np.ndarray, "C V"]
    basis_bits: int
    symbol_bits: int


def encode_field(
    trajectories: Float64[np.ndarray, "V C"], graph: Graph, rate: Rate, may_have_mean: bool
) -> EncodedField:
    """The columns that pay, quantised in a closed loop."""
    width = trajectories.shape[1]
    mean = trajectories.mean(axis=0) if may_have_mean and len(trajectories) else np.zeros(width)
    worth = rate.price * rate.step**2 * width * np.log2(2 + 16 * np.abs(mean).max(initial=0) / rate.step)
    has_mean = bool(len(trajectories) * (mean**2).sum() > worth)
    basis = klt.fit_about(mean if has_mean else np.zeros(width), trajectories)
    kept = np.flatnonzero(basis.energies > (0.2 * rate.step) ** 2)
    coded = _Columns(trajectories, _only(basis, kept), graph, rate)
    while not (pays := coded.pays()).all():
        kept = kept[pays]
        coded = _Columns(trajectories, _only(basis, kept), graph, rate)
    packed = _pack_basis(coded.basis, has_mean)
    record = CodedField(len(kept), rate.step_level, packed, coded.stream)
    sizes = (8 * len(packed), 8 * len(coded.stream))
    return EncodedField(record, has_mean, _transform(coded.decoded, klt.dequantize(coded.basis)), *sizes)


def decode_field(record: CodedField, graph: Graph, width: int, has_mean: bool) -> Float64[np.ndarray, "C V"]:
    """The trajectories of a record, number by number. Raises FormatError where it holds none of this width."""
    count = len(graph.starts) - 1
    if record.columns > width or record.step_level >= LEVELS:
        raise FormatError(f"{record.columns} columns of {width} numbers at step level {record.step_level}")
    basis = _unpack_basis(record, width, has_mean)
    entropy.check_plausible(count * record.columns, len(record.symbols), "symbols")
    symbols = np.empty((record.columns, count), np.int32)
    if not _core.decode_field(record.symbols, symbols, graph.starts, graph.near):
        raise FormatError(f"{len(record.symbols)} bytes of symbols are truncated or damaged")
    columns = _core.predict_inverse(symbols, graph.starts, graph.near, graph.weights, step_of(record.step_level))
    return _transform(columns, basis)


class _Columns:
    """Columns of a field in the basis as transmitted, quantised and coded."""

    def __init__(
        self, trajectories: Float64[np.ndarray, "V C"], basis: klt.Basis, graph: Graph, rate: Rate
    ) -> None:
        self.rate = rate
        self.basis = klt.quantize(basis, len(basis.energies), rate.step, FINENESS)
        self.weights = np.ascontiguousarray(klt.project(trajectories, klt.dequantize(self.basis)).T)
        if np.abs(self.weights).max(initial=0) > 1e9 * rate.step:
            raise InputError(f"a trajectory {np.abs(self.weights).max():g} long is too long for step {rate.step:g}")
        self.symbols, self.decoded = _core.predict_forward(
            self.weights, graph.starts, graph.near, graph.weights, rate.step, rate.price
        )
        self.stream, self.sizes = _core.encode_field(self.symbols, graph.starts, graph.near)

    def pays(self) -> Bool[np.ndarray, " M"]:
        """True for the columns whose absence would cost more than they do."""
        bits = 8.0 * self.sizes + np.log2(2.0 * np.abs(self.basis.vectors) + 1).sum(axis=1)
        saved = (self.weights**2).sum(axis=1) - ((self.weights - self.decoded) ** 2).sum(axis=1)
        return saved > self.rate.price * self.rate.step**2 * bits


def _only(basis: klt.Basis, kept: Int32[np.ndarray, " M"]) -> klt.Basis:
    return klt.Basis(basis.mean, np.ascontiguousarray(basis.vectors[:, kept]), basis.energies[kept])


def _transform(columns: Float64[np.ndarray, "M V"], basis: klt.Basis) -> Float64[np.ndarray, "C V"]:
    return _core.transform_inverse(columns, np.ascontiguousarray(basis.vectors.T), basis.mean)


def _pack_basis(basis: klt.BasisSymbols, has_mean: bool) -> bytes:
    """One integer stream: the bits, each less those before it, then the mean where there is one, then the vectors."""
    bits = basis.bits if has_mean else basis.bits[1:]
    values = [np.diff(bits, prepend=0), basis.mean if has_mean else basis.mean[:0], basis.vectors.reshape(-1)]
    return entropy.encode_integers(np.concatenate(values).astype(np.int32))


def _unpack_basis(record: CodedField, width: int, has_mean: bool) -> klt.Basis:
    rows = record.columns + has_mean
    values = entropy.decode_integers(record.basis, rows * (1 + width)).astype(np.int64)
    bits = np.cumsum(values[:rows])
    if len(bits) and (bits.min() < 0 or bits.max() > MOST_BITS):
        raise FormatError(f"a basis of {bits.min()} to {bits.max()} bits")
    table = values[rows:].reshape(rows, width)
    mean, bits = (table[0], bits) if has_mean else (np.zeros(width, np.int64), np.concatenate([[0], bits]))
    return klt.dequantize(klt.BasisSymbols(mean, table[int(has_mean) :], bits))
