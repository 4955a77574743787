"""USD: a Mesh prim for each shape, its points as time samples, shown and hidden by its visibility.

In: shapes, one after the other. Out: a .usd or .usdc file (crate), .usda (text) or .usdz (package). Needs the extra
`usd`; the only module that imports `pxr`. What is in memory is saved before it is much, so it stays flat.
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
from jaxtyping import Float64

from ..errors import InputError
from ..io.file_names import is_text
from .shapes import Animation, Shape, changes, unit_normals

EXTENSIONS = (".usdc", ".usda", ".usdz", ".usd")
_GREY = (0.8, 0.8, 0.8)
_MOST_UNSAVED = 64 << 20  # bytes; each time it is saved, the names of all prims are written again
_MOST_PACKED = (1 << 32) - (1 << 16)  # of a crate in a .usdz file: a zip without 64-bit lengths
_ROUNDED = 1e-6  # s: times of .reel files are whole microseconds


@contextmanager
def animated_usd(path: Path, animation: Animation) -> Iterator[UsdWriter]:
    """A writer of shapes; the file appears at the end of the block, and not at all where that fails.

    Raises InputError where the file cannot be written, or where `pxr` is not installed.
    """
    try:
        from pxr import Tf
    except ImportError as error:
        raise InputError(f"USD needs the extra usd ({error}): pip install 'meshreel[usd]'") from None
    if not is_text(str(path)):
        raise InputError(f"{path}: USD takes no path that is not Unicode text; choose another folder, or .glb")
    try:
        with tempfile.TemporaryDirectory(".part", ".", path.parent, ignore_cleanup_errors=True) as folder:
            crate = Path(folder) / "scene.usdc"
            writer = UsdWriter(crate, animation)
            try:
                yield writer
                writer.save()
            finally:
                writer.close()
            _converted(crate, path).replace(path)
    except (OSError, Tf.ErrorException) as error:
        remedy = "free space, or choose another folder"
        raise InputError(f"{path}: cannot be written ({_reason(error)}); {remedy}") from None


class UsdWriter:
    """Adds prims to a stage that lies in a new crate file."""

    def __init__(self, crate: Path, animation: Animation) -> None:
        from pxr import Gf, Kind, Usd, UsdGeom

        stage = Usd.Stage.CreateNew(str(crate))
        self._stage, self._animation = stage, animation
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
            scene.AddTransformOp().Set(Gf.Matrix4d(animation.root.T.tolist()))  # rows, times which a point is taken
        Usd.ModelAPI(scene).SetKind(Kind.Tokens.component)
        stage.SetDefaultPrim(scene.GetPrim())

    def add(self, shape: Shape) -> None:
        """Writes a shape."""
        from pxr import UsdGeom, Vt

        part = UsdGeom.Xform.Define(self._stage, f"/scene/{_identifier(shape.part)}")
        mesh = UsdGeom.Mesh.Define(self._stage, part.GetPath().AppendChild(_identifier(shape.name)))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateDoubleSidedAttr(True)  # surfaces may be open
        mesh.CreateDisplayColorAttr([_GREY])
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(shape.faces), 3, np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(shape.faces.reshape(-1))))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        self._show(mesh, shape)
        self._unsaved += shape.faces.nbytes + self._move(mesh, shape)
        if self._unsaved > _MOST_UNSAVED:
            self.save()

    def save(self) -> None:
        """Writes what is in memory."""
        self._stage.Save()
        self._unsaved = 0

    def close(self) -> None:
        """Closes the file, which Windows neither moves nor deletes while it is open."""
        self._stage = None

    def _show(self, mesh: Any, shape: Shape) -> None:
        """When it is visible; USD holds such a value until the next."""
        from pxr import UsdGeom

        states = {True: UsdGeom.Tokens.inherited, False: UsdGeom.Tokens.invisible}
        shown = list(changes(shape, len(self._codes)))
        if shown == [(0, True)]:
            return
        visibility = mesh.CreateVisibilityAttr(states[shown[0][1]])  # as in the first frame, for who does not play
        for frame, is_shown in shown:
            visibility.Set(states[is_shown], self._codes[frame])

    def _move(self, mesh: Any, shape: Shape) -> int:
        """Where it is; USD goes linearly from one sample to the next. How many bytes that takes."""
        from pxr import Usd, Vt

        size = 0
        points, normals, extent = mesh.CreatePointsAttr(), mesh.CreateNormalsAttr(), mesh.CreateExtentAttr()
        for number, frame in enumerate(shape.frames):
            code = Usd.TimeCode.Default() if shape.count == 1 else Usd.TimeCode(self._codes[shape.first + number])
            local = self._animation.local(shape, frame.vertices)
            points.Set(Vt.Vec3fArray.FromNumpy(local), code)
            normals.Set(Vt.Vec3fArray.FromNumpy(unit_normals(frame)), code)
            extent.Set(Vt.Vec3fArray.FromNumpy(np.stack([local.min(axis=0), local.max(axis=0)])), code)
            size += 2 * local.nbytes
        return size


def _codes(animation: Animation) -> list[float]:
    """When frames are shown, in frames: whole numbers where times are those of the frame rate, but for rounding."""
    exact = animation.times * animation.frame_rate
    whole = np.round(exact)
    near: Float64[np.ndarray, " T"]
    near = np.where(np.abs(exact - whole) <= _ROUNDED * animation.frame_rate, whole, exact)
    codes: list[float] = (near if (np.diff(near) > 0).all() else exact).tolist()
    return codes


def _identifier(name: str) -> str:
    return re.sub(r"\W", "_", name, flags=re.ASCII)


def _converted(crate: Path, path: Path) -> Path:
    """The same file, where it is, in the form that its final name tells. OSError where it is not whole."""
    from pxr import Sdf, UsdUtils

    extension = path.suffix.lower()
    target = crate.with_suffix(extension)
    if extension == ".usda":
        whole = Sdf.Layer.FindOrOpen(str(crate)).Export(str(target))
    elif extension == ".usdz":
        if crate.stat().st_size > _MOST_PACKED:
            told = f"{path}: more than the {_MOST_PACKED} bytes that a .usdz file holds"
            raise InputError(f"{told}; export fewer frames or layers, or to .usdc")
        whole = UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(crate)), str(target)) and _is_whole(target)
    else:
        crate.replace(target)
        whole = True
    if not whole:
        raise OSError(errno.EIO, f"the {extension} file is too large or not whole")
    return target


def _is_whole(package: Path) -> bool:
    """Whether all of a .usdz file is there: USD does not tell when a disk is full."""
    try:
        with zipfile.ZipFile(package) as content:
            return content.testzip() is None
    except zipfile.BadZipFile:
        return False


def _reason(error: Exception) -> str:
    """What happened, without where in USD's source it did."""
    if isinstance(error, OSError):
        return str(error.strerror or error)
    quoted = re.findall(r"'([^']*)'", str(error).strip().splitlines()[0])
    return quoted[-1] if quoted else type(error).__name__
