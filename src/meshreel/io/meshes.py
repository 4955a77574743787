"""Reader of one mesh file of any supported format."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Bool

from ..errors import InputError
from ..types import Mesh
from .alembic import EXTENSION as ABC
from .alembic import AlembicFile
from .files import Place, read_input
from .glb import Scene, parse_glb
from .materials import with_materials
from .obj import parse_obj
from .ply import parse_ply
from .polygons import CLOUD, Dropped, Polygons, Surfaceless, Unreadable, triangulate
from .stl_off import parse_off, parse_stl
from .usd import EXTENSIONS as USD
from .usd import UsdFile

_PARSERS = {".obj": parse_obj, ".ply": parse_ply, ".glb": parse_glb, ".stl": parse_stl, ".off": parse_off}
_PACKAGED: dict[str, type[UsdFile | AlembicFile]] = {
    **dict.fromkeys(USD, UsdFile),
    ABC: AlembicFile,
}
EXTENSIONS = (*_PARSERS, *_PACKAGED)
MOVING = (".glb", *_PACKAGED)  # of files that may have all frames
_MARK = b"\xef\xbb\xbf"  # of byte order, at the beginning of texts of some programs
_BEGINNINGS = {  # of files of other kinds, in small letters
    b"\x89png": "a PNG picture",
    b"\xff\xd8\xff": "a JPEG picture",
    b"pk\x03\x04": "a ZIP archive",
    b"\x1f\x8b": "compressed by gzip",
    b"<": "HTML or XML",
    b"{": "JSON",
    b"\x93numpy": "an array of NumPy",
    b"reel\r\n": "a .reel file",
    b"kaydara fbx": "an FBX file",
    **dict.fromkeys((b"pxr-usdc", b"#usda"), "a USD file"),
    b"gltf": "a GLB file",
    b"ply": "a PLY file",
    b"off": "an OFF file",
    b"solid": "an STL file",
}
FARTHEST = 1e12  # m, largest coordinate: beyond it the spacing of float64 exceeds 0.1 mm (guess)


@dataclass(frozen=True, slots=True)
class Loaded:
    """A mesh from a file, and the kinds of data in the file that are dropped."""

    mesh: Mesh
    dropped: Dropped


def read_mesh(path: Place, where: str | None = None, pictures: tuple[str, ...] = ()) -> Loaded:
    """Read a mesh in the file's order, cut into triangles; without faces it is empty. `where` begins errors.

    `pictures` are names of files beside a PLY that names none. Raises InputError for what cannot be read, and for
    points without faces.
    """
    where, kind = where or str(path), path.suffix.lower()
    if kind in _PACKAGED:
        with _reading(path, where):
            stage = moving_scene(path, where)
            if stage.count(stage.frame_rate or 1.0) > 1:
                text = "it has an animation, and is one of several files; give it alone, to have its frames"
                raise Unreadable(text)
            return checked(stage.at(0.0))
    parse = _PARSERS.get(kind)
    if parse is None:
        raise InputError(f"{where}: {path.suffix or 'no'} extension is not one of {', '.join(EXTENSIONS)}; convert it")
    data = _read(path, where)
    with _reading(path, where):
        data = data.removeprefix(_MARK) if kind in (".obj", ".ply", ".off") else data
        polygons = parse_ply(data, pictures) if kind == ".ply" else parse(data)
        return checked(with_materials(polygons, path) if polygons.has_looks else polygons)


def animation_of(path: Place) -> Scene | UsdFile | AlembicFile | None:
    """Return the scene of a file that may move; None if it cannot be read, which `read_mesh` raises with the frame."""
    try:
        return moving_scene(path, str(path))
    except (Unreadable, InputError):
        return None


def read_animated(path: Place, time: float, where: str) -> Loaded:
    """Read the mesh in a file as its animation has it at a time, s. Raises InputError as `read_mesh` does."""
    with _reading(path, where):
        return checked(moving_scene(path, where).at(time))


@contextmanager
def _reading(path: Place, where: str) -> Iterator[None]:
    """Turn Unreadable into an InputError with a remedy."""
    try:
        yield
    except Surfaceless as error:
        raise InputError(f"{where}: {error}") from None
    except Unreadable as error:
        kind, begins = path.suffix[1:].upper(), _read(path, where)[:256].removeprefix(_MARK).lstrip().lower()
        own = {"USDZ": "ZIP"}.get(kind, "USD" if path.suffix.lower() in USD else kind)
        for beginning, name in _BEGINNINGS.items():
            if begins.startswith(beginning) and own not in name:
                raise InputError(f"{where}: is {name}, whatever its name says; put a {kind} file there") from None
        raise InputError(f"{where}: {error}; re-export the {kind} file, or leave it out with --frames") from None


def _read(path: Place, where: str) -> bytes:
    data = read_input(path, where=where)
    if not data:
        raise InputError(f"{where}: the file has 0 bytes; write it again, or leave it out with --frames")
    return data


def moving_scene(path: Place, where: str) -> Scene | UsdFile | AlembicFile:
    """Return the scene of a file of `MOVING`, which is kept. Raises Unreadable and InputError."""
    state = path.stat() if isinstance(path, Path) and path.exists() else None
    return _opened(path, where if state is None else str(path), state and (state.st_size, state.st_mtime_ns))


@lru_cache(maxsize=2)  # scenes at a time (guess)
def _opened(path: Place, where: str, _state: object) -> Scene | UsdFile | AlembicFile:
    """Return the scene of a file, read again if the file has changed."""
    kind = _PACKAGED.get(path.suffix.lower())
    if kind is None:
        return Scene(_read(path, where))
    if not isinstance(path, Path):
        raise InputError(f"{where}: {path.suffix} is not read by URL; copy it here")
    if not path.is_file() or not path.stat().st_size:
        _read(path, where)  # raises
    return kind(path)


def _only(polygons: Polygons, kept: Bool[np.ndarray, " V"]) -> Polygons:
    """Return polygons without other vertices, which no face has."""
    numbers, corners = np.cumsum(kept) - 1, polygons.corners
    valid = (corners >= 0) & (corners < len(kept))
    colors = None if polygons.colors is None else polygons.colors[kept]
    corners = np.where(valid, numbers[np.where(valid, corners, 0)], corners)
    return replace(polygons, vertices=polygons.vertices[kept], corners=corners, colors=colors, colored=None)


def checked(polygons: Polygons) -> Loaded:
    """Return the mesh of polygons after checking every number. Raises Unreadable for the first invalid one."""
    vertices, corners, sizes = polygons.vertices, polygons.corners, polygons.sizes
    near = np.abs(vertices) <= FARTHEST  # NaN is not <= anything
    used = np.zeros(len(vertices), bool)
    used[corners[(corners >= 0) & (corners < len(vertices))]] = True
    if len(sizes) and not near[~used].all():  # programs mark points without a measurement so
        return checked(_only(polygons, used | near.all(axis=1)))
    if not near.all():
        bad = np.flatnonzero(~near.all(axis=1))
        x, y, z = vertices[bad[0]]
        raise Unreadable(f"vertex {bad[0]} is at ({x:g}, {y:g}, {z:g}), and {len(bad)} in all are not within 1e12")
    if (sizes < 3).any():
        raise Unreadable(f"face {int(np.argmax(sizes < 3))} has {sizes[sizes < 3][0]} corners instead of 3 or more")
    wrong = np.flatnonzero((corners < 0) | (corners >= len(vertices)))
    if len(wrong):
        face = int(np.searchsorted(np.cumsum(sizes), wrong[0], side="right"))
        raise Unreadable(f"face {face} refers to vertex {corners[wrong[0]]}, but there are {len(vertices)} (from 0)")
    if len(sizes) == 0:
        if len(vertices) >= CLOUD:
            raise Surfaceless(len(vertices))
        loose = frozenset({"vertices without faces"} if len(vertices) else ())
        return Loaded(Mesh.empty(), polygons.dropped | loose)
    triangles = triangulate(polygons)
    mesh = Mesh.of(vertices, corners[triangles])
    if polygons.uv is None or polygons.texture is None:
        lost = frozenset() if polygons.uv is None else frozenset({"texture coordinates"})
        return Loaded(replace(mesh, colors=polygons.colors), polygons.dropped | lost)
    uv = np.where(np.isfinite(polygons.uv), polygons.uv, np.float32(np.nan))[triangles]
    return Loaded(replace(mesh, colors=polygons.colors, uv=uv, texture=polygons.texture), polygons.dropped)
