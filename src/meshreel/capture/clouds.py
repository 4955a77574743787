"""Point clouds as a sequence of meshes: a file for each frame, whose surface is made when it is read.

PLY, PCD, npz, LAS and LAZ (extra `las`). Points without a place (NaN) are left out.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..geometry.points import Cloud, bare_share, surface_of, voxel_for
from ..geometry.topology import without_fragments
from ..io.file_names import Order, globbed, in_order, is_pattern, listed, ordered
from ..io.meshes import FARTHEST
from ..io.point_files import KINDS, read_points
from ..io.polygons import Unreadable
from ..io.sequence import RATE, SequenceOptions
from ..io.unity import FLIP, record_of
from ..types import Mesh, MeshSequence, Up, evenly

PROBES = 3  # frames whose points tell the side of the voxels (guess)
KNOWN = 0.5  # share of the points whose normals must be known, or all are found (guess)
LEAST_VOXEL = 1e-6  # m


@dataclass(frozen=True, slots=True)
class CloudOptions:
    """Size of voxels, unit and sensor of point clouds that become surface."""

    voxel: float | None = None  # m; None: measured
    fragment: float = 0.002  # m^2: connected pieces with less area are dropped, as of fused depth
    unit: float = 1.0  # m, of the coordinates
    seen_from: tuple[float, float, float] | None = None  # m, the place of the sensor, if one took all points

    def __post_init__(self) -> None:
        if self.voxel is not None and not LEAST_VOXEL <= self.voxel < np.inf:
            raise InputError(f"voxel {self.voxel:g}: give metres above 0, or leave it out to have it measured")
        if not (0 <= self.fragment < np.inf and 0 < self.unit < np.inf):
            raise InputError(f"fragment {self.fragment:g}, unit {self.unit:g}: give m^2 from 0 on, and metres above 0")


def are_clouds(inputs: Sequence[Path]) -> bool:
    """Return whether inputs are point clouds by their names: one folder, one pattern, or a list of files."""
    files = _found(inputs[0])[1] if len(inputs) == 1 else inputs
    return bool(files) and all(path.suffix.lower() in KINDS for path in files)


def open_clouds(
    inputs: Sequence[Path], options: CloudOptions = CloudOptions(), frames: str = ":", order: Order = "auto"
) -> tuple[Clouds, list[str]]:
    """Return point clouds as a sequence, in the order of a list or by the numbers in their names, and warnings.

    Raises InputError for several kinds, and for points that are too few for a surface.
    """
    root, files = _found(inputs[0]) if len(inputs) == 1 else (Path(), list(inputs))
    if len(kinds := {path.suffix.lower() for path in files}) > 1:
        raise InputError(f"{inputs[0]}: holds {', '.join(sorted(kinds))} files; give one kind, by a pattern")
    remarks = list[str]()
    if len(inputs) == 1 and len(files) > 1:
        paths, warnings = ordered(inputs[0], root, files, order)
        files, remarks = list(paths), list(warnings)
    elif (first := _out_of_order(files)) is not None:
        text = f"{first}: is not in the order of the numbers in the names"
        remarks.append(f"{text}: the list's is taken; give the folder, or a pattern in quotes, for theirs")
    probes = [read_cloud(files[number], options.unit) for number in evenly(len(files), PROBES)]
    if options.seen_from is None and any(cloud.normals is None and cloud.eye is None for cloud in probes):
        text = f"{files[0]}: without normals; bodies face outside, rooms inside, and single sheets either way"
        remarks.append(f"{text}: give normals, or --seen-from, the place of the sensor, if one took all points")
    if options.voxel is None:
        sizes = [voxel_for(cloud) for cloud in probes]
        known = sorted(size for size in sizes if size > 0)
        if not known:
            text = f"{files[0]}: too few points for a surface, as in other files looked at"
            raise InputError(f"{text}; give denser ones, or --voxel")
        options = replace(options, voxel=float(f"{known[len(known) // 2]:.3g}"))
    chosen = SequenceOptions(frames=frames).chosen(len(files))
    return Clouds(tuple(files[number] for number in chosen), options), remarks


def _out_of_order(files: Sequence[Path]) -> Path | None:
    """Return the first file of a list whose order is not that of the numbers in the names, where these have one."""
    names = {path.with_suffix("").as_posix(): path for path in files}
    try:
        found, _ = in_order(files[0], list(names)) if len(names) == len(files) > 1 else (list(names), [])
    except InputError:  # they have none
        return None
    return next((path for name, path in zip(found, files, strict=False) if names[name] != path), None)


def _found(source: Path) -> tuple[Path, list[Path]]:
    """Return the folder of point clouds, and those of a folder or a pattern, or the file."""
    if source.is_dir():
        return source, listed(source, KINDS)
    if is_pattern(str(source)) and not source.exists():
        return globbed(source, KINDS)
    return source.parent, [source]


@dataclass(frozen=True, slots=True, repr=False)
class Clouds(MeshSequence):
    """Frames of point clouds, whose surface is made when it is read, with the colours of the points."""

    files: tuple[Path, ...]
    options: CloudOptions  # with a voxel
    bare: dict[int, float] = field(default_factory=dict)  # share of the points of each frame read that got no surface

    @property
    def frame_rate(self) -> float:
        """The rate of Unity's record, 1/s, where it has one, or the usual one: files of points name none."""
        return (record_of(self.files[0].parent) or {}).get("fps") or RATE

    @property
    def up(self) -> Up:
        """The axis that points up: z in LAS, y in other files, which do not tell."""
        return "z" if self.files[0].suffix.lower() in (".las", ".laz") else "y"

    @property
    def source(self) -> dict[str, Any]:
        """A record of the files and options that the frames are made of; files are told apart by their sizes."""
        sizes = [(path.name, path.stat().st_size if path.exists() else 0) for path in self.files]
        folder = str(self.files[0].parent.resolve())
        return {"points": folder, "files_crc32": zlib.crc32(repr(sizes).encode())} | asdict(self.options)

    def __len__(self) -> int:
        return len(self.files)

    def __getitem__(self, index: int) -> Mesh:
        assert self.options.voxel is not None
        path = self.files[range(len(self))[index]]
        cloud = read_cloud(path, self.options.unit)
        if self.options.seen_from is not None:
            cloud = replace(cloud, normals=None, eye=np.array(self.options.seen_from, np.float64))
        try:
            mesh = without_fragments(surface_of(cloud, self.options.voxel), self.options.fragment)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        self.bare[index] = bare_share(cloud, mesh, self.options.voxel)
        return mesh


def read_cloud(path: Path, unit: float = 1.0) -> Cloud:
    """Read the points of a file, with its normals and colours. Raises InputError for damage, and for meshes."""
    try:
        fields = read_points(path)
    except Unreadable as error:
        raise InputError(f"{path}: {error}; write it again, or leave it out with --frames") from None
    points, normals = fields.points, fields.normals
    if record_of(path.parent) is not None:  # in Unity's axes
        points, normals = points * FLIP, None if normals is None else normals * FLIP
    valid = (np.abs(points) <= FARTHEST).all(axis=1)  # NaN is not <= anything
    if normals is not None:
        normals = np.where(np.isfinite(normals).all(axis=1, keepdims=True), normals, 0)[valid].astype(np.float64)
        is_known = (normals != 0).any(axis=1)  # some programs write zeros
        normals = normals if is_known.sum() > KNOWN * len(normals) else None
    colors = None if fields.colors is None else fields.colors[valid]
    eye = None if fields.eye is None or (np.abs(fields.eye) > FARTHEST).any() else fields.eye * unit
    return Cloud(points[valid].astype(np.float64) * unit, normals, colors, eye)
