"""Choice of components and steps for a displacement field (encoder; reverse water-filling, paper section 3.3.3).

In: a field, its base's Laplacian system. Out: the basis as transmitted and each component's step, such that
distortion + price * rate is least: the distortion is the squared error after the least-squares inverse (the basis is
orthonormal up to rounding, so components add), the rate is the entropy coder's actual output.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...errors import InputError
from ...geometry.strict import log2
from ...geometry.topology import components
from ...shapes import Float64, Int32, Int64
from .. import entropy, klt
from ..steps import rung_of, step_of
from . import quantize
from .laplacian import System

WORTH = 1.8  # squared steps per bit, slope of the curve of distortion over rate (measured; decision 5)
LARGE = 1000  # vertices from which on a connected part gets all six anchors (decision 5): a guess
PRICE = 0.5  # price of a bit, in squared steps (guess)


@dataclass(frozen=True, slots=True)
class DisplacementOptions:
    """Options of the coding of displacements; lengths relative to the sequence's diagonal (anchors: decision 5)."""

    step: float = 8e-4  # quantiser step of a component; its error is about half of it
    basis_size: int | None = None  # number of components; None: those that pay
    anchor_count: int | None = None  # None: the better of six per connected part and one in twenty vertices
    anchor_weight: int = 4  # 1 to 255
    offsets: tuple[int, ...] = (0, -4, -2, 2, 4)  # steps tried for a component, from `step`, octaves / 8 (guess)
    dead_zone: float | None = None  # plain rounding, up from this fraction of a step, .5 to 1; None: shaped rounding

    def __post_init__(self) -> None:
        if self.basis_size is not None and self.basis_size < 0:
            raise InputError(f"basis size {self.basis_size}: give a number of components, 0 or more")


def alternatives(
    faces: Int32[np.ndarray, "F 3"], vertices: int, options: DisplacementOptions
) -> tuple[DisplacementOptions, ...]:
    """Return the options to try: few anchors with shaped rounding, and many with plain rounding (decision 5).

    Few win at fine steps, where shaped rounding keeps smooth errors small. At coarse steps most deltas are zero, and
    the result is the least-squares surface through the anchors, which must be many. A given number is kept.
    """
    if options.anchor_count is not None:
        return (replace(options, anchor_count=min(options.anchor_count, vertices)),)
    sizes = np.bincount(components(faces, vertices)) if vertices else np.zeros(0)
    few = int(np.ceil(np.minimum(sizes[sizes > 1] / LARGE, 1.0) * 6).sum())
    zone = 0.6 if options.dead_zone is None else options.dead_zone
    many = replace(options, anchor_count=max(vertices // 20, few), anchor_weight=1, dead_zone=zone)
    return replace(options, anchor_count=few), many


def cost(distortion: float, size: int, options: DisplacementOptions) -> float:
    """Return the cost that the encoder minimises: squared error of the field + WORTH squared steps per bit."""
    return distortion + WORTH * options.step**2 * 8 * size


def allocate(
    field: Float64[np.ndarray, "V T 3"], system: System, neighbours: entropy.Neighbours, options: DisplacementOptions
) -> tuple[klt.BasisSymbols, Int64[np.ndarray, " M"]]:
    """Choose the components and steps that minimise distortion + price * rate.

    Return the basis as transmitted, and the rung of each component's step.
    """
    basis = klt.fit(field)
    if options.basis_size is not None:
        chosen = np.arange(len(basis.energies)) < options.basis_size
    else:
        chosen = basis.energies > (0.4 * options.step) ** 2  # weaker components are not tried (guess)
    coded = _Components(field, basis.only(chosen), system, options)
    ladder = [np.full(coded.count, rung_of(options.step) + offset) for offset in options.offsets]
    values = np.array(
        [coded.value(round_deltas(coded.deltas, rungs, system, options), rungs, neighbours) for rungs in ladder]
    )
    rungs = np.choose(values.argmin(axis=0), ladder) if coded.count else ladder[0]
    dropped = (coded.weights**2).sum(axis=0)  # the distortion caused by leaving a component out
    pays = values.min(axis=0) < dropped if options.basis_size is None else np.ones(coded.count, dtype=bool)
    if not pays.all():
        chosen[chosen] = pays
        coded, rungs = _Components(field, basis.only(chosen), system, options), rungs[pays]
    return coded.basis, rungs


def round_deltas(
    deltas: Float64[np.ndarray, "R M"], rungs: Int64[np.ndarray, " M"], system: System, options: DisplacementOptions
) -> Int32[np.ndarray, "R M"]:
    """Round deltas to symbols; a symbol's price depends on the mean magnitude in its column."""
    steps, vertices = steps_of(rungs), system.vertices
    if options.dead_zone is not None:
        return quantize.forward(deltas, steps, options.dead_zone)
    price = PRICE * (options.step / steps) ** 2  # of a bit, in the component's own squared steps
    symbols = np.rint(deltas / steps)
    for _ in range(2):
        symbols = system.quantize(deltas, steps, price * _slopes(symbols[:vertices]))
    return symbols


class _Components:
    """Components of a field in the basis as transmitted, ready to be quantised at any steps."""

    def __init__(
        self, field: Float64[np.ndarray, "V T 3"], basis: klt.Basis, system: System, options: DisplacementOptions
    ) -> None:
        self.system, self.options = system, options
        self.count, self.vertices = len(basis.energies), len(field)
        self.basis = klt.quantize(basis, self.count, options.step)
        self.weights = klt.forward(field, klt.dequantize(self.basis))
        self.deltas = system.forward(self.weights)

    def value(
        self, symbols: Int32[np.ndarray, "R M"], rungs: Int64[np.ndarray, " M"], neighbours: entropy.Neighbours
    ) -> Float64[np.ndarray, " M"]:
        """Return distortion + price * rate of each component, which add because the basis is orthonormal."""
        error = self.system.inverse(symbols * steps_of(rungs)) - self.weights
        streams = entropy.encode_weights(symbols[: self.vertices], neighbours)
        bits = np.array([8.0 * len(stream) for stream in streams], dtype=np.float64)
        bits += log2(2.0 * np.abs(symbols[self.vertices :]) + 1).sum(axis=0)
        bits += log2(2.0 * np.abs(self.basis.vectors) + 1).sum(axis=1)
        return (error**2).sum(axis=0) + WORTH * self.options.step**2 * bits


def steps_of(rungs: Int64[np.ndarray, " M"]) -> Float64[np.ndarray, " M"]:
    return np.array([step_of(rung) for rung in rungs.tolist()], dtype=np.float64)


def _slopes(symbols: Float64[np.ndarray, "V M"] | Int32[np.ndarray, "V M"]) -> Float64[np.ndarray, " M"]:
    """Return the bits per unit of magnitude under a two-sided geometric law with each column's mean magnitude."""
    mean = np.maximum(np.abs(symbols).mean(axis=0, dtype=np.float64) if len(symbols) else 1.0, 1e-3)
    ratio = mean / (1 + np.sqrt(1 + mean**2))  # of mean = 2 r / (1 - r^2)
    return -log2(np.atleast_1d(ratio)) * np.ones(symbols.shape[1])
