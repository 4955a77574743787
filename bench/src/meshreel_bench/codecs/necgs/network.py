"""Auto-decoder (NeCGS, section 3.2 and appendix B): embedded features -> TSDF-Def volumes. Needs the extra `necgs`.

A module is a convolution of 3 x 3 x 3, a shuffle of channels into 2 x 2 x 2 points, a GELU; a last convolution follows.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch
from jaxtyping import Float32
from torch import Tensor
from torch.nn import functional

from meshreel.errors import InputError

from .shape import SIDE, Shape, dequantize, quantize

EMPTY = 1.0  # distance at which training starts: that of a point far outside


def decode_volumes(features: Tensor, parameters: Sequence[Tensor]) -> Tensor:
    """Return the B x 4 x K x K x K volumes of B x C x 4 x 4 x 4 features."""
    *modules, last = zip(parameters[::2], parameters[1::2], strict=True)
    values = features
    for weights, bias in modules:
        values = functional.gelu(_shuffled(_convolved(values, weights, bias)))
    return _convolved(values, *last)


def _convolved(values: Tensor, weights: Tensor, bias: Tensor) -> Tensor:
    """Return a convolution.

    On CPUs the layout of the weights selects an algorithm that takes two thirds of the time. A single small volume is
    cut into two halves with a shared border, for which a faster algorithm exists.
    """
    weights = weights.contiguous(memory_format=torch.channels_last_3d)
    if len(values) > 1 or values.device.type != "cpu":
        return functional.conv3d(values, weights, bias, padding=1)
    half = values.shape[2] // 2
    padded = functional.pad(values, (0, 0, 0, 0, 1, 1))
    halves = torch.cat([padded[:, :, : half + 2], padded[:, :, half:]])
    first, second = functional.conv3d(halves, weights, bias, padding=(0, 1, 1))
    return torch.cat([first, second], dim=1)[None]


def _shuffled(values: Tensor) -> Tensor:
    """Turn 8 channels of a point into 2 x 2 x 2 points of one channel."""
    count, channels, *sides = values.shape
    blocks = values.reshape(count, channels // 8, 2, 2, 2, *sides).permute(0, 1, 5, 2, 6, 3, 7, 4)
    return blocks.reshape(count, channels // 8, *(2 * side for side in sides))


def rounded(values: Tensor, bits: int) -> Tensor:
    """Return values as decoded (eq. 5); the gradient passes straight through the rounding."""
    clamped = values.clamp(-1, 1)
    levels = float(1 << (bits - 1))
    return clamped + (torch.round(clamped * levels) / levels - clamped).detach()


def initial_parameters(shape: Shape, seed: int) -> list[Tensor]:
    """Return weights that preserve the size of values (He et al. 2015), biases of zero; the last are of nothing."""
    generator = torch.Generator().manual_seed(seed)
    found = []
    for inputs, outputs in shape.layers:
        bound = (6 / (27 * inputs)) ** 0.5
        found.append((2 * torch.rand((outputs, inputs, 3, 3, 3), generator=generator) - 1) * bound)
        found.append(torch.zeros(outputs))
    weights, bias = found[-2:]
    weights[0] /= 6**0.5  # no GELU follows
    weights[1:] = 0
    bias[0] = EMPTY
    return found


def to_symbols(values: Tensor, bits: int) -> np.ndarray:
    """Return the symbols of a tensor, flat, int32."""
    return quantize(values.detach().cpu().numpy().astype(np.float64).reshape(-1), bits)


def from_symbols(symbols: np.ndarray, size: Sequence[int], bits: int) -> Tensor:
    """Return the tensor of symbols."""
    return torch.from_numpy(dequantize(symbols, bits).astype(np.float32).reshape(tuple(size)))


@contextmanager
def repeatable() -> Iterator[None]:
    """Make torch deterministic: one thread, and only algorithms whose results are repeatable."""
    threads, strict = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    memory: Any = torch.utils.deterministic  # torch's own types lack its setting
    filled = memory.fill_uninitialized_memory
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # without it, torch refuses to be deterministic on GPUs
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    memory.fill_uninitialized_memory = False  # saves a tenth of the time; nothing reads such memory
    try:
        yield
    finally:
        torch.set_num_threads(threads)
        torch.use_deterministic_algorithms(strict)
        memory.fill_uninitialized_memory = filled


class Network:
    """A decoded auto-decoder."""

    def __init__(self, shape: Shape, symbols: Sequence[np.ndarray], device: str) -> None:
        self._shape, self._device = shape, choose_device(device)
        tensors = zip(symbols, shape.tensors, strict=True)
        self._parameters = [from_symbols(flat, size, shape.bits).to(self._device) for flat, size in tensors]

    @repeatable()
    @torch.no_grad()
    def volume(self, symbols: np.ndarray) -> Float32[np.ndarray, "K K K 4"]:
        """Return the TSDF-Def volume of a feature's symbols."""
        size = (1, self._shape.features, SIDE, SIDE, SIDE)
        feature = from_symbols(symbols, size, self._shape.bits).to(self._device)
        volume = decode_volumes(feature, self._parameters)[0].clamp(-1, 1)
        return np.ascontiguousarray(volume.permute(1, 2, 3, 0).cpu().numpy())


def choose_device(device: str) -> torch.device:
    """Return a device by name; `auto` is a GPU if torch sees one. Raises InputError for a device that is absent."""
    if device == "auto":
        device = "cuda" if torch.cuda.is_available() else "cpu"
    try:
        return torch.zeros(1, device=device).device
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"device {device!r} cannot be used ({reason}); give cpu, cuda or auto") from error
