"""Auto-decoder (NeCGS, section 3.2 and appendix B), its training, and fits of volumes (eq. 1). Needs the extra `necgs`.

A module is a convolution of 3 x 3 x 3, a shuffle of channels into 2 x 2 x 2 points, a GELU; a last convolution follows.
The loss is eq. 3: the mean absolute error, 5 times that of points near the surface, and two structural similarities.
A fit reduces squared distances between the extracted surface and the mesh, both ways, and the deformations, by Adam.
"""

from __future__ import annotations

import hashlib
import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float32
from torch import Tensor
from torch.nn import functional

from meshreel.errors import InputError
from meshreel.geometry.closest_points import Surface
from meshreel.metrics.surface_samples import scatter
from meshreel.types import Mesh

from . import NecgsCodec
from .stream import SIDE, Shape, dequantize, quantize
from .volumes import cut, grid_points, place

EMPTY = 1.0  # distance at which training starts: that of a point far outside


def decode_volumes(features: Tensor, parameters: Sequence[Tensor]) -> Tensor:
    """Return the B x 4 x K x K x K volumes of B x C x 4 x 4 x 4 features."""
    *modules, last = zip(parameters[::2], parameters[1::2], strict=True)
    values = features
    for weights, bias in modules:
        values = functional.gelu(_shuffled(_convolved(values, weights, bias)))
    return _convolved(values, *last)


def _convolved(values: Tensor, weights: Tensor, bias: Tensor) -> Tensor:
    # On CPUs this layout selects an algorithm that takes two thirds of the time. A single small volume is cut into two
    # halves with a shared border, for which a faster algorithm exists.
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


RATE = 0.01  # of Adam; a guess
SHORT = 1e-3  # weight of the deformations' mean size; a guess
_SAMPLES = 4.0  # points of the mesh per vertex of the first surface
_MOST_SAMPLES = 60_000


@repeatable()
def fit_volume(distances: Float32[np.ndarray, "K K K"], mesh: Mesh, steps: int) -> Float32[np.ndarray, "K K K 4"]:
    """Return the volume after `steps` steps from zero deformations."""
    start = np.concatenate([distances[..., None], np.zeros((*distances.shape, 3), np.float32)], axis=-1)
    first = cut(distances[None])
    if steps == 0 or not len(first.faces):
        return start
    surface, count = Surface(mesh), int(min(_SAMPLES * len(first.low), _MOST_SAMPLES))
    samples = scatter(mesh, np.ones(len(mesh.faces), bool), count).points
    volume = torch.from_numpy(start).reshape(-1, 4).requires_grad_()
    adam = torch.optim.Adam([volume], lr=RATE)
    for step in range(steps):
        adam.param_groups[0]["lr"] = RATE * 10 ** (-step / steps)
        error = _error(volume, start.shape[0], surface, samples)
        if error is None:
            break
        adam.zero_grad()
        error.backward()
        adam.step()
        with torch.no_grad():
            volume.clamp_(-1, 1)
    return volume.detach().numpy().reshape(start.shape)


def _error(volume: Tensor, resolution: int, surface: Surface, samples: np.ndarray) -> Tensor | None:
    """Return squared distances both ways, cells^2, plus the size of deformations; None if no surface is left."""
    found = cut(volume.detach()[:, 0].numpy().reshape((1, *(resolution,) * 3)))
    if not len(found.faces):
        return None
    low, high = volume[found.low], volume[found.high]
    ends = (torch.from_numpy(grid_points(n, resolution)) for n in (found.low, found.high))
    vertices = place(low.double(), high.double(), *ends)
    faces = torch.from_numpy(found.faces).long()
    points = torch.cat([vertices, vertices[faces].mean(dim=1)])
    there = torch.from_numpy(surface.closest(points.detach().numpy()).points)
    made = Mesh(np.ascontiguousarray(vertices.detach().numpy()), found.faces)
    hits = Surface(made).closest(samples)
    back = (torch.from_numpy(hits.barycentric)[..., None] * vertices[faces[torch.from_numpy(hits.faces)]]).sum(dim=1)
    size = torch.cat([low, high])[:, 1:].abs().mean()
    missed = ((points - there) ** 2).sum(dim=1).mean() + ((back - torch.from_numpy(samples)) ** 2).sum(dim=1).mean()
    return missed + SHORT * size


NEAR = 5.0  # lambda 1 of eq. 3
SMALL_FEATURES = 0.1  # weight of the features' mean size, as in the authors' code
_WARM = 0.2  # share of the epochs in which the learning rate rises
_WINDOW, _SIGMA = 11, 1.5  # points, of the structural similarity
KEPT_S = 30.0  # between two states that are kept
_STABLE = (0.01**2, 0.03**2)

Report = Callable[[int, int], None]  # epochs done, epochs


@repeatable()
def train(volumes: Sequence[np.ndarray], options: NecgsCodec, report: Report) -> tuple[np.ndarray, list[np.ndarray]]:
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
            done = (epoch + step / len(batches)) / options.epochs
            fall = 0.5 * (math.cos(math.pi * (done - _WARM) / (1 - _WARM)) + 1)  # half a cosine
            adam.param_groups[0]["lr"] = options.rate * (0.1 + 0.9 * done / _WARM if done < _WARM else fall)
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


FOLDER = "MESHREEL_NECGS_KEEP"


def key_of(parts: Iterable[Any]) -> str:
    """Return a name for what is made of these parts: arrays by their bytes, all else by its text."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part.tobytes() if hasattr(part, "tobytes") else repr(part).encode())
    return digest.hexdigest()[:24]


def recall(key: str) -> Any:
    """Return the state that was kept by this name, or None."""
    path = _path(key)
    return None if path is None or not path.exists() else torch.load(path, map_location="cpu", weights_only=True)


def keep(key: str, state: Any) -> None:
    """Keep a state of tensors, numbers, lists and dicts, in the place of one of the same name."""
    if (path := _path(key)) is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        torch.save(state, part := path.with_suffix(f".{os.getpid()}"))
        part.replace(path)


def _path(key: str) -> Path | None:
    folder = os.environ.get(FOLDER)
    return Path(folder, f"{key}.pt") if folder else None
