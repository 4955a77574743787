"""Which components a displacement field gets, and its symbols (encoder; reverse water-filling, paper section 3.3.3).

In: a field, its base's Laplacian system. Out: the basis as transmitted and each component's step and symbols, such that
distortion + price * rate is least: the distortion is the squared error after the least-squares inverse (the basis is
orthonormal but for its rounding, so components add), the rate is what the entropy coder really spends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from ..errors import InputError
from ..format.layout import AnchorRule
from ..geometry.topology import components
from . import entropy, klt, quantize
from .laplacian import System
from .steps import LEVELS, level_of, step_of

WORTH = 1.8  # squared steps that a bit saves along the curve of distortion over rate (measured)
LARGE = 1000  # vertices of a component that deserves all six anchors


@dataclass(frozen=True, slots=True)
class DisplacementOptions:
    """How displacements are coded; lengths relative to the sequence's diagonal."""

    step: float = 1.2e-3  # quantiser step of a component; the error is about half of it a component
    basis_size: int | None = None  # exactly so many components; None: as many as pay
    price: float = 0.5  # of one bit, in squared steps
    anchor_rule: AnchorRule = AnchorRule.FARTHEST
    anchor_count: int | None = None  # None: the better of six a connected component and one in twenty vertices
    anchor_weight: int = 4  # 1 to 255
    dead_zone: float | None = None  # None: shaped rounding; plain rounding up from this fraction of a step, .5 to 1

    def __post_init__(self) -> None:
        finest, coarsest = step_of(LEVELS - 1), step_of(0)
        if not finest <= self.step <= coarsest:
            raise InputError(f"step {self.step}: give a fraction of the diagonal in {finest:.2g} .. {coarsest:g}")
        if self.basis_size is not None and self.basis_size < 0:
            raise InputError(f"basis size {self.basis_size}: give a number of components, 0 or more")
        if not 0 <= self.price < 10:
            raise InputError(f"price {self.price}: give squared steps a bit, 0 to 10")
        if self.dead_zone is not None and not 0.5 <= self.dead_zone < 1:
            raise InputError(f"dead zone {self.dead_zone}: give a fraction of a step in [0.5, 1), or None")
        if (self.anchor_count or 0) < 0 or not 1 <= self.anchor_weight <= 255:
            raise InputError(
                f"{self.anchor_count} anchors of weight {self.anchor_weight}: give 0 or more, weighing 1 to 255"
            )


def alternatives(
    faces: Int32[np.ndarray, "F 3"], vertices: int, options: DisplacementOptions
) -> tuple[DisplacementOptions, ...]:
    """The options with a number of anchors: few with shaped rounding, and many with plain rounding.

    Few win at fine steps, where the quantiser keeps smooth errors small itself; at coarse steps most deltas are zero,
    and the surface that the least squares lay through many anchors is what is left.
    """
    if options.anchor_count is not None:
        return (replace(options, anchor_count=min(options.anchor_count, vertices)),)
    sizes = np.bincount(components(faces, vertices)) if vertices else np.zeros(0)
    few = int(np.ceil(np.minimum(sizes[sizes > 1] / LARGE, 1.0) * 6).sum())
    many = replace(options, anchor_count=max(vertices // 20, few), anchor_weight=1, dead_zone=0.6)
    return replace(options, anchor_count=few), many


def cost(distortion: float, size: int, options: DisplacementOptions) -> float:
    """What the encoder makes small: squared error of the field + WORTH squared steps a bit of `size` bytes."""
    return distortion + WORTH * options.step**2 * 8 * size


@dataclass(frozen=True, slots=True)
class Allocation:
    """What the encoder has decided."""

    basis: klt.BasisSymbols
    levels: Int64[np.ndarray, " M"]  # of each component's step
    symbols: Int32[np.ndarray, "R M"]  # V deltas, then l anchors


def allocate(
    field: Float64[np.ndarray, "V T 3"], system: System, neighbours: entropy.Neighbours, options: DisplacementOptions
) -> Allocation:
    """The components, steps and symbols of least distortion + price * rate."""
    basis = klt.fit(field)
    if options.basis_size is not None:
        return _quantize(field, basis, np.arange(len(basis.energies)) < options.basis_size, system, options)
    kept = basis.energies > (0.4 * options.step) ** 2
    trial = _quantize(field, basis, kept, system, options)
    pays = kept.copy()
    pays[kept] = _pays(field, trial, system, neighbours, options)
    return trial if np.array_equal(pays, kept) else _quantize(field, basis, pays, system, options)


def _quantize(
    field: Float64[np.ndarray, "V T 3"],
    basis: klt.Basis,
    kept: Bool[np.ndarray, " C"],
    system: System,
    options: DisplacementOptions,
) -> Allocation:
    """Symbols of the kept components at the step; the price of a symbol comes from how large its column's are."""
    chosen = klt.Basis(basis.mean, np.ascontiguousarray(basis.vectors[:, kept]), basis.energies[kept])
    rounded = klt.quantize(chosen, int(kept.sum()), options.step)
    deltas = system.forward(klt.forward(field, klt.dequantize(rounded)))
    levels = np.full(deltas.shape[1], level_of(options.step))
    steps = np.full(deltas.shape[1], step_of(level_of(options.step)))
    if options.dead_zone is not None:
        return Allocation(rounded, levels, quantize.forward(deltas, steps, options.dead_zone))
    symbols = np.rint(deltas / steps)
    for _ in range(2):
        symbols = system.quantize(deltas, steps, options.price * _slopes(symbols[: len(field)]))
    return Allocation(rounded, levels, symbols)


def _pays(
    field: Float64[np.ndarray, "V T 3"],
    trial: Allocation,
    system: System,
    neighbours: entropy.Neighbours,
    options: DisplacementOptions,
) -> Bool[np.ndarray, " M"]:
    """Which components lower distortion + price * rate."""
    weights = klt.forward(field, klt.dequantize(trial.basis))
    steps = np.array([step_of(level) for level in trial.levels.tolist()])
    error = system.inverse(trial.symbols * steps) - weights
    gain = (weights**2).sum(axis=0) - (error**2).sum(axis=0)
    bits = entropy.weights_cost(trial.symbols[: len(field)], neighbours)
    bits += np.log2(2.0 * np.abs(trial.symbols[len(field) :]) + 1).sum(axis=0)
    bits += np.log2(2.0 * np.abs(trial.basis.vectors) + 1).sum(axis=1)
    return gain > WORTH * options.step**2 * bits


def _slopes(symbols: Float64[np.ndarray, "V M"] | Int32[np.ndarray, "V M"]) -> Float64[np.ndarray, " M"]:
    """Bits that a unit of magnitude costs where magnitudes follow a two-sided geometric law of each column's mean."""
    mean = np.maximum(np.abs(symbols).mean(axis=0, dtype=np.float64) if len(symbols) else 1.0, 1e-3)
    ratio = mean / (1 + np.sqrt(1 + mean**2))  # of mean = 2 r / (1 - r^2)
    return -np.log2(ratio) * np.ones(symbols.shape[1])
