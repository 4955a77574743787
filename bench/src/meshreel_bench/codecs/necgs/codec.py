"""The codec: frames -> volumes -> features and a network -> bytes, and back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, overload

import numpy as np
from jaxtyping import Bool, Float16, Float32

from meshreel.errors import InputError
from meshreel.types import Mesh, MeshSequence

from ...codec import Progress
from .cubes import extract
from .grid import Placement, box_of, place_grids, truncated_distances
from .shape import BITS, MOST_CHANNELS, MOST_FEATURES, RESOLUTIONS, Shape
from .stream import Coded, decode_stream, encode_stream

QUICK: dict[str, Any] = {  # seconds for a few frames, for tests and for a first look: limbs and heads, no faces
    "resolution": 32,
    "channels": 8,
    "epochs": 60,
    "fitting": 10,
}
SMALL: dict[str, Any] = {  # the defaults: minutes on a core for ten frames
    "resolution": 64,
    "channels": 16,
    "epochs": 100,
    "fitting": 20,
    "batch": 1,
    "rate": 6e-3,
    "structure": 1.0,
}
FULL: dict[str, Any] = {  # the publication's (section 4.1), for a GPU; its fit of other errors takes 500 steps
    "resolution": 128,
    "channels": 64,
    "epochs": 400,
    "fitting": 100,
    "batch": 4,
    "rate": 1e-3,
    "structure": 10.0,
}
MOST_STRUCTURE = 1000.0
KEPT = 0.1  # share of a frame's inside and of what is decoded as inside; with less in common training has failed


@dataclass(frozen=True, slots=True)
class FittedVolumes:
    """TSDF-Def volumes of frames, and where their grids are."""

    placement: Placement
    full: Bool[np.ndarray, " T"]  # which frames have a surface
    trimmed: bool  # whether some of them is open
    fitted: list[Float16[np.ndarray, "K K K 4"]]  # of those with a surface


@dataclass(frozen=True, slots=True)
class NecgsCodec:
    """A set of frames as one network and a feature a frame. The extra `necgs` on both sides."""

    resolution: int = 64  # K, points a side of the grid: 16, 32, 64 or 128
    features: int = 16  # C, channels of an embedded feature of 4 x 4 x 4 points
    channels: int = 16  # of the first of the network's modules; sets the rate
    epochs: int = 100
    bits: int = 8  # N: the network's numbers are multiples of 2 / 2^N
    fitting: int = 20  # steps in which a volume is fitted to its mesh; 0: plain TSDF
    batch: int = 1  # frames a step of training
    rate: float = 6e-3  # the highest learning rate
    structure: float = 1.0  # weight of the structural similarities in the loss
    seed: int = 0
    device: str = "auto"  # as torch names it; auto: a GPU where there is one

    def __post_init__(self) -> None:
        """Refuses what cannot be."""
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
        ):
            if not least <= value <= most:
                raise InputError(f"{name} {value}: give {least} to {most}")
        if not (math.isfinite(self.rate) and 0 < self.rate <= 1):
            raise InputError(f"rate {self.rate}: give a learning rate above 0, at most 1")
        if not 0 <= self.structure <= MOST_STRUCTURE:
            raise InputError(f"structure {self.structure}: give a weight of 0 to {MOST_STRUCTURE:g}")

    @property
    def name(self) -> str:
        """What rows and plots call it."""
        return "necgs"

    @property
    def options(self) -> dict[str, Any]:
        """The operating point, ready for JSON."""
        return asdict(self)

    @property
    def shape(self) -> Shape:
        """What the network is made of."""
        return Shape(self.resolution, self.features, self.channels, self.bits)

    @property
    def analysis_key(self) -> str:
        """The same for all networks on the same volumes."""
        return f"necgs volumes of {self.resolution}, fitted in {self.fitting}"

    def analyse(self, sequence: MeshSequence, progress: Progress | None = None) -> FittedVolumes:
        """The volume of each frame. InputError without the extra, and for frames that are not finite."""
        _need_torch()
        from .fit import fit_volume

        tell = progress or _silent
        boxes = [box_of(_checked(mesh, number)) for number, mesh in enumerate(sequence)]
        placement = place_grids(boxes, self.resolution)
        full, trimmed, volumes = np.array([box is not None for box in boxes], bool), False, list[np.ndarray]()
        for number in np.flatnonzero(full).tolist():
            mesh = placement.inverse(sequence[number], number, self.resolution)
            distances, sheets = truncated_distances(mesh, self.resolution)
            trimmed |= sheets
            volumes.append(fit_volume(distances, mesh, self.fitting).astype(np.float16))  # half the memory
            tell("volumes", number + 1, len(boxes))
        return FittedVolumes(placement, full, trimmed, volumes)

    def code(self, analysis: FittedVolumes, progress: Progress | None = None) -> bytes:
        """The network and a feature a frame. InputError where training ends without a frame's surface."""
        _need_torch()
        from .train import Training, train

        volumes = analysis.fitted
        options = Training(self.epochs, self.batch, self.rate, self.structure, self.seed)
        features, parameters = np.zeros((0, self.shape.feature_size), np.int32), list[np.ndarray]()
        if volumes:
            trained = train(volumes, self.shape, options, self.device, partial(progress or _silent, "train"))
            features, parameters = trained.features, trained.parameters
        coded = Coded(self.shape, analysis.trimmed, analysis.full, analysis.placement, features, parameters)
        self._check_surfaces(coded, volumes)
        return encode_stream(coded)

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """The network and a feature a frame. InputError as of `analyse` and `code`."""
        return self.code(self.analyse(sequence, progress), progress)

    def _check_surfaces(self, coded: Coded, volumes: Sequence[np.ndarray]) -> None:
        """Refuses a set of which a frame has lost its surface, or has another one: training has failed."""
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
        """The frames, each made when asked for. FormatError for bytes that are none of `encode`'s."""
        coded = decode_stream(data)
        _need_torch()
        return _Decoded(coded, self.device)


class _Decoded(Sequence[Mesh]):
    """The frames of a coded set."""

    def __init__(self, coded: Coded, device: str) -> None:
        from .network import Network

        self._coded = coded
        self._rows = np.cumsum(coded.full) - 1
        self._network = Network(coded.shape, coded.parameters, device) if coded.parameters else None

    def __len__(self) -> int:
        return len(self._coded.full)

    @overload
    def __getitem__(self, index: int) -> Mesh: ...

    @overload
    def __getitem__(self, index: slice) -> list[Mesh]: ...

    def __getitem__(self, index: int | slice) -> Mesh | list[Mesh]:
        if isinstance(index, slice):
            return [self[number] for number in range(*index.indices(len(self)))]
        number = range(len(self))[index]
        if not self._coded.full[number]:
            return Mesh.empty()
        mesh = extract(self.volume(int(self._rows[number])), self._coded.trimmed)
        return self._coded.placement.forward(mesh, number, self._coded.shape.resolution)

    def volume(self, row: int) -> Float32[np.ndarray, "K K K 4"]:
        """The TSDF-Def volume of a frame that is not empty, the first of which has row 0."""
        assert self._network is not None, "a frame that is not empty has a network"
        return self._network.volume(self._coded.features[row])


def _shared_inside(a: Float32[np.ndarray, "K K K 4"], b: Float32[np.ndarray, "K K K 4"]) -> float:
    """The points inside both volumes, as a share of those inside any."""
    either = ((a[..., 0] < 0) | (b[..., 0] < 0)).sum()
    return float(((a[..., 0] < 0) & (b[..., 0] < 0)).sum() / max(either, 1))


def _checked(mesh: Mesh, number: int) -> Mesh:
    if not np.isfinite(mesh.vertices).all():
        raise InputError(f"frame {number}: a coordinate is not finite; repair the mesh")
    return mesh


def _silent(_stage: str, _done: int, _total: int) -> None:
    """Nobody listens."""


def _need_torch() -> None:
    try:
        import torch  # noqa: F401
    except ImportError as error:
        raise InputError(f"NeCGS needs the extra necgs ({error}): pip install 'meshreel[necgs]'") from None
