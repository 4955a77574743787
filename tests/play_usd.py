"""Player of USD files for the tests, built on USD itself."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image
from pxr import Ar, Usd, UsdGeom, UsdShade, UsdValidation

from meshreel.io.glb_file import from_linear
from meshreel.types import Mesh, Texture

_ROUNDED = 1.001e-6  # s: a time of whole microseconds may be that of the frame rate, rounded


def complaints(path: Path) -> list[str]:
    """What the validators that come with USD have against a file."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 10
    errors = UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path)))
    return [error.GetMessage() for error in errors]


class PlayedUsd:
    """A stage that is open."""

    def __init__(self, path: Path) -> None:
        self.stage = Usd.Stage.Open(str(path))

    def shown(self, time: float | None) -> dict[str, list[tuple[Mesh, np.ndarray]]]:
        """What is seen, mesh and normals, by part of the scene; at a time in s, without one by default."""
        code = Usd.TimeCode.Default() if time is None else Usd.TimeCode(self._code(time))
        found: dict[str, list[tuple[Mesh, np.ndarray]]] = {}
        for part in self.stage.GetDefaultPrim().GetChildren():
            prims = [UsdGeom.Mesh(child) for child in part.GetChildren()]
            visible = [prim for prim in prims if prim.ComputeVisibility(code) == UsdGeom.Tokens.inherited]
            found[part.GetName()] = [_mesh(prim, code) for prim in visible]
        return found

    def _code(self, time: float) -> float:
        """That of the samples which is at this time but for rounding; else what the time says."""
        rate = self.stage.GetTimeCodesPerSecond()
        attributes = [attribute for prim in self.stage.Traverse() for attribute in prim.GetAttributes()]
        codes = [code for attribute in attributes for code in attribute.GetTimeSamples()]
        nearest = min(codes, key=lambda code: abs(code - time * rate), default=time * rate)
        return nearest if abs(nearest - time * rate) <= _ROUNDED * rate else time * rate


def _mesh(prim: UsdGeom.Mesh, code: Usd.TimeCode) -> tuple[Mesh, np.ndarray]:
    assert set(prim.GetFaceVertexCountsAttr().Get()) == {3}
    assert prim.GetSubdivisionSchemeAttr().Get() == "none" and prim.GetNormalsInterpolation() == "vertex"
    if not prim.GetPointsAttr().HasValue() or prim.GetPointsAttr().Get(code) is None:
        code = Usd.TimeCode.EarliestTime()
    points, normals = (np.array(attr.Get(code)) for attr in (prim.GetPointsAttr(), prim.GetNormalsAttr()))
    extent = np.array(prim.GetExtentAttr().Get(code))
    assert (extent[0] <= points.min(axis=0) + 1e-6).all() and (extent[1] >= points.max(axis=0) - 1e-6).all()
    matrix = np.array(prim.ComputeLocalToWorldTransform(code))
    vertices = points.astype(np.float64) @ matrix[:3, :3] + matrix[3, :3]
    mesh = Mesh.of(vertices, np.array(prim.GetFaceVertexIndicesAttr().Get()))
    display = prim.GetDisplayColorPrimvar()
    if display.GetInterpolation() == UsdGeom.Tokens.vertex:
        mesh = replace(mesh, colors=from_linear(np.array(display.Get(code))))
    return _textured(mesh, prim, code), normals @ matrix[:3, :3]


def _textured(mesh: Mesh, prim: UsdGeom.Mesh, code: Usd.TimeCode) -> Mesh:
    """The mesh with the picture that its material has at a time, if it has one."""
    subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
    bound = subsets[0].GetPrim() if subsets else prim.GetPrim()
    material, _ = UsdShade.MaterialBindingAPI(bound).ComputeBoundMaterial()
    if not material:
        return mesh
    surface = material.ComputeSurfaceSource()[0]
    picture = UsdShade.Shader(surface.GetInput("diffuseColor").GetConnectedSources()[0][0].source)
    reader = UsdShade.Shader(picture.GetInput("st").GetConnectedSources()[0][0].source)
    places = UsdGeom.PrimvarsAPI(prim).GetPrimvar(reader.GetInput("varname").Get())
    assert places.GetInterpolation() == UsdGeom.Tokens.faceVarying
    uv = np.array(places.Get(), np.float32).reshape(-1, 3, 2)
    if subsets:
        uv[np.setdiff1d(np.arange(len(uv)), np.array(subsets[0].GetIndicesAttr().Get()))] = np.nan
    resolved = picture.GetInput("file").Get(code).resolvedPath
    data = bytes(Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved)).GetBuffer())
    return replace(mesh, uv=uv, texture=Texture.of(np.asarray(Image.open(io.BytesIO(data)))))
