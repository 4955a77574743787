"""Reader of one mesh file of any supported format."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..types import Mesh
from .files import Place, read_input
from .glb import parse_glb
from .obj import parse_obj
from .pictures import texture_of_materials
from .ply import parse_ply
from .polygons import Dropped, Polygons, Unreadable, triangulate
from .stl_off import parse_off, parse_stl

_PARSERS: dict[str, Callable[[bytes], Polygons]] = {
    ".obj": parse_obj,
    ".ply": parse_ply,
    ".glb": parse_glb,
    ".stl": parse_stl,
    ".off": parse_off,
}
EXTENSIONS = tuple(_PARSERS)
FARTHEST = 1e12  # m, largest coordinate: beyond it the spacing of float64 exceeds 0.1 mm (guess)


@dataclass(frozen=True, slots=True)
class Loaded:
    """A mesh from a file, and the kinds of data in the file that are dropped."""

    mesh: Mesh
    dropped: Dropped


def read_mesh(path: Place, where: str | None = None) -> Loaded:
    """Read the mesh in a file, with its vertices and faces in the order of the file and polygons cut into triangles.

    A file without faces is an empty frame; its vertices are dropped and named. `where` begins each error message.
    """
    where = where or str(path)
    parse = _PARSERS.get(path.suffix.lower())
    if parse is None:
        raise InputError(f"{where}: {path.suffix or 'no'} extension is not one of {', '.join(EXTENSIONS)}; convert it")
    data = read_input(path, where=where)
    if not data:
        raise InputError(f"{where}: the file has 0 bytes; write it again, or leave it out with --frames")
    try:
        polygons = parse(data)
        if polygons.uv is not None and polygons.texture is None:
            texture, dropped = texture_of_materials(path, polygons.materials, polygons.used)
            polygons = replace(polygons, texture=texture, dropped=polygons.dropped | dropped)
        return checked(polygons)
    except Unreadable as error:
        kind = path.suffix[1:].upper()
        raise InputError(f"{where}: {error}; re-export the {kind} file, or leave it out with --frames") from None


def checked(polygons: Polygons) -> Loaded:
    """Return the mesh of polygons after checking every number. Raises Unreadable for the first invalid one."""
    vertices, corners, sizes = polygons.vertices, polygons.corners, polygons.sizes
    near = np.abs(vertices) <= FARTHEST  # NaN is not <= anything
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
        loose = frozenset({"vertices without faces"} if len(vertices) else ())
        return Loaded(Mesh.empty(), polygons.dropped | loose)
    triangles = triangulate(polygons)
    mesh = Mesh.of(vertices, corners[triangles])
    if polygons.uv is None or polygons.texture is None:
        lost = frozenset() if polygons.uv is None else frozenset({"texture coordinates"})
        return Loaded(replace(mesh, colors=polygons.colors), polygons.dropped | lost)
    uv = np.where(np.isfinite(polygons.uv), polygons.uv, np.float32(np.nan))[triangles]
    return Loaded(replace(mesh, colors=polygons.colors, uv=uv, texture=polygons.texture), polygons.dropped)
