"""The codec of `klt_tsdf`: a sequence <-> one stream of a head, a basis and groups of frames."""

from __future__ import annotations

import operator
import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float64

from meshreel.analysis.survey import survey
from meshreel.errors import FormatError, InputError
from meshreel.types import Mesh, MeshSequence

from ...codec import Progress
from .basis import MOST, basis_of, decode_basis, encode_basis, learned
from .frames import Group, decode_frame, decode_group, encode_group
from .weights import STEP_ONE, TRUNCATION, Model
from .wire import Reader, Writer

MAGIC = b"KLTT"
VERSION = 1
PLACES = ("stream", "codec")  # where the basis is
MOST_FRAMES = 1 << 20
MOST_ROUNDS = 32
MOST_STEP = STEP_ONE * 3


@dataclass(frozen=True, slots=True)
class KltTsdfCodec:
    """TSDF blocks by KLT; see the package."""

    cells: float = 128.0  # of the grid along the diagonal of the sequence's bounding box
    basis: int = 32  # principal components kept
    step: float = 0.05  # of the weights' quantiser, in truncations (3 voxels) of root mean square over a block
    group: int = 10  # frames that share the entropy coder's adaptive models
    deblocking: int = 0  # rounds of the decoder's deblocking
    basis_in: str = "stream"  # or "codec": a table of every decoder, and not in the rate

    def __post_init__(self) -> None:
        """Refuses what cannot be coded."""
        if not 8 <= self.cells <= 1024:
            raise InputError(f"cells {self.cells:g}: give 8 to 1024 along the diagonal")
        if not 1 <= self.basis <= MOST:
            raise InputError(f"basis {self.basis}: give 1 to {MOST} components")
        if not 0.0005 <= self.step <= 1:
            raise InputError(f"step {self.step:g}: give 0.0005 to 1 truncations")
        if not 1 <= self.group <= 64:
            raise InputError(f"group {self.group}: give 1 to 64 frames")
        if not 0 <= self.deblocking <= MOST_ROUNDS:
            raise InputError(f"deblocking {self.deblocking}: give 0 to {MOST_ROUNDS} rounds")
        if self.basis_in not in PLACES:
            raise InputError(f"basis_in {self.basis_in!r}: give one of {', '.join(PLACES)}")

    @property
    def name(self) -> str:
        """What rows and plots call it."""
        return "klt_tsdf" if self.basis_in == "stream" else "klt_tsdf, table not counted"

    @property
    def options(self) -> dict[str, Any]:
        """The operating point, ready for JSON."""
        return asdict(self)

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """The stream. Raises InputError where a frame has more blocks than a decoder takes."""
        seen = survey(sequence)
        voxel = seen.diagonal / self.cells
        symbols, energies = learned(self.basis)
        model = Model(basis_of(symbols), max(round(self.step * TRUNCATION * STEP_ONE), 1), self.deblocking)
        out = Writer(bytearray(MAGIC))
        out.number(VERSION)
        for number in (len(sequence), self.group, self.basis, model.step, model.deblocking):
            out.number(number)
        for value in (voxel, *seen.low):
            out.real(float(value))
        out.blob(encode_basis(symbols) if self.basis_in == "stream" else b"")
        for start in range(0, len(sequence), self.group):
            numbers = range(start, min(start + self.group, len(sequence)))
            meshes = (_reported(_scaled(sequence[n], seen.low, voxel), n, len(sequence), progress) for n in numbers)
            out.blob(encode_group(meshes, model, energies))
        if progress is not None:
            progress("code", len(sequence), len(sequence))
        return bytes(out.data) + zlib.crc32(out.data).to_bytes(4, "little")

    def decode(self, data: bytes) -> Sequence[Mesh]:
        """The frames, from the bytes alone; a group is decoded when one of its frames is asked for."""
        return open_video(data)


def _scaled(mesh: Mesh, low: Float64[np.ndarray, " 3"], voxel: float) -> Mesh:
    return Mesh.of((mesh.vertices - low) / voxel, mesh.faces)


def _reported(mesh: Mesh, number: int, total: int, progress: Progress | None) -> Mesh:
    """The mesh; the frame before it is done."""
    if progress is not None and number:
        progress("code", number, total)
    return mesh


@dataclass(slots=True)
class Video(Sequence[Mesh]):
    """The frames of a stream; the group that was asked for last is kept."""

    frames: int
    group: int
    voxel: float  # m
    low: Float64[np.ndarray, " 3"]  # m, where the grid begins
    model: Model
    groups: list[bytes]
    _last: tuple[int, Group] | None = field(default=None)

    def __len__(self) -> int:
        return self.frames

    def __getitem__(self, index: int) -> Mesh:  # type: ignore[override]
        """A frame, m. Raises FormatError where its bytes are damaged."""
        number = range(self.frames)[operator.index(index)]
        which, inside = divmod(number, self.group)
        if self._last is None or self._last[0] != which:
            count = min(self.group, self.frames - which * self.group)
            self._last = which, decode_group(self.groups[which], count, self.model.basis.vectors.shape[1])
        mesh = decode_frame(self._last[1], inside, self.model)
        return Mesh.of(mesh.vertices * self.voxel + self.low, mesh.faces)


def open_video(data: bytes) -> Video:
    """The frames of a stream, decoded when asked for. Raises FormatError where its head is not one."""
    if data[:4] != MAGIC:
        raise FormatError(f"begins with {data[:4]!r}, not {MAGIC!r}: no stream of klt_tsdf")
    if zlib.crc32(data[:-4]).to_bytes(4, "little") != data[-4:]:
        raise FormatError(f"checksum of {len(data)} bytes is wrong; the stream is damaged")
    read = Reader(data[4:-4])
    if (version := read.number(1 << 20)) != VERSION:
        raise FormatError(f"version {version} of klt_tsdf; this one reads {VERSION}")
    most = (MOST_FRAMES, 64, MOST, MOST_STEP, MOST_ROUNDS)
    frames, group, width, step, rounds = (read.number(bound) for bound in most)
    voxel, *low = (read.real() for _ in range(4))
    if not (frames and group and width and step and 1e-12 < voxel < 1e12 and np.abs(low).max() < 1e18):
        raise FormatError(f"{frames} frames in groups of {group}, {width} components, voxels of {voxel:g} m: damaged")
    table = read.blob()
    symbols = decode_basis(table, width) if table else learned(width)[0]
    groups = [read.blob() for _ in range(-(-frames // group))]
    read.end()
    return Video(frames, group, voxel, np.array(low), Model(basis_of(symbols), step, rounds), groups)
