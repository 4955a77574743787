"""Karhunen-Loeve transform of displacement trajectories (paper, section 3.3.3, eqs. 8-10).

In: a field of V trajectories of T displacements. Out: V x M weights in a basis whose numbers are integers over a power
of two, so that the stream contains exactly the basis that both sides use.

Differs from the paper: `forward` is the least-squares projection on the basis as transmitted, which is orthonormal only
up to its rounding; for an orthonormal basis both are eq. 8.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import _core
from ..geometry import strict
from ..shapes import Bool, Float64, Int64


@dataclass(frozen=True, slots=True)
class Basis:
    """Mean and principal directions of a group's trajectories, strongest first."""

    mean: Float64[np.ndarray, " C"]  # C = 3 T numbers, frame by frame; units of the field
    vectors: Float64[np.ndarray, "C M"]  # columns of unit length
    energies: Float64[np.ndarray, " M"]  # mean square of each weight, units of the field squared

    def only(self, kept: Bool[np.ndarray, " M"] | Int64[np.ndarray, " N"]) -> Basis:
        return Basis(self.mean, np.ascontiguousarray(self.vectors[:, kept]), self.energies[kept])


def fit(field: Float64[np.ndarray, "V T 3"]) -> Basis:
    """Compute the full basis of a field, M = 3 T, by decreasing energy; each vector's largest entry is positive."""
    vertices, frames, _ = field.shape
    trajectories = field.reshape(vertices, 3 * frames)
    return fit_about(trajectories.mean(axis=0) if vertices else np.zeros(3 * frames), trajectories)


def fit_about(mean: Float64[np.ndarray, " C"], trajectories: Float64[np.ndarray, "V C"]) -> Basis:
    """Compute the full basis of trajectories of C numbers about a given mean."""
    centered = trajectories - mean
    energies, vectors = strict.eigen(strict.products(centered.T, centered) / max(len(trajectories), 1))
    energies, vectors = np.maximum(energies[::-1], 0.0), vectors[:, ::-1]
    largest = vectors[np.abs(vectors).argmax(axis=0), np.arange(len(mean))] if len(mean) else np.zeros(0)
    return Basis(mean, np.ascontiguousarray(vectors * np.where(largest < 0, -1.0, 1.0)), energies.copy())


def forward(field: Float64[np.ndarray, "V T 3"], basis: Basis) -> Float64[np.ndarray, "V M"]:
    """Project each vertex's trajectory on the basis by least squares (eqs. 8 and 10)."""
    centered = field.reshape(len(field), len(basis.mean)) - basis.mean
    return strict.products(centered, _dual(basis.vectors))


def inverse(weights: Float64[np.ndarray, "V M"], basis: Basis) -> Float64[np.ndarray, "V T 3"]:
    """Reconstruct the field from its weights (eq. 9), summed in the order of the components."""
    vectors = np.ascontiguousarray(basis.vectors.T)
    field = _core.klt_inverse(np.ascontiguousarray(weights), vectors, np.ascontiguousarray(basis.mean))
    return field.reshape(len(weights), len(basis.mean) // 3, 3)


@dataclass(frozen=True, slots=True)
class BasisSymbols:
    """Basis in integers: `value = symbol * 2^-bits`, with separate bits for the mean and for each vector."""

    mean: Int64[np.ndarray, " C"]
    vectors: Int64[np.ndarray, "M C"]
    bits: Int64[np.ndarray, " M+1"]  # of the mean, then of each vector; 0 to 30


def quantize(basis: Basis, count: int, step: float) -> BasisSymbols:
    """Quantise the mean and the first `count` vectors, each as finely as a weight's quantiser `step` requires.

    `step` is in the field's units. Each vector is first made orthogonal to the rounded ones before it, so that later
    vectors compensate the rounding of earlier ones.
    """
    width = len(basis.mean)
    # Fraction bits of the mean and of each vector, with which rounding moves its amplitude by at most 1/32 of a step.
    amplitudes = [1.0, *np.sqrt(basis.energies[:count]).tolist()]
    bits = [min(max(strict.ceil_log2(max(16.0 * amplitude / step, 1.0)), 5), 24) for amplitude in amplitudes]
    rows, rounded = np.zeros((count, width), dtype=np.int64), np.zeros((width, 0))
    for k in range(count):
        direction = basis.vectors[:, k]
        if k:
            inside = strict.products(_dual(rounded).T, direction[:, None])
            direction = direction - strict.products(rounded, inside)[:, 0]
        length = strict.norm(direction)
        rows[k] = np.rint(direction / (length if length > 0.5 else 1.0) * 2.0 ** bits[k + 1]).astype(np.int64)
        rounded = np.concatenate([rounded, np.ldexp(rows[k].astype(np.float64), -bits[k + 1])[:, None]], axis=1)
    mean = np.rint(basis.mean * 2.0 ** bits[0]).astype(np.int64)
    return BasisSymbols(mean, rows, np.array(bits, dtype=np.int64))


def _dual(vectors: Float64[np.ndarray, "C M"]) -> Float64[np.ndarray, "C M"]:
    """Return the dual vectors: their scalar products with a point are the least-squares weights of the given ones."""
    gram = strict.products(vectors.T, vectors)
    return strict.products(vectors, strict.inverse(gram))


def dequantize(symbols: BasisSymbols) -> Basis:
    """Reconstruct the basis from its symbols exactly; energies are not transmitted and are zero."""
    mean = np.ldexp(symbols.mean.astype(np.float64), -int(symbols.bits[0]))
    vectors = np.ldexp(symbols.vectors.astype(np.float64), -symbols.bits[1:].astype(np.int32)[:, None])
    return Basis(mean, np.ascontiguousarray(vectors.T), np.zeros(len(vectors)))
