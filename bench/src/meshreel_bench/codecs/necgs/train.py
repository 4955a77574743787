"""Training of the auto-decoder (NeCGS, section 3.2): volumes -> symbols of the embedded features and of the network.

Features and parameters are rounded in every step, so that they are fit for it. The loss is eq. 3: the mean absolute
error, that of points near the surface 5 times, and `structure` times what two structural similarities lack of 1. The
extra `necgs`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from .network import choose_device, decode_volumes, initial_parameters, repeatable, rounded, to_symbols
from .shape import SIDE, Shape

NEAR = 5.0  # lambda 1
SMALL_FEATURES = 0.1  # weight of the features' mean size, as in the authors' code
_WARM = 0.2  # share of the epochs in which the learning rate rises
_WINDOW, _SIGMA = 11, 1.5  # points, of the structural similarity
_STABLE = (0.01**2, 0.03**2)

Volumes = Sequence[np.ndarray]  # K x K x K x 4 each
Told = Callable[[int, int], None]  # epochs done, epochs


@dataclass(frozen=True, slots=True)
class Training:
    """How long, how fast and from where."""

    epochs: int = 400
    batch: int = 4  # frames a step
    rate: float = 1e-3  # of Adam, at its highest
    structure: float = 10.0  # lambda 2, weight of the structural similarities
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Trained:
    """Symbols: of every frame's feature, and of every tensor of the network, flat."""

    features: np.ndarray  # N x features, int32
    parameters: list[np.ndarray]


def train(volumes: Volumes, shape: Shape, options: Training, device: str, told: Told) -> Trained:
    """The symbols of at least one volume; the same ones for the same seed on the same machine."""
    with repeatable():
        return _train(volumes, shape, options, _Target(device, told))


@dataclass(frozen=True, slots=True)
class _Target:
    device: str
    told: Told


def _train(volumes: Volumes, shape: Shape, options: Training, target: _Target) -> Trained:
    place = choose_device(target.device)
    generator = torch.Generator().manual_seed(options.seed)
    size = (len(volumes), shape.features, SIDE, SIDE, SIDE)
    features = (torch.randn(size, generator=generator) / 3).to(place).requires_grad_()
    parameters = [p.to(place).requires_grad_() for p in initial_parameters(shape, options.seed + 1)]
    adam = torch.optim.Adam([features, *parameters], lr=options.rate)
    window = _gauss(shape.resolution).to(place)
    for epoch in range(options.epochs):
        batches = torch.randperm(len(volumes), generator=generator).split(options.batch)
        for step, numbers in enumerate(batches):
            adam.param_groups[0]["lr"] = options.rate * _pace((epoch + step / len(batches)) / options.epochs)
            truth = torch.from_numpy(np.stack([volumes[n] for n in numbers])).to(place).float().permute(0, 4, 1, 2, 3)
            chosen = rounded(features[numbers.to(place)], shape.bits)
            made = decode_volumes(chosen, [rounded(p, shape.bits) for p in parameters])
            adam.zero_grad()
            errors, lacking = _loss(made, truth.contiguous(), window)
            (errors + options.structure * lacking + SMALL_FEATURES * chosen.abs().mean()).backward()
            adam.step()
        target.told(epoch + 1, options.epochs)
    symbols = to_symbols(features, shape.bits).reshape(len(volumes), -1)
    return Trained(symbols, [to_symbols(p, shape.bits) for p in parameters])


def _pace(done: float) -> float:
    """The learning rate's share after this share of the epochs: it rises from a tenth, then falls as a cosine."""
    if done < _WARM:
        return 0.1 + 0.9 * done / _WARM
    return 0.5 * (math.cos(math.pi * (done - _WARM) / (1 - _WARM)) + 1)


def _loss(made: Tensor, truth: Tensor, window: Tensor) -> tuple[Tensor, Tensor]:
    """The two parts of eq. 3: errors, and what the similarities lack."""
    errors = (made - truth).abs()
    near = (truth[:, :1].abs() < 1).float()
    likeness = _similarity(made, truth, window)
    lacking = 1 - likeness[:, 0].mean() + 1 - likeness[:, 1:].mean()
    return errors.mean() + NEAR * (near * errors).sum() / near.sum().clamp(min=1), lacking


def _similarity(a: Tensor, b: Tensor, window: Tensor) -> Tensor:
    """The structural similarity at every point, channel by channel."""
    mean_a, mean_b = _blurred(a, window), _blurred(b, window)
    means = mean_a * mean_a + mean_b * mean_b
    spreads = _blurred(a * a + b * b, window) - means
    shared = _blurred(a * b, window) - mean_a * mean_b
    c1, c2 = _STABLE
    return (2 * mean_a * mean_b + c1) * (2 * shared + c2) / ((means + c1) * (spreads + c2))


def _blurred(values: Tensor, window: Tensor) -> Tensor:
    """Means under a Gaussian window, axis by axis: products with a symmetric matrix are faster than convolutions."""
    *rest, side = values.shape
    planes = torch.matmul(window, torch.matmul(values, window))
    return torch.matmul(window, planes.reshape(*rest[:-2], side, side * side)).reshape(values.shape)


def _gauss(side: int) -> Tensor:
    """What multiplies `side` values to their means under the window; beyond the ends are zeros."""
    apart = torch.arange(side)[:, None] - torch.arange(side)[None]
    weights = torch.exp(-((torch.arange(_WINDOW) - _WINDOW // 2) ** 2) / (2 * _SIGMA**2))
    found = torch.exp(-(apart**2) / (2 * _SIGMA**2)) / weights.sum()
    return torch.where(apart.abs() <= _WINDOW // 2, found, torch.zeros(()))
