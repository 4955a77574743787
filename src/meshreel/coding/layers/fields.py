"""Encode fields of trajectories: KLT over time, closed-loop prediction over a causal graph, one entropy stream.

In: V trajectories of C numbers, a graph of their V vertices. Out: a CodedField, and the trajectories as it decodes to.
The decoded basis is orthonormal, so all columns share one step. A column is kept if it pays.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ... import _core
from ...errors import InputError
from ...format.layout import CodedField
from ...format.records import pack
from ...geometry import strict
from ...shapes import Bool, Float64, Int32
from .. import entropy, klt
from ..steps import step_of
from . import orthonormal
from .graph import Graph

NOTHING = np.zeros(0, np.int32)
FINENESS = 20.0  # rounding a basis vector moves its column's typical weight by about 1 / FINENESS of a step: a guess
LEAST_SCALE = 6.0  # smallest scale of a basis vector: rounding moves each of its numbers by at most 1/12; a guess
MOST_SCALE = 2.0**24  # largest scale of a basis vector, far within 32 bits
LEAST_RMS = 0.2  # steps, smallest RMS weight of a column; weights of weaker ones nearly all round to 0: a guess
MOST_WEIGHT = 1e9  # steps, largest weight: its prediction residual, at most twice as large, fits 32 bits


@dataclass(frozen=True, slots=True)
class Rate:
    """Quantiser step of a field, and the price of its bits."""

    rung: int  # of the ladder of quantiser steps
    price: float  # of a bit, in squared steps
    least: float = 0.0  # least RMS weight of a column, except the strongest, in the field's unit: weaker ones are noise

    @property
    def step(self) -> float:
        """Quantiser step, in the field's unit."""
        return step_of(self.rung)


@dataclass(frozen=True, slots=True)
class SurfaceWeight:
    """Weights of the errors of positions on a surface: those along the surface count less than those across it."""

    normals: Float64[np.ndarray, "V C"]  # of each vertex in each frame, of unit length or zero
    tangential: float  # weight of a squared error along the surface, 0 to 1


@dataclass(frozen=True)
class EncodedField:
    """Record of a field over a graph, with derived values."""

    record: CodedField
    graph: Graph
    width: int  # numbers of a trajectory
    head: int  # integers before those of the basis

    @cached_property
    def decoded(self) -> Float64[np.ndarray, "V C"]:
        """The decoded trajectories, computed on first use."""
        return decode_field(self.record, self.graph, self.width, self.head)


def encode_field(
    trajectories: Float64[np.ndarray, "V C"],
    graph: Graph,
    rate: Rate,
    surface: SurfaceWeight | None = None,
    head: Int32[np.ndarray, " N"] = NOTHING,
) -> EncodedField:
    """Encode the columns that pay, quantised in a closed loop; `surface` marks positions.

    Integers of the `head`, as of motion that all vertices share, are packed before those of the basis.
    """
    width = trajectories.shape[1]
    basis = klt.fit_about(np.zeros(width), trajectories)
    least = np.full(len(basis.energies), max(LEAST_RMS * rate.step, rate.least))
    least[:1] = LEAST_RMS * rate.step  # the strongest column is never noise
    chosen = np.flatnonzero(basis.energies > least**2)
    coded = _Columns(trajectories, basis.only(chosen), graph, rate, surface)
    while not (pays := coded.pays()).all():
        chosen = chosen[pays]
        coded = _Columns(trajectories, basis.only(chosen), graph, rate, surface)
    packed = entropy.encode_integers(np.concatenate([head, coded.basis]))
    return EncodedField(CodedField(len(chosen), rate.rung, packed, coded.stream), graph, width, len(head))


def decode_field(record: CodedField, graph: Graph, width: int, head: int = 0) -> Float64[np.ndarray, "V C"]:
    """Decode the trajectories of a record whose head has `head` integers.

    Raises FormatError if it is damaged or has another width or head.
    """
    return _core.decode_field(pack(record), graph.core, width, head)


class _Columns:
    """Columns of a field in the transmitted basis, quantised and coded."""

    def __init__(
        self,
        trajectories: Float64[np.ndarray, "V C"],
        basis: klt.Basis,
        graph: Graph,
        rate: Rate,
        surface: SurfaceWeight | None,
    ) -> None:
        self.rate = rate
        count, width = len(basis.energies), trajectories.shape[1]
        scales = FINENESS * np.sqrt(width / 12 * basis.energies) / rate.step
        scales = np.clip(scales, LEAST_SCALE, MOST_SCALE)
        self.basis = orthonormal.forward(np.ascontiguousarray(basis.vectors.T), scales)
        self.vectors = orthonormal.inverse(self.basis, count, width)
        self.weights = strict.products(self.vectors, trajectories.T)
        if np.abs(self.weights).max(initial=0) > MOST_WEIGHT * rate.step:
            raise InputError(f"a trajectory {np.abs(self.weights).max():g} long is too long for step {rate.step:g}")
        if surface is None:
            coded = _core.predict_forward(self.weights, graph.core, rate.step, rate.price)
        else:
            metric = _core.Surface(self.vectors, surface.normals, surface.tangential)
            coded = _core.predict_surface(self.weights, graph.core, metric, rate.step, rate.price)
        self.symbols, self.decoded = coded
        self.stream, self.sizes = _core.encode_field(self.symbols, graph.core)

    def pays(self) -> Bool[np.ndarray, " M"]:
        """Return a mask of the columns whose absence would cost more than their bits."""
        count, width = self.vectors.shape
        basis_bits = strict.log2(2.0 * np.abs(self.basis) + 1)
        rows = np.repeat(np.arange(count), width - np.arange(count))
        bits = 8.0 * self.sizes + np.bincount(rows, basis_bits, count)
        saved = (self.weights**2).sum(axis=1) - ((self.weights - self.decoded) ** 2).sum(axis=1)
        return saved > self.rate.price * self.rate.step**2 * bits
