"""Writer of USD: a Mesh prim for each shape, with points as time samples, shown and hidden by its visibility.

A file is .usd or .usdc (crate), .usda (text) or .usdz (package). Needs the extra `usd`; the only module that imports
`pxr`. The stage is saved whenever _MOST_UNSAVED bytes are pending, so that memory stays bounded.
"""

from __future__ import annotations

import errno
import re
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

from ..errors import InputError
from ..io.file_names import is_text
from ..io.glb_file import light
from ..io.pictures import pack_picture
from .shapes import Animation, Shape, changes, unit_normals

_GREY = (0.8, 0.8, 0.8)
_MOST_UNSAVED = 64 << 20  # bytes (guess); each save writes the names of all prims again
_MOST_PACKED = (1 << 32) - (1 << 16)  # bytes of a crate in a .usdz file, a zip without 64-bit lengths
_ROUNDED = 1e-6  # s: times of .reel files are whole microseconds


@contextmanager
def animated_usd(path: Path, animation: Animation) -> Iterator[UsdWriter]:
    """Open a writer of shapes; the file appears if the block succeeds. Raises InputError, also without `pxr`."""
    try:
        from pxr import Tf
    except ImportError as error:
        raise InputError(f"USD needs the extra usd ({error}): pip install 'meshreel[usd]'") from None
    if not is_text(str(path)):
        raise InputError(f"{path}: USD takes no path that is not Unicode text; choose another folder, or .glb")
    try:
        with tempfile.TemporaryDirectory(".part", ".", path.parent, ignore_cleanup_errors=True) as folder:
            crate, textures = Path(folder) / "scene.usdc", Path(folder) / f"{path.stem}_textures"
            writer = UsdWriter(crate, textures, animation)
            try:
                yield writer
                writer.save()
            finally:
                writer.close()
            converted = _converted(crate, path)
            if path.suffix.lower() != ".usdz":
                move_textures(textures, path)
            converted.replace(path)
    except (OSError, Tf.ErrorException) as error:
        remedy = "free space, or choose another folder"
        raise InputError(f"{path}: cannot be written ({_reason(error)}); {remedy}") from None


def move_textures(textures: Path, path: Path) -> None:
    """Move the pictures of a folder, if there is one, beside a file."""
    if textures.exists():
        (path.parent / textures.name).mkdir(exist_ok=True)
        for picture in textures.iterdir():
            picture.replace(path.parent / textures.name / picture.name)


class UsdWriter:
    """Writer that adds prims to a stage in a new crate file."""

    def __init__(self, crate: Path, textures: Path, animation: Animation) -> None:
        """Write to a new `crate`, and pictures to a folder `textures` beside it, which need not exist."""
        from pxr import Gf, Kind, Usd, UsdGeom

        stage = Usd.Stage.CreateNew(str(crate))
        self._stage, self._textures, self._animation = stage, textures, animation
        self._codes = _codes(animation)
        self._unsaved = 0
        stage.SetTimeCodesPerSecond(animation.frame_rate)
        stage.SetFramesPerSecond(animation.frame_rate)
        stage.SetStartTimeCode(0)
        stage.SetEndTimeCode(self._codes[-1])
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(stage, 1)
        scene = UsdGeom.Xform.Define(stage, "/scene")
        if not np.array_equal(animation.root, np.eye(4)):
            # USD multiplies row vectors from the left.
            scene.AddTransformOp().Set(Gf.Matrix4d(animation.root.T.tolist()))
        Usd.ModelAPI(scene).SetKind(Kind.Tokens.component)
        stage.SetDefaultPrim(scene.GetPrim())

    def add(self, shape: Shape) -> None:
        from pxr import UsdGeom, Vt

        part = UsdGeom.Xform.Define(self._stage, f"/scene/{_identifier(shape.part)}")
        mesh = UsdGeom.Mesh.Define(self._stage, part.GetPath().AppendChild(_identifier(shape.name)))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateDoubleSidedAttr(True)  # surfaces may be open
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(shape.faces), 3, np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(shape.faces.reshape(-1))))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        self._show(mesh, shape)
        self._unsaved += shape.faces.nbytes + self._move(mesh, shape)
        if self._unsaved > _MOST_UNSAVED:
            self.save()

    def save(self) -> None:
        """Write pending changes to the file."""
        self._stage.Save()
        self._unsaved = 0

    def close(self) -> None:
        """Close the file; Windows can neither move nor delete an open file."""
        self._stage = None

    def _show(self, mesh: Any, shape: Shape) -> None:
        """Write the visibility of a shape; USD holds each value until the next."""
        from pxr import UsdGeom

        states = {True: UsdGeom.Tokens.inherited, False: UsdGeom.Tokens.invisible}
        visible = list(changes(shape, len(self._codes)))
        if visible == [(0, True)]:
            return
        # As in the first frame, for viewers that do not animate.
        visibility = mesh.CreateVisibilityAttr(states[visible[0][1]])
        for frame, is_shown in visible:
            visibility.Set(states[is_shown], self._codes[frame])

    def _move(self, mesh: Any, shape: Shape) -> int:
        """Write points, normals and colours, which USD interpolates linearly between samples; return their bytes."""
        from pxr import Sdf, Usd, UsdGeom, Vt

        size = 0
        points, normals, extent = mesh.CreatePointsAttr(), mesh.CreateNormalsAttr(), mesh.CreateExtentAttr()
        colors = mesh.CreateDisplayColorPrimvar()
        picture = None if shape.uv is None else self._picture(mesh, shape, shape.uv)
        for number, frame in enumerate(shape.frames):
            code = Usd.TimeCode.Default() if len(shape.frames) == 1 else Usd.TimeCode(self._codes[shape.first + number])
            local = self._animation.local(shape, frame.vertices)
            points.Set(Vt.Vec3fArray.FromNumpy(local), code)
            normals.Set(Vt.Vec3fArray.FromNumpy(unit_normals(frame)), code)
            extent.Set(Vt.Vec3fArray.FromNumpy(np.stack([local.min(axis=0), local.max(axis=0)])), code)
            size += (2 if frame.colors is None else 3) * local.nbytes
            if frame.colors is not None:
                colors.Set(Vt.Vec3fArray.FromNumpy(light(frame.colors)), code)
            if picture is not None and frame.texture is not None and shape.first + number < shape.shown[0][1]:
                name = f"{_identifier(f'{shape.part}_{shape.first + number:05}')}.png"
                self._textures.mkdir(exist_ok=True)
                (self._textures / name).write_bytes(pack_picture(frame.texture.pixels))
                picture.Set(Sdf.AssetPath(f"./{self._textures.name}/{name}"), code)  # relative to the stage
        if frame.colors is None:
            colors.Set([_GREY])
        else:
            colors.SetInterpolation(UsdGeom.Tokens.vertex)
        return size

    def _picture(self, mesh: Any, shape: Shape, uv: Float32[np.ndarray, "F 3 2"]) -> Any:
        """Give faces with a texture a material; return the attribute that names the texture's file."""
        from pxr import Sdf, UsdGeom, UsdShade, Vt

        types, path = Sdf.ValueTypeNames, mesh.GetPath().AppendChild("material")
        places = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", types.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
        places.Set(Vt.Vec2fArray.FromNumpy(np.nan_to_num(uv).reshape(-1, 2)))
        material = UsdShade.Material.Define(self._stage, path)
        kinds = ("UsdPreviewSurface", "UsdUVTexture", "UsdPrimvarReader_float2")
        surface, picture, reader = (UsdShade.Shader.Define(self._stage, path.AppendChild(kind)) for kind in kinds)
        for shader, kind in zip((surface, picture, reader), kinds, strict=True):
            shader.CreateIdAttr(kind)
        reader.CreateInput("varname", types.String).Set("st")
        picture.CreateInput("sourceColorSpace", types.Token).Set("sRGB")
        picture.CreateInput("st", types.Float2).ConnectToSource(reader.CreateOutput("result", types.Float2))
        rgb = picture.CreateOutput("rgb", types.Float3)
        surface.CreateInput("diffuseColor", types.Color3f).ConnectToSource(rgb)
        surface.CreateInput("roughness", types.Float).Set(0.9)
        material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", types.Token))
        bound = UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim())
        if not shape.pictured.all():
            faces = Vt.IntArray.FromNumpy(np.flatnonzero(shape.pictured).astype(np.int32))
            subset = bound.CreateMaterialBindSubset("pictured", faces)
            bound = UsdShade.MaterialBindingAPI.Apply(subset.GetPrim())
        bound.Bind(material)
        return picture.CreateInput("file", types.Asset)


def _codes(animation: Animation) -> list[float]:
    """Return the times of frames in units of a frame: whole numbers if they follow the frame rate up to rounding."""
    exact = animation.times * animation.frame_rate
    rounded = np.round(exact)
    near = np.where(np.abs(exact - rounded) <= _ROUNDED * animation.frame_rate, rounded, exact)
    codes: list[float] = (near if (np.diff(near) > 0).all() else exact).tolist()
    return codes


def _identifier(name: str) -> str:
    return re.sub(r"\W", "_", name, flags=re.ASCII)


def _converted(crate: Path, path: Path) -> Path:
    """Convert a crate, in its folder, to the format of the extension of `path`. Raises OSError if that fails."""
    from pxr import Sdf, UsdUtils

    extension = path.suffix.lower()
    target = crate.with_suffix(extension)
    if extension == ".usda":
        complete = Sdf.Layer.FindOrOpen(str(crate)).Export(str(target))
    elif extension == ".usdz":
        if crate.stat().st_size > _MOST_PACKED:
            text = f"{path}: more than the {_MOST_PACKED} bytes that a .usdz file holds"
            raise InputError(f"{text}; export fewer frames or layers, or to .usdc")
        complete = UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(crate)), str(target)) and _is_whole(target)
    else:
        crate.replace(target)
        complete = True
    if not complete:
        raise OSError(errno.EIO, f"the {extension} file is too large or not whole")
    return target


def _is_whole(package: Path) -> bool:
    """Return whether a .usdz file is complete: USD reports no error when a disk is full."""
    try:
        with zipfile.ZipFile(package) as content:
            return content.testzip() is None
    except zipfile.BadZipFile:
        return False


def _reason(error: Exception) -> str:
    """Return the message of an error without the location in the source of USD."""
    if isinstance(error, OSError):
        return str(error.strerror or error)
    quoted = re.findall(r"'([^']*)'", str(error).strip().splitlines()[0])
    return quoted[-1] if quoted else type(error).__name__
