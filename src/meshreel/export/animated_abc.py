"""Writer of Alembic: a polygon mesh for each part of a scene, with a sample for each frame, whose faces may be others.

Normals, colours (`Cs`, linear light) and texture coordinates go along; the format names no pictures, which lie in a
folder beside the file, one for each frame. Needs the extra `alembic`.
"""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, needed
from ..io.alembic import COLORS, EXTENSION
from ..io.glb_file import light
from ..io.pictures import pack_picture
from ..types import Mesh
from .animated_usd import move_textures
from .shapes import Animation, Shape, unit_normals

SPARE, TIMES = 4 << 20, 8  # bytes that a disk must have free, and times those of a sample's places and faces (guess)
_EVEN = 1e-6  # s, by which times of frames that are even may be off: those of .reel files are whole microseconds


@contextmanager
def animated_abc(path: Path, animation: Animation) -> Iterator[AbcWriter]:
    """Open a writer of shapes; the file appears if the block succeeds. Raises InputError, also without the package."""
    with needed(f"{path}: Alembic needs the extra alembic: pip install 'meshreel[alembic]'"):
        from alembic3d import Abc
    remedy = "free space, or choose another folder"
    try:
        with tempfile.TemporaryDirectory(".part", ".", path.parent, ignore_cleanup_errors=True) as folder:
            made, textures = Path(folder) / f"scene{EXTENSION}", Path(folder) / f"{path.stem}_textures"
            writer = AbcWriter(made, textures, animation)
            try:
                yield writer
                writer.save()
            finally:
                writer.close()
            if Abc.IArchive(str(made)).getTop().getNumChildren() != 1:  # a full disk is no error of the package
                raise OSError("the file is not whole")
            move_textures(textures, path)
            made.replace(path)
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())[:200]
        raise InputError(f"{path}: cannot be written ({reason}); {remedy}") from None


class AbcWriter:
    """Writer that adds the samples of parts to a new archive."""

    def __init__(self, path: Path, textures: Path, animation: Animation) -> None:
        import imath
        from alembic3d import Abc, AbcCoreAbstract, AbcGeom

        self._textures, self._animation, self._count = textures, animation, len(animation.times)
        self._folder = path.parent
        rate, even = animation.frame_rate, np.arange(self._count) / animation.frame_rate
        self._archive = Abc.OArchive(str(path))
        if np.abs(animation.times - even).max() <= _EVEN:
            sampling = AbcCoreAbstract.TimeSampling(1 / rate, 0.0)
        else:
            kind, times = AbcCoreAbstract.AcyclicFlag.kAcyclic, AbcCoreAbstract.TimeVector()
            times.extend(animation.times.tolist())
            sampling = AbcCoreAbstract.TimeSampling(AbcCoreAbstract.TimeSamplingType(kind), times)
        self._times = self._archive.addTimeSampling(sampling)
        self._scene = AbcGeom.OXform(self._archive.getTop(), "scene")
        place = AbcGeom.XformSample()
        place.setMatrix(imath.M44d(*animation.root.T.reshape(-1).tolist()))  # it multiplies rows from the left
        self._scene.getSchema().set(place)
        self._parts = dict[str, _Part]()
        self._states = list[Shape]()

    def add(self, shape: Shape) -> None:
        """Write a moving shape at once; keep the states of a background until the end, for they may be shown again."""
        if shape.part == "background":
            self._states.append(shape)
            return
        self._write(shape, *shape.shown[0])

    def save(self) -> None:
        """Write the states of the background, and empty samples for the parts that are gone at the end."""
        spans = ((first, end, number) for number, shape in enumerate(self._states) for first, end in shape.shown)
        for first, end, number in sorted(spans):
            self._write(self._states[number], first, end)
        for part in self._parts.values():
            part.fill(self._count)

    def close(self) -> None:
        """Close the file."""
        self._parts.clear()
        self._scene = self._archive = None

    def _write(self, shape: Shape, first: int, end: int) -> None:
        if shape.part not in self._parts:
            self._parts[shape.part] = _Part(self._scene, shape.part, self._times)
        part = self._parts[shape.part]
        part.fill(first)
        for number in range(first, end):
            frame = shape.frames[min(number - shape.first, len(shape.frames) - 1) if len(shape.frames) > 1 else 0]
            places = self._animation.local(shape, frame.vertices)
            # The package ends the process where a disk is full.
            if shutil.disk_usage(self._folder).free < SPARE + TIMES * (places.nbytes + shape.faces.nbytes):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            part.add(shape, frame, places)
            if shape.uv is not None and frame.texture is not None:
                self._textures.mkdir(exist_ok=True)
                name = f"{shape.part}_{number:05}.png"
                (self._textures / name).write_bytes(pack_picture(frame.texture.pixels))


class _Part:
    """A polygon mesh of the archive."""

    def __init__(self, scene: Any, name: str, times: int) -> None:
        from alembic3d import AbcGeom

        self._mesh, self._name, self._times = AbcGeom.OPolyMesh(scene, name, times).getSchema(), name, times
        self._colors: Any = None
        self._written = 0

    def fill(self, until: int) -> None:
        """Write empty samples up to a frame."""
        empty = Shape(self._name, "", np.zeros((0, 3), np.int32), 0, [Mesh.empty()], ((0, 0),))
        for _ in range(self._written, until):
            self.add(empty, Mesh.empty(), np.zeros((0, 3), np.float32))

    def add(self, shape: Shape, frame: Mesh, places: np.ndarray) -> None:
        """Write the next frame: its faces, clockwise as Alembic has them, and its vertices' places in the file."""
        import imath
        from alembic3d import AbcGeom

        scopes = AbcGeom.GeometryScope
        uv = np.zeros((0, 3, 2)) if shape.uv is None else np.nan_to_num(shape.uv[:, ::-1])
        corners = np.ascontiguousarray(shape.faces[:, ::-1].reshape(-1), np.int32)
        normals = unit_normals(frame) if len(shape.faces) else np.zeros((0, 3), np.float32)
        sample = AbcGeom.OPolyMeshSchemaSample(
            _vectors(places),
            imath.IntArrayFromBuffer(corners) if len(corners) else imath.IntArray(0),
            imath.IntArrayFromBuffer(np.full(len(shape.faces), 3, np.int32)) if len(corners) else imath.IntArray(0),
            AbcGeom.OV2fGeomParamSample(_vectors(uv.reshape(-1, 2)), scopes.kFacevaryingScope),
            AbcGeom.ON3fGeomParamSample(_vectors(normals), scopes.kVertexScope),
        )
        self._mesh.set(sample)
        if frame.colors is not None and self._colors is None:
            about = self._mesh.getArbGeomParams(), COLORS, False, scopes.kVertexScope, 1, self._times
            self._colors = AbcGeom.OC3fGeomParam(*about)
            for _ in range(self._written):
                self._colors.set(AbcGeom.OC3fGeomParamSample(imath.C3fArray(0), scopes.kVertexScope))
        if self._colors is not None:
            shown = np.zeros((0, 3), np.float32) if frame.colors is None else light(frame.colors)
            self._colors.set(AbcGeom.OC3fGeomParamSample(imath.C3fArray(_vectors(shown)), scopes.kVertexScope))
        self._written += 1


def _vectors(values: np.ndarray) -> Any:
    """Return rows of two or three numbers as an array of the package."""
    import imath

    rows = np.ascontiguousarray(values, np.float32)
    if rows.shape[1] == 2:
        return imath.V2fArrayFromBuffer(rows) if len(rows) else imath.V2fArray(0)
    return imath.V3fArrayFromBuffer(rows) if len(rows) else imath.V3fArray(0)
