"""NeCGS (Ren et al. 2025, "Neural Compression for 3D Geometry Sets"), a baseline of the paper (section 4.2).

Each frame becomes a TSDF-Def volume (`volumes`). One auto-decoder network, trained on all of them with rounded numbers
(`network`), makes the volumes from small embedded features; features and network are entropy-coded (`stream`).

Differs from the publication:
- The fit of a volume (eq. 1) measures distances between the two surfaces, both ways; the authors compare pictures of
  depth and silhouette, whose renderer needs a GPU.
- Entropy coding is the adaptive range coder of `coding.entropy`; the authors propose Huffman coding or better.
- Each frame has a grid around it, moved by whole cells; the authors scale meshes to a cube. Open surfaces are coded,
  too: a sheet has an inside behind its faces, and flips of sign far from any surface are left out (`volumes`).
- Training starts from weights that preserve the size of values and from an empty volume; with PyTorch's own rule values
  fade.
- Networks narrow as the authors' do, in proportion to `channels`; no head layer, no grids of 256. The defaults are a
  quarter as wide with fewer, faster steps, and weight the structural similarities 1 instead of 10. The publication's
  point, for a GPU: `necgs:full`.
Where the publication is silent, the authors' code decides: truncation at 2 cells, a deformation of 1 is half a cell,
windows of 11 points for the structural similarity, a rise of the learning rate over a fifth of the epochs.
"""

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

from ...codec import DecodedFrames, Progress, TwoSteps, reported
from .stream import BITS, MOST_CHANNELS, MOST_FEATURES, RESOLUTIONS, Coded, Shape, decode_stream, encode_stream
from .volumes import Placement, box_of, extract, place_grids, truncated_distances

# For tests and a first look: limbs and heads, no faces, in seconds.
QUICK: dict[str, Any] = {"resolution": 32, "channels": 8, "epochs": 60, "fitting": 10}
# The publication's own, for a GPU; of its authors' code what it does not tell.
FULL: dict[str, Any] = {"resolution": 128, "channels": 64, "epochs": 400, "fitting": 100, "batch": 4, "rate": 1e-3}
FULL |= {"structure": 10.0, "workers": 0}
MOST_STRUCTURE = 1000  # a guess
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
        return f"necgs volumes of {self.resolution}, fitted in {self.fitting}"

    def analyse(self, sequence: MeshSequence, progress: Progress | None = None) -> FittedVolumes:
        """Return the volume of each frame. Raises InputError without the extra and for frames that are not finite."""
        _need_torch()
        for number, mesh in enumerate(sequence):
            if not np.isfinite(mesh.vertices).all():
                raise InputError(f"frame {number}: a coordinate is not finite; repair the mesh")
        boxes = [box_of(mesh) for mesh in sequence]
        placement = place_grids(boxes, self.resolution)
        full = np.array([box is not None for box in boxes], bool)
        numbers, trimmed, volumes = np.flatnonzero(full).tolist(), False, list[np.ndarray]()
        meshes = (placement.inverse(sequence[number], number, self.resolution) for number in numbers)
        for volume, sheets in reported(self._fitted(meshes), progress, "volumes", len(numbers)):
            trimmed |= sheets
            volumes.append(volume)
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
        """Return the stream. Raises InputError without the extra, or where training ends without a frame's surface."""
        _need_torch()
        from .network import train

        report = partial(progress, "train") if progress else lambda _done, _total: None
        features, parameters = np.zeros((0, self.shape.feature_size), np.int32), list[np.ndarray]()
        if analysis.fitted:
            features, parameters = train(analysis.fitted, self, report)
        coded = Coded(self.shape, analysis.trimmed, analysis.full, analysis.placement, features, parameters)
        self._check_surfaces(coded, analysis.fitted)
        return encode_stream(coded)

    def _check_surfaces(self, coded: Coded, volumes: Sequence[np.ndarray]) -> None:
        """Raise InputError where training has lost the surface of a frame or replaced it by another one."""
        frames = _Decoded(coded, self.device)
        for number, volume in zip(np.flatnonzero(coded.full).tolist(), volumes, strict=True):
            wanted, made = volume.astype(np.float32), frames.volume(number)
            a, b = wanted[..., 0] < 0, made[..., 0] < 0
            kept = 0.0 if extract(made, coded.trimmed).is_empty else (a & b).sum() / max((a | b).sum(), 1)
            if kept < KEPT and not extract(wanted, coded.trimmed).is_empty:
                text = f"give more epochs than {self.epochs}, another rate than {self.rate:g} or another seed"
                raise InputError(f"frame {number}: training ended with {kept:.0%} of its body; {text}")

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
        mesh = extract(self.volume(number), self._coded.trimmed)
        return self._coded.placement.forward(mesh, number, self._coded.shape.resolution)

    def volume(self, number: int) -> Float32[np.ndarray, "K K K 4"]:
        """Return the TSDF-Def volume of a frame that is not empty."""
        assert self._network is not None, "a set with surface has a network"
        return self._network.volume(self._coded.features[int(self._rows[number])])


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
        text = f"NeCGS needs the extra necgs ({error}): pip install 'meshreel-bench[necgs]'"
        raise InputError(f"{text}, in a clone './bench[necgs]'") from None
