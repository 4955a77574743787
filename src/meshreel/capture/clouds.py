"""Point clouds as a sequence of meshes: a file for each frame, whose surface is made when it is read.

PLY, PCD, npz, LAS and LAZ (extra `las`). Points without a place (NaN) are left out.
"""

from __future__ import annotations

import io
import re
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, needed
from ..geometry.points import Cloud, surface_of, voxel_for
from ..geometry.topology import without_fragments
from ..io.file_names import Order, globbed, is_pattern, listed, ordered
from ..io.files import read_input
from ..io.meshes import FARTHEST
from ..io.ply import parse_ply_points
from ..io.polygons import Unreadable, eight_bits
from ..io.sequence import RATE, SequenceOptions
from ..types import Mesh, MeshSequence, Up, evenly

KINDS = (".ply", ".pcd", ".npz", ".las", ".laz")
PROBES = 3  # frames whose points tell the side of the voxels (guess)
FRAGMENT = 0.002  # m^2, as of fused depth
KNOWN = 0.5  # share of the points whose normals must be known, or all are found (guess)
LONGEST_HEADER = 4096  # bytes of a PCD (guess)
_PLACES, _NORMALS = ("points", "vertices", "xyz", "positions"), ("normals",)


@dataclass(frozen=True, slots=True)
class CloudOptions:
    """How clouds become surface."""

    voxel: float | None = None  # m; None: measured
    fragment: float = FRAGMENT  # m^2: connected pieces with less area are dropped
    unit: float = 1.0  # m, of the coordinates


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
    files, remarks = list(inputs), list[str]()
    if len(inputs) == 1:
        root, files = _found(inputs[0])
        if len(kinds := {path.suffix.lower() for path in files}) > 1:
            raise InputError(f"{inputs[0]}: holds {', '.join(sorted(kinds))} files; give one kind, by a pattern")
        if len(files) > 1:
            paths, warnings = ordered(inputs[0], root, files, order)
            files, remarks = list(paths), list(warnings)
    files = [files[number] for number in SequenceOptions(frames=frames).chosen(len(files))]
    if options.voxel is None:
        sizes = [voxel_for(read_cloud(files[number], options.unit)) for number in evenly(len(files), PROBES)]
        known = sorted(size for size in sizes if size > 0)
        if not known:
            text = f"{files[0]}: too few points for a surface, as in other frames looked at"
            raise InputError(f"{text}; give denser ones, or other frames by --frames")
        options = replace(options, voxel=float(f"{known[len(known) // 2]:.3g}"))
    return Clouds(tuple(files), options), remarks


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

    @property
    def frame_rate(self) -> float:
        """That of sequences whose files name none, 1/s."""
        return RATE

    @property
    def up(self) -> Up:
        """The axis that points up: z in LAS, y in other files, which do not tell."""
        return "z" if self.files[0].suffix.lower() in (".las", ".laz") else "y"

    @property
    def source(self) -> dict[str, Any]:
        """What the frames are made of, for a record of it; files are told apart by their sizes."""
        sizes = [(path.name, path.stat().st_size if path.exists() else 0) for path in self.files]
        folder = str(self.files[0].parent.resolve())
        return {"points": folder, "frames": zlib.crc32(repr(sizes).encode())} | asdict(self.options)

    def __len__(self) -> int:
        return len(self.files)

    def __getitem__(self, index: int) -> Mesh:
        assert self.options.voxel is not None
        path = self.files[range(len(self))[index]]
        cloud = read_cloud(path, self.options.unit)
        try:
            return without_fragments(surface_of(cloud, self.options.voxel), self.options.fragment)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None


def read_cloud(path: Path, unit: float = 1.0) -> Cloud:
    """Read the points of a file, with its normals and colours. Raises InputError for damage, and for meshes."""
    kind = path.suffix.lower()
    try:
        found = _las(path) if kind in (".las", ".laz") else _PARSERS[kind](read_input(path))
    except Unreadable as error:
        raise InputError(f"{path}: {error}; write it again, or leave it out with --frames") from None
    points, normals = found.points, found.normals
    valid = (np.abs(points) <= FARTHEST).all(axis=1)  # NaN is not <= anything
    if normals is not None:
        normals = np.where(np.isfinite(normals).all(axis=1, keepdims=True), normals, 0)[valid].astype(np.float64)
        normals = normals if (normals != 0).any(axis=1).mean() > KNOWN else None  # some programs write zeros
    colors = None if found.colors is None else found.colors[valid]
    eye = None if found.eye is None else found.eye * unit
    return Cloud(points[valid].astype(np.float64) * unit, normals, colors, eye)


class _Fields(NamedTuple):
    """The arrays of a file, of any type; lengths are those of `points`."""

    points: np.ndarray
    normals: np.ndarray | None = None
    colors: np.ndarray | None = None  # 8 bits
    eye: np.ndarray | None = None


def _ply(data: bytes) -> _Fields:
    points, normals, colors, faces = parse_ply_points(data)
    if faces:
        raise Unreadable(f"has {faces} faces, so it is no point cloud but what `meshreel encode` takes")
    return _Fields(points, normals, colors)


def _npz(data: bytes) -> _Fields:
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise Unreadable(f"cannot be read as .npz ({error})") from None
    points = next((arrays[name] for name in _PLACES if name in arrays), None)
    if points is None or points.ndim != 2 or points.shape[1:] != (3,) or points.dtype.kind not in "fiu":
        given = ", ".join(f"{name} {value.shape}" for name, value in arrays.items()) or "nothing"
        raise Unreadable(f"has {given}; points are an array 'points', N x 3")
    others = [arrays.get("normals"), arrays.get("colors")]
    for name, other in zip(("normals", "colors"), others, strict=True):
        if other is not None and (other.shape != points.shape or other.dtype.kind not in "fiu"):
            raise Unreadable(f"'{name}' is {other.dtype} {other.shape}, and 'points' {points.shape}: give one a point")
    return _Fields(points, others[0], None if others[1] is None else eight_bits(others[1]))


def _las(path: Path) -> _Fields:
    with needed("LAS and LAZ need the extra `las`: pip install 'meshreel[las]'"):
        import laspy
    try:
        found = laspy.read(path)
        points = np.stack([np.asarray(found[axis], np.float64) for axis in "xyz"], axis=1)
        has_colors = {"red", "green", "blue"} <= {*found.point_format.dimension_names}
        colors = (
            np.stack([np.asarray(found[name]) for name in ("red", "green", "blue")], axis=1) if has_colors else None
        )
    except Exception as error:  # of damage laspy raises many kinds
        raise Unreadable(f"cannot be read as LAS ({error})") from None
    if colors is not None and colors.max(initial=0) < 256:  # some programs write 8 bits
        colors = colors.astype(np.uint8)
    return _Fields(points, None, None if colors is None else eight_bits(colors))


def _pcd(data: bytes) -> _Fields:
    """Return the points of a file of the Point Cloud Library, version .7."""
    begin = re.search(rb"^DATA[ \t]+(\w+)[ \t]*\r?\n", data[:LONGEST_HEADER], re.MULTILINE)
    if begin is None:
        raise Unreadable("PCD header has no line DATA (truncated?)")
    lines = [line.split() for line in data[: begin.start()].decode("ascii", "replace").splitlines()]
    head = {words[0]: words[1:] for words in lines if words and words[0] != "#"}
    try:
        names, sizes, kinds = head["FIELDS"], [int(size) for size in head["SIZE"]], head["TYPE"]
        repeats = [int(count) for count in head.get("COUNT", ["1"] * len(names))]
        count = int(head["POINTS"][0]) if "POINTS" in head else int(head["WIDTH"][0]) * int(head["HEIGHT"][0])
        row = np.dtype(
            [
                (f"{k}", f"<{kind.lower()}{size}", (repeat,))
                for k, (kind, size, repeat) in enumerate(zip(kinds, sizes, repeats, strict=True))
            ]
        )
        assert count >= 0 and len(row.names or ()) == len(names)
    except (KeyError, ValueError, IndexError, TypeError, AssertionError):
        raise Unreadable("PCD header has no matching FIELDS, SIZE, TYPE and POINTS") from None
    body, form = data[begin.end() :], begin[1].decode()
    if form == "ascii":
        columns = _pcd_text(body, row, count)
    elif form in ("binary", "binary_compressed"):
        body = _lzf(body) if form != "binary" else body
        if len(body) < count * row.itemsize:
            raise Unreadable(f"PCD announces {count} points but has {len(body) // row.itemsize} (truncated?)")
        columns = _pcd_rows(body, row, count) if form == "binary" else _pcd_columns(body, row, count)
    else:
        raise Unreadable(f"PCD has DATA {form}; write ascii, binary or binary_compressed")
    named = {name: columns[f"{k}"][:, 0] for k, name in enumerate(names)}
    if not {"x", "y", "z"} <= named.keys():
        raise Unreadable(f"PCD has fields {', '.join(names)}: x, y and z are missing")
    points = np.stack([named[axis] for axis in "xyz"], axis=1).astype(np.float64)
    away = [named.get(f"normal_{axis}", named.get(f"n{axis}")) for axis in "xyz"]
    normals = (
        np.stack([one for one in away if one is not None], axis=1) if all(one is not None for one in away) else None
    )
    packed, colors = named.get("rgb", named.get("rgba")), None
    if packed is not None:  # 0x00RRGGBB, as an integer or in the bits of a float
        bits = packed.astype(np.float32).view(np.uint32) if packed.dtype.kind == "f" else packed.astype(np.uint32)
        colors = np.stack([bits >> 16, bits >> 8, bits], axis=1).astype(np.uint8)
    view = np.array([float(value) for value in head.get("VIEWPOINT", [])[:3]])
    return _Fields(points, normals, colors, view if len(view) == 3 and view.any() else None)


def _pcd_rows(body: bytes, row: np.dtype, count: int) -> dict[str, np.ndarray]:
    rows = np.frombuffer(body, row, count)
    return {name: rows[name] for name in row.names or ()}


def _pcd_columns(body: bytes, row: np.dtype, count: int) -> dict[str, np.ndarray]:
    """Return the fields of compressed points, which follow one another as a whole."""
    found, at = dict[str, np.ndarray](), 0
    for name in row.names or ():
        kind = row[name]
        found[name] = np.frombuffer(body, kind, count, at)
        at += count * kind.itemsize
    return found


def _pcd_text(body: bytes, row: np.dtype, count: int) -> dict[str, np.ndarray]:
    lines = [line for line in body.split(b"\n") if line.strip()][:count]
    if len(lines) < count:
        raise Unreadable(f"PCD announces {count} points but has {len(lines)} (truncated?)")
    width = sum(row[name].shape[0] for name in row.names or ())
    try:
        values = np.array([line.split() for line in lines], dtype=np.float64).reshape(count, -1 if count else width)
    except ValueError:
        raise Unreadable("PCD has rows that are not of numbers, or of different lengths") from None
    if values.shape != (count, width):
        raise Unreadable(f"PCD has rows of {values.shape[1]} numbers in place of {width}")
    found, at = dict[str, np.ndarray](), 0
    for name in row.names or ():
        base, (repeat,) = row[name].subdtype or (row[name], (1,))
        found[name] = values[:, at : at + repeat].astype(base)
        at += repeat
    return found


def _lzf(body: bytes) -> bytes:
    """Unpack LZF, as PCD has it: two sizes of 32 bits, then runs of bytes and copies of earlier ones."""
    if len(body) < 8:
        raise Unreadable("PCD ends before its points")
    packed, size = (int.from_bytes(body[k : k + 4], "little") for k in (0, 4))
    data, out, at = body[8 : 8 + packed], bytearray(), 0
    if len(data) < packed or size > 300 * packed + 300:  # three bytes copy 264
        raise Unreadable(f"PCD announces {packed} packed bytes of {size}, but has {len(data)} (truncated?)")
    try:
        while at < packed:
            control = data[at]
            at += 1
            if control < 32:
                out += data[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += data[at]
                at += 1
            start = len(out) - ((control & 31) << 8) - data[at] - 1
            at += 1
            if start < 0:
                raise IndexError
            if start + length + 2 <= len(out):
                out += out[start : start + length + 2]
                continue
            for k in range(length + 2):  # of bytes that it writes itself
                out.append(out[start + k])
    except IndexError:
        raise Unreadable("PCD is damaged: its packed points refer to none") from None
    if len(out) != size:
        raise Unreadable(f"PCD announces {size} bytes of points but has {len(out)}")
    return bytes(out)


_PARSERS = {".ply": _ply, ".pcd": _pcd, ".npz": _npz}
