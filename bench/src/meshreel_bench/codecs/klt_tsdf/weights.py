"""Blocks <-> weights of the components: projection and quantisation, and distances from symbols again.

Beyond truncation only the sign and that the distance is large counts (Tang et al. 2018). Weights are quantised in turn,
each rounding made good by those to come. `distances` is in integers: the same on every platform.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32

from .basis import ONE, Basis
from .grid import Blocks

TRUNCATION = 3.0  # voxels
STEP_ONE = 1 << 12  # what a step of 1 voxel is in the stream
_FAR = 0.03  # what a voxel counts that no crossed edge ends at
_ROUNDS = 3  # of the targets beyond truncation
_NOISE = 0.001  # voxels squared, against which the energies of the components count
_CHUNK = 400  # blocks whose systems are in memory at once
LARGEST = 1 << 20  # of a weight in units of 1 / STEP_ONE: sums stay exact


@dataclass(frozen=True, slots=True)
class Model:
    """Values shared by encoder and decoder."""

    basis: Basis
    step: int  # of the weights, in units of 1 / STEP_ONE voxels


def trust(blocks: Blocks) -> Float64[np.ndarray, "B N"]:
    """Return the weight of each voxel in the fit."""
    return np.where(blocks.near, 1.0, np.where(blocks.known, _FAR, 0.0))


def beyond(
    values: Float64[np.ndarray, "B N"], fitted: Float64[np.ndarray, "B N"], truncation: float = TRUNCATION
) -> Float64[np.ndarray, "B N"]:
    """The distances to fit: beyond truncation what is fitted already, if it is beyond truncation on that side, too."""
    side = np.where(values < 0, -1.0, 1.0)
    return np.where(np.abs(values) > truncation, side * np.maximum(side * fitted, truncation), values)


def forward(blocks: Blocks, model: Model, energies: Float64[np.ndarray, " M"]) -> Int32[np.ndarray, "B M"]:
    """The symbols of the weights; `energies` are the mean squares to expect, voxels squared."""
    symbols = np.zeros((len(blocks.places), model.basis.vectors.shape[1]), np.int32)
    counts = trust(blocks)
    for start in range(0, len(symbols), _CHUNK):
        part = slice(start, start + _CHUNK)
        symbols[part] = _quantised(*_fit(blocks.values[part], counts[part], model, energies), model.step)
    return symbols


def _fit(
    values: Float64[np.ndarray, "B N"],
    counts: Float64[np.ndarray, "B N"],
    model: Model,
    energies: Float64[np.ndarray, " M"],
) -> tuple[Float64[np.ndarray, "B M"], Float64[np.ndarray, "B M M"]]:
    """Weights in voxels, and the matrix of the squared error that each leaves."""
    vectors, mean = model.basis.vectors / ONE, model.basis.mean / ONE
    noise = _NOISE + (model.step / STEP_ONE) ** 2 / 12
    gram = np.matmul(vectors.T, counts[:, :, None] * vectors) + np.diag(noise / energies)
    inverse = np.linalg.inv(gram)
    weights = np.zeros((len(values), vectors.shape[1]))
    for round_ in range(_ROUNDS):
        target = (
            beyond(values, mean + weights @ vectors.T) if round_ else np.clip(values, -2 * TRUNCATION, 2 * TRUNCATION)
        )
        weights = np.einsum("bij,bj->bi", inverse, (counts * (target - mean)) @ vectors)
    return weights, inverse


def _quantised(
    weights: Float64[np.ndarray, "B M"], inverse: Float64[np.ndarray, "B M M"], step: int
) -> Int32[np.ndarray, "B M"]:
    """The symbols; what rounding a weight costs is spread over those after it, by least squares."""
    unit = step / STEP_ONE
    symbols = np.zeros(weights.shape, np.int32)
    upper = np.swapaxes(np.linalg.cholesky(inverse), 1, 2)
    rest = weights.copy()
    for k in range(weights.shape[1]):
        symbols[:, k] = np.rint(rest[:, k] / unit)
        error = (rest[:, k] - symbols[:, k] * unit) / upper[:, k, k]
        rest[:, k:] -= error[:, None] * upper[:, k, k:]
    return symbols


def distances(weights: Float64[np.ndarray, "B M"], basis: Basis) -> Float64[np.ndarray, "B N"]:
    """The distances of whole weights: products and sums of integers below 2^53, exact in any order."""
    return weights @ basis.vectors.T + STEP_ONE * basis.mean
