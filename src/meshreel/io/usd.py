"""Surfaces of USD files: the visible meshes of a stage at a time, in metres, with colours and pictures.

Topology may change in time. Bones are applied. What would be seen and is not read is named: curves, spheres, points,
smooth subdivision. Needs the extra `usd`.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64, Int64, UInt8

from ..errors import InputError, needed
from ..types import Texture, Up, known_up
from .glb_file import from_linear
from .looks import Look, Part, joined, of_vertices
from .pictures import parse_picture
from .polygons import Polygons, Unreadable

EXTENSIONS = (".usd", ".usda", ".usdc", ".usdz")
_FEW = 1e-3  # of a frame, by which the last moment may be missed by rounding
_PLACES = "st"  # name of the places in a picture, where no material says another
_KEPT_PICTURES = 4  # decoded, as many as a frame and its neighbours have (guess)


class Stage:
    """A USD file that is open."""

    def __init__(self, path: Path) -> None:
        """Raises Unreadable if the file is damaged, and InputError without the package."""
        with needed(f"{path}: USD needs the extra usd: pip install 'meshreel[usd]'"):
            from pxr import Tf, Usd, UsdGeom, UsdSkel
        try:
            self._stage = Usd.Stage.Open(str(path))
            self._stage.SetEditTarget(self._stage.GetSessionLayer())  # the file is not changed
            if any(prim.IsA(UsdSkel.Root) for prim in self._stage.Traverse()):
                UsdSkel.BakeSkinning(self._stage.Traverse())
        except Tf.ErrorException as error:
            lines = str(error).strip().splitlines()
            raise Unreadable(f"USD cannot be read ({lines[-1].strip() if lines else 'damaged'})") from None
        self._unit = UsdGeom.GetStageMetersPerUnit(self._stage)
        self.up: Up = known_up(UsdGeom.GetStageUpAxis(self._stage).lower())
        self.frame_rate: float | None = float(self._stage.GetFramesPerSecond() or self._stage.GetTimeCodesPerSecond())
        self._a_second = float(self._stage.GetTimeCodesPerSecond())
        self._begin, self._end = self._span()

    def count(self, frame_rate: float) -> int:
        """Return the number of frames at a rate, 1/s."""
        return int((self._end - self._begin) / self._a_second * frame_rate + _FEW) + 1

    def at(self, seconds: float) -> Polygons:
        """Return the surface at a time after the beginning, s."""
        from pxr import Tf, Usd

        named = set[str]()
        try:
            parts = list(self._parts(Usd.TimeCode(self._begin + seconds * self._a_second), named))
        except (Tf.ErrorException, TypeError, ValueError, IndexError, RuntimeError) as error:
            raise Unreadable(f"USD cannot be read ({str(error).strip().splitlines()[0]:.200})") from None
        return joined(parts).naming(named)

    def _span(self) -> tuple[float, float]:
        """Return the first and the last time code: those of the stage, or else of what moves in it."""
        if self._stage.HasAuthoredTimeCodeRange():
            return self._stage.GetStartTimeCode(), max(self._stage.GetStartTimeCode(), self._stage.GetEndTimeCode())
        times = [
            time
            for prim in self._stage.Traverse()
            for attribute in prim.GetAttributes()
            for time in attribute.GetTimeSamples()
        ]
        return min(times, default=0.0), max(times, default=0.0)

    def _parts(self, time: Any, named: set[str]) -> Iterator[Part]:
        from pxr import Usd, UsdGeom

        places = UsdGeom.XformCache(time)
        for prim in Usd.PrimRange.Stage(self._stage, Usd.TraverseInstanceProxies()):
            imageable = UsdGeom.Imageable(prim)
            if not (prim.IsA(UsdGeom.Boundable) and imageable):
                continue
            hidden = imageable.ComputeVisibility(time) == UsdGeom.Tokens.invisible
            if hidden or imageable.ComputePurpose() in (UsdGeom.Tokens.guide, UsdGeom.Tokens.proxy):
                continue
            if not prim.IsA(UsdGeom.Mesh):
                if prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.PointInstancer):
                    named.add(f"prims of type {prim.GetTypeName()}")
                continue
            matrix = np.array(places.GetLocalToWorldTransform(prim), np.float64)  # of rows, from the left
            yield from self._mesh(UsdGeom.Mesh(prim), matrix, time, named)

    def _mesh(self, mesh: Any, matrix: Float64[np.ndarray, "4 4"], time: Any, named: set[str]) -> Iterator[Part]:
        """Yield the polygons of a mesh by their materials."""
        points, sizes = (_array(of.Get(time)) for of in (mesh.GetPointsAttr(), mesh.GetFaceVertexCountsAttr()))
        corners = _array(mesh.GetFaceVertexIndicesAttr().Get(time)).astype(np.int64)
        sizes = sizes.astype(np.int64)
        if not len(points) or not len(sizes):
            return
        if sizes.sum() != len(corners) or (sizes < 0).any():
            text = f"{mesh.GetPath()} has {len(corners)} corners, and its polygons {int(sizes.sum())}"
            raise Unreadable(f"USD mesh {text}")
        scheme = mesh.GetSubdivisionSchemeAttr()
        if scheme.HasAuthoredValue() and scheme.Get(time) not in ("none", None):
            named.add("smooth subdivision (the cage is taken)")
        if len(mesh.GetHoleIndicesAttr().Get(time) or ()):
            named.add("holes of meshes")
        vertices = (points.astype(np.float64) @ matrix[:3, :3] + matrix[3, :3]) * self._unit
        order = np.arange(len(corners))
        if (mesh.GetOrientationAttr().Get(time) == "leftHanded") != (np.linalg.det(matrix[:3, :3]) < 0):
            ends = np.cumsum(sizes)
            order = np.repeat(ends - sizes + ends - 1, sizes) - order  # corners backwards, within each polygon
        found = mesh.GetDisplayColorPrimvar()
        light = _array(found.ComputeFlattened(time)).reshape(-1, 3) if found.HasValue() else np.zeros((0, 3))
        painted = from_linear(np.clip(light.astype(np.float64), 0, 1))
        colors, one = of_vertices(painted, len(points), corners, sizes)
        for chosen, material in _subsets(mesh, len(sizes), time):
            rows = np.repeat(chosen, sizes)
            look, places = _look(material, time, named)
            uv = None if look.picture is None else _uv(mesh, places, time, len(points), corners)
            if look.picture is not None and uv is None:
                named.add("a texture (without places)")
                look = Look()
            look = look if look != Look() or one is None else Look(one)
            own = corners[order][rows]
            used, numbers = np.unique(own, return_inverse=True)
            if len(used) and not 0 <= used[0] <= used[-1] < len(points):
                text = f"{mesh.GetPath()} refers to point {int(used[-1])}, and has {len(points)}"
                raise Unreadable(f"USD mesh {text}")
            shown = None if colors is None else colors[used]
            yield Part(
                vertices[used],
                numbers.reshape(-1).astype(np.int64),
                sizes[chosen],
                shown,
                None if uv is None else uv[order][rows],
                look,
            )


def _array(value: Any) -> np.ndarray:
    return np.zeros(0) if value is None else np.asarray(value)


def _subsets(mesh: Any, count: int, time: Any) -> Iterator[tuple[np.ndarray, Any]]:
    """Yield masks of the polygons of each material of a mesh, and that material, which may be None."""
    from pxr import UsdShade

    def bound(prim: Any) -> Any:
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        return material or None

    rest = np.ones(count, bool)
    for subset in UsdShade.MaterialBindingAPI(mesh.GetPrim()).GetMaterialBindSubsets():
        numbers = _array(subset.GetIndicesAttr().Get(time)).astype(np.int64)
        chosen = np.zeros(count, bool)
        chosen[numbers[(numbers >= 0) & (numbers < count)]] = True
        chosen &= rest
        rest &= ~chosen
        if chosen.any():
            yield chosen, bound(subset.GetPrim())
    if rest.any():
        yield rest, bound(mesh.GetPrim())


def _look(material: Any, time: Any, named: set[str]) -> tuple[Look, str]:
    """Return the colour or the picture of a material, and the name of the places in it."""
    if material is None:
        return Look(), _PLACES
    surface, _, _ = material.ComputeSurfaceSource()
    color = surface.GetInput("diffuseColor") if surface else None
    if not color:
        named.add("materials without diffuseColor")
        return Look(), _PLACES
    sources = color.GetConnectedSources()[0]
    if not sources:
        value = color.Get(time)
        red, green, blue = from_linear(np.clip(np.array([value], np.float64), 0, 1))[0].tolist() if value else (0, 0, 0)
        return Look((red, green, blue)) if value else Look(), _PLACES
    source = sources[0].source
    file = source.GetInput("file").Get(time) if source.GetInput("file") else None
    if file is None:
        if not str(sources[0].sourceName).startswith("result"):
            named.add("materials that compute their colours")
        return Look(), _PLACES  # as from displayColor, which the mesh has
    where = source.GetInput("st").GetConnectedSources()[0] if source.GetInput("st") else []
    name = where[0].source.GetInput("varname").Get(time) if where and where[0].source.GetInput("varname") else None
    resolved = str(file.resolvedPath or file.path)
    return Look(None, Texture(partial(_picture, resolved))), str(name or _PLACES)


@lru_cache(maxsize=_KEPT_PICTURES)
def _picture(path: str) -> UInt8[np.ndarray, "H W 3"]:
    """Return the picture in a file, also in one of a package. Raises InputError if it cannot be read."""
    from pxr import Ar

    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    if asset is None:
        raise InputError(f"{path}: the texture of a USD file is missing; put it there, or encode with --color none")
    return parse_picture(bytes(asset.GetBuffer()), path)


def _uv(
    mesh: Any, name: str, time: Any, count: int, corners: Int64[np.ndarray, " C"]
) -> Float32[np.ndarray, "C 2"] | None:
    """Return the places of corners in a picture; None where a mesh has none of this name."""
    from pxr import UsdGeom

    found = UsdGeom.PrimvarsAPI(mesh).FindPrimvarWithInheritance(name)
    values = _array(found.ComputeFlattened(time)) if found and found.HasValue() else np.zeros(0)
    if values.ndim != 2 or values.shape[1] != 2:
        return None
    if len(values) == len(corners):
        return values.astype(np.float32)
    valid = (corners >= 0) & (corners < count)
    return values[np.where(valid, corners, 0)].astype(np.float32) if len(values) == count else None
