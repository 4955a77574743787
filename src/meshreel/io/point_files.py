"""Files of point clouds: PLY, PCD, npz, LAS and LAZ. In: a file. Out: its arrays, of whatever type they are."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import needed
from .files import MOST_BYTES, read_input
from .ply import parse_ply_points
from .polygons import Unreadable, eight_bits

_LONGEST_HEADER = 4096  # bytes of a PCD (guess)
_LAS_HEAD, _LAS_RECORD = 227, 54  # bytes of the shortest header, and of one of a variable record (LAS 1.4)
_NAMES = ("points", "vertices", "xyz", "positions")  # of the places in an .npz
_TYPES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}  # bytes of a number in a PCD, by its letter


class PointFields(NamedTuple):
    """The arrays of a file, of any type; lengths are those of `points`."""

    points: np.ndarray
    normals: np.ndarray | None = None
    colors: np.ndarray | None = None  # 8 bits
    eye: np.ndarray | None = None


def read_points(path: Path) -> PointFields:
    """Return the arrays of a file of one of `KINDS`. Raises Unreadable for damage and for meshes, and InputError."""
    return _PARSERS[path.suffix.lower()](read_input(path))


def _ply(data: bytes) -> PointFields:
    points, normals, colors, faces = parse_ply_points(data)
    if faces:
        raise Unreadable(f"has {faces} faces, so it is no point cloud but what `meshreel encode` takes")
    return PointFields(points, normals, colors)


def _npz(data: bytes) -> PointFields:
    wanted = {*_NAMES, "normals", "colors", "faces"}
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            sizes = {Path(one.filename).stem: one.file_size for one in archive.infolist()}
        if (size := sum(size for name, size in sizes.items() if name in wanted)) > MOST_BYTES:
            raise ValueError(f"its arrays have {size} bytes, more than {MOST_BYTES}")
        with np.load(io.BytesIO(data), allow_pickle=False) as loaded:
            arrays = {name: np.asarray(loaded[name]) for name in loaded.files if name in wanted}
    except Exception as error:  # of damage zipfile and NumPy raise many kinds
        raise Unreadable(f"cannot be read as .npz ({error or type(error).__name__})") from None
    points = next((arrays[name] for name in _NAMES if name in arrays), None)
    if points is None or points.ndim != 2 or points.shape[1:] != (3,) or points.dtype.kind not in "fiu":
        given = ", ".join(sizes) or "nothing"
        raise Unreadable(f"has {given}; points are an array 'points', N x 3")
    if len(faces := arrays.get("faces", np.zeros(0))):
        raise Unreadable(f"has {len(faces)} faces, so it is no point cloud but what `meshreel encode` takes")
    others = [arrays.get("normals"), arrays.get("colors")]
    for name, other in zip(("normals", "colors"), others, strict=True):
        if other is not None and (other.shape != points.shape or other.dtype.kind not in "fiu"):
            raise Unreadable(f"'{name}' is {other.dtype} {other.shape}, and 'points' {points.shape}: give one a point")
    return PointFields(points, others[0], None if others[1] is None else eight_bits(others[1]))


def _las(data: bytes) -> PointFields:
    with needed("LAS and LAZ need the extra `las`: pip install 'meshreel[las]'"):
        import laspy
    begin, records = (int.from_bytes(data[at : at + 4], "little") for at in (96, 100))  # LAS 1.4, table 3
    if len(data) < _LAS_HEAD or _LAS_RECORD * records > begin:
        raise Unreadable(f"LAS announces {records} records before its points, at byte {begin}")
    try:
        las = laspy.read(io.BytesIO(data))
        points, names = (
            np.stack([np.asarray(las[axis], np.float64) for axis in "xyz"], axis=1),
            ("red", "green", "blue"),
        )
        is_colored = {*names} <= {*las.point_format.dimension_names}
        colors = np.stack([np.asarray(las[name]) for name in names], axis=1) if is_colored else None
        count = las.header.point_count
    except Exception as error:  # of damage laspy raises many kinds
        raise Unreadable(f"cannot be read as LAS ({error or type(error).__name__})") from None
    if len(points) < count:
        raise Unreadable(f"LAS announces {count} points but has {len(points)} (truncated?)")
    if colors is not None and colors.max(initial=0) < 256:  # some programs write 8 bits
        colors = colors.astype(np.uint8)
    return PointFields(points, None, None if colors is None else eight_bits(colors))


def _pcd(data: bytes) -> PointFields:
    """Return the points of a file of the Point Cloud Library, version .7."""
    begin = re.search(rb"^DATA[ \t]+(\w+)[ \t]*\r?\n", data[:_LONGEST_HEADER], re.MULTILINE)
    if begin is None:
        raise Unreadable("PCD header has no line DATA (truncated?)")
    lines = [line.split() for line in data[: begin.start()].decode("ascii", "replace").splitlines()]
    head = {words[0]: words[1:] for words in lines if words and words[0] != "#"}
    try:
        names, sizes, kinds = head["FIELDS"], [int(size) for size in head["SIZE"]], head["TYPE"]
        repeats = [int(count) for count in head.get("COUNT", ["1"] * len(names))]
        count = int(head["POINTS"][0]) if "POINTS" in head else int(head["WIDTH"][0]) * int(head["HEIGHT"][0])
        fields = list(zip(kinds, sizes, repeats, strict=True))
        view = np.array([float(value) for value in head.get("VIEWPOINT", [])[:3]])
        is_known = all(size in _TYPES.get(kind, ()) and repeat > 0 for kind, size, repeat in fields)
        if not is_known or len(fields) != len(names) or count < 0 or not np.isfinite(view).all():
            raise ValueError
        row = np.dtype([(f"{k}", f"<{kind.lower()}{size}", (repeat,)) for k, (kind, size, repeat) in enumerate(fields)])
    except (KeyError, ValueError, IndexError, TypeError, OverflowError):
        raise Unreadable("PCD header has no matching FIELDS, SIZE, TYPE, COUNT, POINTS and VIEWPOINT") from None
    body, form = data[begin.end() :], begin[1].decode()
    if form == "ascii":
        columns = _pcd_text(body, row, count)
    elif form in ("binary", "binary_compressed"):
        body = _lzf(body, count * row.itemsize) if form != "binary" else body
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
    return PointFields(points, normals, colors, view if len(view) == 3 and view.any() else None)


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


def _lzf(body: bytes, wanted: int) -> bytes:
    """Unpack LZF, as PCD has it: two sizes of 32 bits, then runs of bytes and copies of earlier ones."""
    if len(body) < 8:
        raise Unreadable("PCD ends before its points")
    packed, size = (int.from_bytes(body[k : k + 4], "little") for k in (0, 4))
    data, out, at = body[8 : 8 + packed], bytearray(), 0
    if len(data) < packed or size != wanted:
        text = f"PCD announces {packed} packed bytes of {size}, for points of {wanted}, but has {len(data)}"
        raise Unreadable(f"{text} (truncated?)")
    try:
        while at < packed and len(out) <= size:
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


_PARSERS = {".ply": _ply, ".pcd": _pcd, ".npz": _npz, ".las": _las, ".laz": _las}
KINDS = tuple(_PARSERS)
