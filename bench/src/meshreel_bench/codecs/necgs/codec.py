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
from jaxtyping import Bool, Float16, Float32

from meshreel.errors import InputError
from meshreel.types import Mesh, MeshSequence

from ...codec import Progress
from ..base import DecodedFrames, TwoSteps
from .cubes import extract
from .grid import Placement, box_of, place_grids, truncated_distances
from .keep import keep, key_of, recall
from .shape import BITS, MOST_CHANNELS, MOST_FEATURES, RESOLUTIONS, Shape
from .stream import Coded, decode_stream, encode_stream

# For tests and a first look: limbs and heads, no faces, in seconds.
QUICK: dict[str, Any] = {"resolution": 32, "channels": 8, "epochs": 60, "fitting": 10}
# The publication's own, for a GPU; of its authors' code what it does not tell.
FULL: dict[str, Any] = {"resolution": 128, "channels": 64, "epochs": 400, "fitting": 100, "batch": 4, "rate": 1e-3}
FULL |= {"structure": 10.0, "workers": 0}
MOST_STRUCTURE = 1000.0  # a guess
KEPT = 0.1  # least share of inside points that original and decoded volume have in common; a guess


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
        for name, value, least, most in (
            ("features", self.features, 1, MOST_FEATURES),
            ("channels", self.channels, 1, MOST_CHANNELS),
            ("bits", self.bits, BITS[0], BITS[-1]),
            ("epochs", self.epochs, 1, 100_000),
            ("fitting", self.fitting, 0, 10_000),
            ("batch", self.batch, 1, 1024),
            ("seed", self.seed, 0, 2**31),
            ("workers", self.workers, 0, 1024),
        ):
            if not least <= value <= most:
                raise InputError(f"{name} {value}: give {least} to {most}")
        if not (math.isfinite(self.rate) and 0 < self.rate <= 1):
            raise InputError(f"rate {self.rate}: give a learning rate above 0, at most 1")
        if not 0 <= self.structure <= MOST_STRUCTURE:
            raise InputError(f"structure {self.structure}: give a weight of 0 to {MOST_STRUCTURE:g}")

    @property
    def name(self) -> str:
        """The name in rows and plots."""
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
        boxes = [box_of(_checked(mesh, number)) for number, mesh in enumerate(sequence)]
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
        """Return the stream. Raises InputError where training ends without the surface of a frame."""
        _need_torch()
        from .train import train

        volumes = analysis.fitted
        report = partial(progress, "train") if progress else lambda _done, _total: None
        features, parameters = np.zeros((0, self.shape.feature_size), np.int32), list[np.ndarray]()
        if volumes:
            features, parameters = train(volumes, self, report)
        coded = Coded(self.shape, analysis.trimmed, analysis.full, analysis.placement, features, parameters)
        self._check_surfaces(coded, volumes)
        return encode_stream(coded)

    def _check_surfaces(self, coded: Coded, volumes: Sequence[np.ndarray]) -> None:
        """Raise InputError where training has lost the surface of a frame or replaced it by another one."""
        frames = _Decoded(coded, self.device)
        for row, number in enumerate(np.flatnonzero(coded.full).tolist()):
            wanted, made = volumes[row].astype(np.float32), frames.volume(row)
            kept = 0.0 if extract(made, coded.trimmed).is_empty else _shared_inside(wanted, made)
            if kept < KEPT and not extract(wanted, coded.trimmed).is_empty:
                raise InputError(
                    f"frame {number}: training ended with {kept:.0%} of its body; "
                    f"give more epochs than {self.epochs}, another rate than {self.rate:g} or another seed"
                )

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
        mesh = extract(self.volume(int(self._rows[number])), self._coded.trimmed)
        return self._coded.placement.forward(mesh, number, self._coded.shape.resolution)

    def volume(self, row: int) -> Float32[np.ndarray, "K K K 4"]:
        """Return the TSDF-Def volume of a frame; rows number the frames that are not empty."""
        assert self._network is not None, "a set with surface has a network"
        return self._network.volume(self._coded.features[row])


def fitted(mesh: Mesh, resolution: int, steps: int) -> tuple[Float16[np.ndarray, "K K K 4"], bool]:
    """Return the volume of a mesh in cells, and whether it has sheets."""
    import torch

    from .fit import fit_volume

    key = key_of(("volume", resolution, steps, mesh.vertices, mesh.faces))
    if (known := recall(key)) is None:
        distances, sheets = truncated_distances(mesh, resolution)
        volume = fit_volume(distances, mesh, steps).astype(np.float16)  # half the memory
        keep(key, known := (torch.from_numpy(volume), sheets))
    return known[0].numpy(), known[1]


def _shared_inside(a: Float32[np.ndarray, "K K K 4"], b: Float32[np.ndarray, "K K K 4"]) -> float:
    """Return the points inside both volumes as a share of those inside at least one."""
    either = ((a[..., 0] < 0) | (b[..., 0] < 0)).sum()
    return float(((a[..., 0] < 0) & (b[..., 0] < 0)).sum() / max(either, 1))


def _checked(mesh: Mesh, number: int) -> Mesh:
    if not np.isfinite(mesh.vertices).all():
        raise InputError(f"frame {number}: a coordinate is not finite; repair the mesh")
    return mesh


def _need_torch() -> None:
    try:
        import torch  # noqa: F401
    except ImportError as error:
        raise InputError(
            f"NeCGS needs the extra necgs ({error}): pip install 'meshreel-bench[necgs]', in a clone './bench[necgs]'"
        ) from None
