"""Surfaces of USD files: the visible meshes of a stage at a time, in metres, with colours and pictures.

Topology may change in time. Bones are applied. What would be seen and is not read is named: curves, spheres, points,
smooth subdivision. Needs the extra `usd`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64, Int64, UInt8

from ..errors import InputError, needed
from ..types import Texture, Up, known_up
from .files import MOST_BYTES
from .glb_file import from_linear
from .looks import (
    CONSTANT,
    CORNERS,
    FACES,
    VERTICES,
    Look,
    Part,
    backwards,
    check_corners,
    joined,
    of_corners,
    of_vertices,
)
from .pictures import parse_picture
from .polygons import Polygons, Unreadable

EXTENSIONS = (".usd", ".usda", ".usdc", ".usdz")
_FEW = 1e-3  # frames: tolerance of rounded times
_PLACES = "st"  # name of the places in a picture, where no material says another
_MOST_PRIMS = 1_000_000  # of a stage (guess)
_TRANSFORMS = 8  # of places, one after the other, at most (guess)
_NEUTRAL: dict[str, Any] = {  # values that change nothing
    **dict.fromkeys(("wrapS", "wrapT"), ("useMetadata", "repeat")),
    "scale": ((1.0,) * 4,),
    "bias": ((0.0,) * 4,),
}
_KEPT_PICTURES = 4  # decoded, as many as a frame and its neighbours have (guess)
_KEPT_TEXTURES = 64  # of materials (guess)
_SCOPES = {"constant": CONSTANT, "uniform": FACES, "varying": VERTICES, "vertex": VERTICES, "faceVarying": CORNERS}


class UsdFile:
    """A USD file that is open."""

    def __init__(self, path: Path) -> None:
        """Raises Unreadable if the file is damaged, and InputError without the package."""
        with needed(f"{path}: USD needs the extra usd: pip install 'meshreel[usd]'"):
            from pxr import Tf, Usd, UsdGeom, UsdSkel
        try:
            self._stage = Usd.Stage.Open(str(path))
            self._stage.Reload()  # the package keeps what it read before
            self._stage.SetEditTarget(self._stage.GetSessionLayer())  # the file is not changed
            if any(prim.IsA(UsdSkel.Root) for prim in self._stage.Traverse()):
                UsdSkel.BakeSkinning(self._stage.Traverse())
        except Tf.ErrorException as error:
            quoted = re.findall(r": '(.*)'", str(error))
            raise Unreadable(f"USD cannot be read ({quoted[-1] if quoted else 'damaged'})") from None
        if errors := self._stage.GetCompositionErrors():
            texts = [str(one) for prim in self._stage.TraverseAll() for one in prim.GetPrimIndex().localErrors]
            reason = " ".join((texts or [type(errors[0]).__name__])[0].split())
            raise Unreadable(f"USD refers to what cannot be read ({reason:.200})")
        self._unit = UsdGeom.GetStageMetersPerUnit(self._stage)
        self.up: Up = known_up(UsdGeom.GetStageUpAxis(self._stage).lower())
        self._a_second = float(self._stage.GetTimeCodesPerSecond())
        authored = self._stage.HasAuthoredMetadata("framesPerSecond")
        rate = float(self._stage.GetFramesPerSecond()) if authored else self._a_second
        if not all(0 < one < np.inf for one in (rate, self._a_second, self._unit)):
            text = f"{rate:g} frames and {self._a_second:g} time codes a second, a unit of {self._unit:g} m"
            raise Unreadable(f"USD has {text}: give numbers above 0")
        self.frame_rate: float | None = rate
        codes = [
            code
            for prim in self._stage.Traverse()
            for attribute in prim.GetAttributes()
            for code in attribute.GetTimeSamples()
        ]
        self._codes = np.unique(np.array(codes, np.float64))  # of what changes, ascending
        self._begin, self._end = self._span()

    def count(self, frame_rate: float) -> int:
        """Return the number of frames at a rate, 1/s."""
        return int((self._end - self._begin) / self._a_second * frame_rate + _FEW) + 1

    def at(self, seconds: float) -> Polygons:
        """Return the surface at a time after the beginning, s."""
        from pxr import Tf, Usd

        named, code = set[str](), self._begin + seconds * self._a_second
        if len(self._codes):  # a sample is not missed by rounding
            nearest = self._codes[np.abs(self._codes - code).argmin()]
            few = _FEW * self._a_second / (self.frame_rate or 1.0)
            code = float(nearest) if abs(nearest - code) <= few else code
        try:
            parts = list(self._parts(Usd.TimeCode(code), named))
        except (Tf.ErrorException, TypeError, ValueError, IndexError, RuntimeError) as error:
            raise Unreadable(f"USD cannot be read ({str(error).strip().splitlines()[0]:.200})") from None
        return joined(parts).naming(named)

    def _span(self) -> tuple[float, float]:
        """Return the first and the last time code: those of the stage, or of what changes; one if nothing does."""
        if not len(self._codes):
            return 0.0, 0.0
        if self._stage.HasAuthoredTimeCodeRange():
            begin, end = self._stage.GetStartTimeCode(), self._stage.GetEndTimeCode()
            if not np.isfinite([begin, end]).all():
                raise Unreadable(f"USD runs from {begin:g} to {end:g}: give numbers")
            return begin, max(begin, end)
        return float(self._codes[0]), float(self._codes[-1])

    def _parts(self, time: Any, named: set[str]) -> Iterator[Part]:
        from pxr import Usd, UsdGeom

        places = UsdGeom.XformCache(time)
        prims = iter(Usd.PrimRange.Stage(self._stage, Usd.TraverseInstanceProxies()))
        for number, prim in enumerate(prims):
            if number > _MOST_PRIMS:
                raise Unreadable(f"USD has more than {_MOST_PRIMS} prims, counted as often as they are shown")
            imageable = UsdGeom.Imageable(prim)
            if not (prim.IsA(UsdGeom.Boundable) and imageable):
                continue
            hidden = imageable.ComputeVisibility(time) == UsdGeom.Tokens.invisible
            if hidden or imageable.ComputePurpose() in (UsdGeom.Tokens.guide, UsdGeom.Tokens.proxy):
                continue
            if not prim.IsA(UsdGeom.Mesh):
                if prim.IsA(UsdGeom.PointInstancer):
                    prims.PruneChildren()  # its prototypes are nowhere themselves
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
        check_corners(f"USD mesh {mesh.GetPath()}", corners, sizes, len(points))
        if mesh.GetSubdivisionSchemeAttr().Get(time) not in ("none", None):
            named.add("smooth subdivision (the cage is taken)")
        if len(mesh.GetHoleIndicesAttr().Get(time) or ()):
            named.add("holes of meshes")
        vertices = (points.astype(np.float64) @ matrix[:3, :3] + matrix[3, :3]) * self._unit
        is_turned = (mesh.GetOrientationAttr().Get(time) == "leftHanded") != (np.linalg.det(matrix[:3, :3]) < 0)
        order = backwards(sizes) if is_turned else np.arange(len(corners))
        primvar = mesh.GetDisplayColorPrimvar()
        light = _array(primvar.ComputeFlattened(time)).reshape(-1, 3) if primvar.HasValue() else np.zeros((0, 3))
        painted = from_linear(np.clip(np.nan_to_num(light.astype(np.float64)), 0, 1))
        colors, one = of_vertices(painted, _scope_of(primvar), len(points), corners, sizes)
        for chosen, material in _subsets(mesh, len(sizes), time):
            rows = np.repeat(chosen, sizes)
            look, places = _look(material, time, named)
            uv = None if look.picture is None else _uv(mesh, places, time, len(points), corners)
            if look.picture is not None and uv is None:
                named.add("a texture (without places)")
                look = Look()
            look = look if look != Look() or one is None else Look(one)
            used, numbers = np.unique(corners[order][rows], return_inverse=True)
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


def _scope_of(primvar: Any) -> str | None:
    """Return whose values a primvar has, as `looks` names it; None where the file does not say."""
    return _SCOPES.get(primvar.GetInterpolation()) if primvar.HasAuthoredInterpolation() else None


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
    opacity = surface.GetInput("opacity") if surface else None
    if opacity and (opacity.GetConnectedSources()[0] or opacity.Get(time) not in (None, 1.0)):
        named.add("transparency")
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
    reader = _source(source, "st")
    for _ in range(_TRANSFORMS):
        if reader is not None and reader.GetInput("in"):  # of UsdTransform2d
            named.add("moved pictures (UsdTransform2d)")
            reader = _source(reader, "in")
    name = reader.GetInput("varname").Get(time) if reader is not None and reader.GetInput("varname") else None
    for word, neutral in _NEUTRAL.items():
        given = source.GetInput(word).Get(time) if source.GetInput(word) else None
        if given is not None and (given if isinstance(given, str) else tuple(given)) not in neutral:
            named.add(f"{word} of pictures")
    path = str(file.resolvedPath or file.path)
    state = Path(path).stat() if Path(path).exists() else None
    if state is not None and (not Path(path).is_file() or state.st_size > MOST_BYTES):
        raise Unreadable(f"the texture {path} is no file of at most {MOST_BYTES} bytes")
    texture = _texture(path, state and (state.st_size, state.st_mtime_ns))
    return Look(None, texture), str(name or _PLACES)


def _source(shader: Any, name: str) -> Any:
    """Return the shader that an input is connected to, or None."""
    from pxr import UsdShade

    sources = shader.GetInput(name).GetConnectedSources()[0] if shader.GetInput(name) else []
    return UsdShade.Shader(sources[0].source.GetPrim()) if sources else None


@lru_cache(maxsize=_KEPT_TEXTURES)
def _texture(path: str, state: object) -> Texture:
    """Return the one texture of a picture, which several materials may have, in a state of its file."""
    return Texture(partial(_picture, path, state))


@lru_cache(maxsize=_KEPT_PICTURES)
def _picture(path: str, _state: object) -> UInt8[np.ndarray, "H W 3"]:
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

    primvar = UsdGeom.PrimvarsAPI(mesh).FindPrimvarWithInheritance(name)
    values = _array(primvar.ComputeFlattened(time)) if primvar and primvar.HasValue() else np.zeros(0)
    if values.ndim != 2 or values.shape[1] != 2:
        return None
    return of_corners(values.astype(np.float32), _scope_of(primvar), count, corners)
