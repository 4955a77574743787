"""NeCGS at an operating point. In -> out: frames <-> bytes, by volumes, features and a network."""

from __future__ import annotations

import math
import multiprocessing
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields
from functools import partial
from itertools import repeat
from typing import Any

import numpy as np
from jaxtyping import Bool, Float16

from meshreel.errors import InputError
from meshreel.types import Mesh, MeshSequence

from ...codec import Progress
from ..base import DecodedFrames, TwoSteps
from .stream import BITS, MOST_CHANNELS, MOST_FEATURES, RESOLUTIONS, Coded, Shape, decode_stream, encode_stream
from .volumes import Placement, box_of, extract, place_grids, truncated_distances

# For tests and a first look: limbs and heads, no faces, in seconds.
QUICK: dict[str, Any] = {"resolution": 32, "channels": 8, "epochs": 60, "fitting": 10}
# The publication's own, for a GPU; of its authors' code what it does not tell.
FULL: dict[str, Any] = {"resolution": 128, "channels": 64, "epochs": 400, "fitting": 100, "batch": 4, "rate": 1e-3}
FULL |= {"structure": 10.0, "workers": 0}
MOST_STRUCTURE = 1000  # a guess


@dataclass(frozen=True, slots=True)
class FittedVolumes:
    """TSDF-Def volumes of frames, and the places of their grids."""

    placement: Placement
    full: Bool[np.ndarray, " T"]  # which frames have a surface
    trimmed: bool  # whether one of them is open
    fitted: list[Float16[np.ndarray, "K K K 4"]]  # of those with a surface


@dataclass(frozen=True, slots=True)
class NecgsCodec(TwoSteps):
    """A set of frames as one network and one feature per frame. Needs the extra `necgs` on both sides."""

    configuration: str = "small"  # full: its authors', where an option below is not given
    resolution: int = 64  # K, points along a side of the grid: 16, 32, 64 or 128
    features: int = 16  # C, channels of an embedded feature of 4 x 4 x 4 points
    channels: int = 16  # of the network's first module; sets the rate
    epochs: int = 100
    bits: int = 8  # N: the network's numbers are multiples of 2 / 2^N
    fitting: int = 20  # steps of the fit of a volume to its mesh; 0: plain TSDF
    batch: int = 1  # frames per step of training
    rate: float = 6e-3  # the highest learning rate
    structure: float = 1.0  # weight of the structural similarities in the loss
    seed: int = 0
    device: str = "auto"  # a name of torch's; auto: a GPU if there is one
    workers: int = 1  # processes that fit volumes; 0: one a core

    def __post_init__(self) -> None:
        if self.configuration not in ("small", "full"):
            raise InputError(f"configuration {self.configuration!r}: give small or full")
        for field in fields(self) if self.configuration == "full" else ():
            if field.name in FULL and getattr(self, field.name) == field.default:
                object.__setattr__(self, field.name, FULL[field.name])
        if self.resolution not in RESOLUTIONS:
            raise InputError(f"resolution {self.resolution}: give one of {', '.join(map(str, RESOLUTIONS))}")
        limits = {"features": (1, MOST_FEATURES), "channels": (1, MOST_CHANNELS), "bits": (BITS[0], BITS[-1])}
        limits |= {"epochs": (1, 100_000), "fitting": (0, 10_000), "batch": (1, 1024), "seed": (0, 2**31)}
        for name, (least, most) in (limits | {"workers": (0, 1024), "structure": (0, MOST_STRUCTURE)}).items():
            if not least <= getattr(self, name) <= most:
                raise InputError(f"{name} {getattr(self, name)}: give {least} to {most}")
        if not (math.isfinite(self.rate) and 0 < self.rate <= 1):
            raise InputError(f"rate {self.rate}: give a learning rate above 0, at most 1")

    @property
    def name(self) -> str:
        return "necgs" if self.configuration == "small" else "necgs_full"

    @property
    def shape(self) -> Shape:
        """Sizes of the network."""
        return Shape(self.resolution, self.features, self.channels, self.bits)

    @property
    def analysis_key(self) -> str:
        """Equal for operating points that share volumes."""
        return f"necgs volumes of {self.resolution}, fitted in {self.fitting}"

    def analyse(self, sequence: MeshSequence, progress: Progress | None = None) -> FittedVolumes:
        """Return the volume of each frame. Raises InputError without the extra and for frames that are not finite."""
        _need_torch()
        for number, mesh in enumerate(sequence):
            if not np.isfinite(mesh.vertices).all():
                raise InputError(f"frame {number}: a coordinate is not finite; repair the mesh")
        boxes = [box_of(mesh) for mesh in sequence]
        placement = place_grids(boxes, self.resolution)
        full, trimmed, volumes = np.array([box is not None for box in boxes], bool), False, list[np.ndarray]()
        numbers = np.flatnonzero(full).tolist()
        meshes = (placement.inverse(sequence[number], number, self.resolution) for number in numbers)
        for number, (volume, sheets) in zip(numbers, self._fitted(meshes), strict=True):
            trimmed |= sheets
            volumes.append(volume)
            if progress is not None:
                progress("volumes", number + 1, len(boxes))
        return FittedVolumes(placement, full, trimmed, volumes)

    def _fitted(self, meshes: Iterator[Mesh]) -> Iterator[tuple[Float16[np.ndarray, "K K K 4"], bool]]:
        """Yield the volume of each mesh, and whether it has sheets; processes fit the same as this one would."""
        how = repeat(self.resolution), repeat(self.fitting)
        if self.workers == 1:
            yield from map(fitted, meshes, *how)
            return
        with ProcessPoolExecutor(self.workers or os.cpu_count(), multiprocessing.get_context("spawn")) as executor:
            yield from executor.map(fitted, meshes, *how)

    def code(self, analysis: FittedVolumes, progress: Progress | None = None) -> bytes:
        """Return the stream. Raises InputError without the extra."""
        _need_torch()
        from .network import train

        report = partial(progress, "train") if progress else lambda _done, _total: None
        features, parameters = np.zeros((0, self.shape.feature_size), np.int32), list[np.ndarray]()
        if analysis.fitted:
            features, parameters = train(analysis.fitted, self, report)
        place = analysis.placement
        return encode_stream(Coded(self.shape, analysis.trimmed, analysis.full, place, features, parameters))

    def decode(self, data: bytes) -> Sequence[Mesh]:
        """Return the frames, each decoded on access. Raises FormatError for damaged bytes."""
        coded = decode_stream(data)
        _need_torch()
        return _Decoded(coded, self.device)


class _Decoded(DecodedFrames):
    """Frames of a coded set."""

    def __init__(self, coded: Coded, device: str) -> None:
        from .network import Network

        self._coded = coded
        self._rows = np.cumsum(coded.full) - 1
        self._network = Network(coded.shape, coded.parameters, device) if coded.parameters else None

    def __len__(self) -> int:
        return len(self._coded.full)

    def frame(self, number: int) -> Mesh:
        if not self._coded.full[number]:
            return Mesh.empty()
        assert self._network is not None, "a set with surface has a network"
        volume = self._network.volume(self._coded.features[int(self._rows[number])])
        mesh = extract(volume, self._coded.trimmed)
        return self._coded.placement.forward(mesh, number, self._coded.shape.resolution)


def fitted(mesh: Mesh, resolution: int, steps: int) -> tuple[Float16[np.ndarray, "K K K 4"], bool]:
    """Return the volume of a mesh in cells, and whether it has sheets."""
    import torch

    from .network import fit_volume, keep, key_of, recall

    key = key_of(("volume", resolution, steps, mesh.vertices, mesh.faces))
    if (known := recall(key)) is None:
        distances, sheets = truncated_distances(mesh, resolution)
        volume = fit_volume(distances, mesh, steps).astype(np.float16)  # half the memory
        keep(key, known := (torch.from_numpy(volume), sheets))
    return known[0].numpy(), known[1]


def _need_torch() -> None:
    try:
        import torch  # noqa: F401
    except ImportError as error:
        raise InputError(
            f"NeCGS needs the extra necgs ({error}): pip install 'meshreel-bench[necgs]', in a clone './bench[necgs]'"
        ) from None
