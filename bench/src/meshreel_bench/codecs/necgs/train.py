"""Training of the auto-decoder (NeCGS, section 3.2): volumes -> symbols. Needs the extra `necgs`.

The loss is eq. 3: the mean absolute error, 5 times that of points near the surface, and two structural similarities.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from .codec import NecgsCodec
from .keep import keep, key_of, recall
from .network import choose_device, decode_volumes, initial_parameters, repeatable, rounded, to_symbols
from .shape import SIDE

NEAR = 5.0  # lambda 1 of eq. 3
SMALL_FEATURES = 0.1  # weight of the features' mean size, as in the authors' code
_WARM = 0.2  # share of the epochs in which the learning rate rises
_WINDOW, _SIGMA = 11, 1.5  # points, of the structural similarity
KEPT_S = 30.0  # between two states that are kept
_STABLE = (0.01**2, 0.03**2)

Volumes = Sequence[np.ndarray]  # K x K x K x 4 each
Report = Callable[[int, int], None]  # epochs done, epochs


@repeatable()
def train(volumes: Volumes, options: NecgsCodec, report: Report) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return symbols of features, N x features, and of the network's tensors, flat; the same for a seed and machine."""
    place, shape = choose_device(options.device), options.shape
    generator = torch.Generator().manual_seed(options.seed)
    size = (len(volumes), shape.features, SIDE, SIDE, SIDE)
    features = (torch.randn(size, generator=generator) / 3).to(place).requires_grad_()
    parameters = [p.to(place).requires_grad_() for p in initial_parameters(shape, options.seed + 1)]
    adam = torch.optim.Adam([features, *parameters], lr=options.rate)
    window = _gauss(shape.resolution).to(place)
    key, last = key_of(("training", options, *volumes)), time.monotonic()
    for epoch in range(_resumed(recall(key), [features, *parameters], adam, generator), options.epochs):
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
        if time.monotonic() - last >= KEPT_S:
            tensors = [each.detach() for each in (features, *parameters)]
            keep(key, (epoch + 1, tensors, adam.state_dict(), generator.get_state()))
            last = time.monotonic()
        report(epoch + 1, options.epochs)
    symbols = to_symbols(features, shape.bits).reshape(len(volumes), -1)
    return symbols, [to_symbols(p, shape.bits) for p in parameters]


def _resumed(state: Any, tensors: Sequence[Tensor], adam: torch.optim.Adam, generator: torch.Generator) -> int:
    """Return the epoch to go on with, after a state that was kept, if there is one."""
    if state is None:
        return 0
    epoch, known, steps, random = state
    with torch.no_grad():
        for own, other in zip(tensors, known, strict=True):
            own.copy_(other)
    adam.load_state_dict(steps)
    generator.set_state(random)
    return int(epoch)


def _pace(done: float) -> float:
    """Return the factor of the learning rate after a share of the epochs: a rise from 0.1, then half a cosine."""
    if done < _WARM:
        return 0.1 + 0.9 * done / _WARM
    return 0.5 * (math.cos(math.pi * (done - _WARM) / (1 - _WARM)) + 1)


def _loss(made: Tensor, truth: Tensor, window: Tensor) -> tuple[Tensor, Tensor]:
    """Return the two parts of eq. 3: absolute errors, and distances of the similarities from 1."""
    errors = (made - truth).abs()
    near = (truth[:, :1].abs() < 1).float()
    likeness = _similarity(made, truth, window)
    lacking = 1 - likeness[:, 0].mean() + 1 - likeness[:, 1:].mean()
    return errors.mean() + NEAR * (near * errors).sum() / near.sum().clamp(min=1), lacking


def _similarity(a: Tensor, b: Tensor, window: Tensor) -> Tensor:
    """Return the structural similarity at every point of each channel."""
    mean_a, mean_b = _blurred(a, window), _blurred(b, window)
    means = mean_a * mean_a + mean_b * mean_b
    spreads = _blurred(a * a + b * b, window) - means
    shared = _blurred(a * b, window) - mean_a * mean_b
    c1, c2 = _STABLE
    return (2 * mean_a * mean_b + c1) * (2 * shared + c2) / ((means + c1) * (spreads + c2))


def _blurred(values: Tensor, window: Tensor) -> Tensor:
    """Return means under a Gaussian window, by products with a symmetric matrix: faster than convolutions."""
    *rest, side = values.shape
    planes = torch.matmul(window, torch.matmul(values, window))
    return torch.matmul(window, planes.reshape(*rest[:-2], side, side * side)).reshape(values.shape)


def _gauss(side: int) -> Tensor:
    """Return the matrix that takes `side` values to their means under the window; values past the ends are 0."""
    apart = torch.arange(side)[:, None] - torch.arange(side)[None]
    weights = torch.exp(-((torch.arange(_WINDOW) - _WINDOW // 2) ** 2) / (2 * _SIGMA**2))
    found = torch.exp(-(apart**2) / (2 * _SIGMA**2)) / weights.sum()
    return torch.where(apart.abs() <= _WINDOW // 2, found, torch.zeros(()))
