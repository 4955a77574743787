"""Surfaces of Alembic files (.abc): the visible polygon meshes of an archive at a time, with colours and UVs.

A frame is a sample: between two, the one before holds, for topology may change. Needs the extra `alembic`, whose
package may crash on a damaged file: a child process reads the file first.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from jaxtyping import Float64

from ..errors import InputError, needed
from ..types import Up
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
from .polygons import Polygons, Unreadable

EXTENSION, COLORS = ".abc", "Cs"  # the name that film tools give the colours of a surface
_FEW = 1e-3  # frames: tolerance of rounded times
_SAME_TIME = 1e-4  # s: samples of several meshes that are nearer to each other are of one frame (guess)
_EVEN = 0.01  # of a step, by which steps of an even rate differ by rounding (guess)
_SCOPES = {
    "kConstantScope": CONSTANT,
    "kUniformScope": FACES,
    "kVaryingScope": VERTICES,
    "kVertexScope": VERTICES,
    "kFacevaryingScope": CORNERS,
}
_SCHEMAS = {"AbcGeom_Curve_v2": "curves", "AbcGeom_Points_v1": "points", "AbcGeom_NuPatch_v2": "NURBS"}
_ONE_THREAD = Lock()  # an archive's reader has one file position: one thread at a time
RATES = 1e-3, 1e4  # 1/s, between which that of a recording is (guess)
_CRASHED = 0xC0000000  # exit codes of processes that crashed on Windows, at least; elsewhere they are negative
# What the child does: with the parent's path of modules, so that no module of the current folder is taken.
_CHILD = "import sys; sys.path[:] = sys.argv[2:]; from meshreel.io.alembic import read_all; read_all(sys.argv[1])"


class AlembicFile:
    """An Alembic file that is open."""

    up: Up = "y"  # the format does not tell; film tools write y

    def __init__(self, path: Path, is_sound: bool = False) -> None:
        """Raises Unreadable if the file is damaged, and InputError without the package."""
        with needed(f"{path}: Alembic needs the extra alembic: pip install 'meshreel[alembic]'"):
            from alembic3d import Abc
        if not is_sound:
            _check(path)
        try:
            self._archive = Abc.IArchive(str(path))
            self._top = self._archive.getTop()
            times = np.unique(np.concatenate([np.zeros(0), *self._times(self._top)]))
        except (RuntimeError, ValueError, MemoryError) as error:
            raise Unreadable(f"Alembic cannot be read ({' '.join(str(error).split())[:200]})") from None
        if not np.isfinite(times).all():
            raise Unreadable("Alembic has samples at times that are no numbers")
        self.times = times[np.diff(times, prepend=-np.inf) > _SAME_TIME]
        steps = np.diff(self.times)
        self.frame_rate: float | None = None
        if len(steps):
            usual = float(np.median(steps))
            is_even = (np.abs(steps - usual) <= _EVEN * usual).all()
            self.frame_rate = float(f"{1 / (steps.mean() if is_even else usual):.6g}")
            if not RATES[0] <= self.frame_rate <= RATES[1]:
                raise Unreadable(f"Alembic has samples {usual:g} s apart; mend its times")
        self._begin, self._end = (float(self.times[0]), float(self.times[-1])) if len(times) else (0.0, 0.0)

    def count(self, frame_rate: float) -> int:
        """Return the number of frames at a rate, 1/s."""
        return int((self._end - self._begin) * frame_rate + _FEW) + 1

    def at(self, seconds: float) -> Polygons:
        """Return the surface at a time after the beginning, s."""
        from alembic3d import Abc

        named, few = set[str](), _FEW / (self.frame_rate or 1.0)
        before = Abc.ISampleSelector.TimeIndexType.kFloorIndex
        chosen = Abc.ISampleSelector(self._begin + seconds + few, before)
        try:
            with _ONE_THREAD:
                return joined(list(self._parts(self._top, np.eye(4), chosen, named))).naming(named)
        except (RuntimeError, ValueError, IndexError, MemoryError) as error:
            raise Unreadable(f"Alembic cannot be read ({' '.join(str(error).split())[:200]})") from None

    def _times(self, parent: Any) -> Iterator[np.ndarray]:
        """Yield the times of the samples of what moves, s."""
        from alembic3d import AbcGeom

        for child in parent.children:
            header = child.getHeader()
            for kind in (AbcGeom.IPolyMesh, AbcGeom.ISubD, AbcGeom.IXform):
                if kind.matches(header):
                    schema = kind(parent, child.getName()).getSchema()
                    count, sampling = schema.getNumSamples(), schema.getTimeSampling()
                    if count > 1:
                        yield np.array([sampling.getSampleTime(k) for k in range(count)], np.float64)
            yield from self._times(child)

    def _parts(self, parent: Any, matrix: Float64[np.ndarray, "4 4"], chosen: Any, named: set[str]) -> Iterator[Part]:
        from alembic3d import AbcGeom

        for child in parent.children:
            header, name, place = child.getHeader(), child.getName(), matrix
            if AbcGeom.GetVisibility(child, chosen) == AbcGeom.ObjectVisibility.kVisibilityHidden:
                continue
            if AbcGeom.IXform.matches(header):
                sample = AbcGeom.IXform(parent, name).getSchema().getValue(chosen)
                own = np.array(sample.getMatrix(), np.float64)  # of rows, from the left
                place = own @ matrix if sample.getInheritsXforms() else own
            elif AbcGeom.IPolyMesh.matches(header):
                yield from self._mesh(AbcGeom.IPolyMesh(parent, name).getSchema(), child, place, chosen)
            elif AbcGeom.ISubD.matches(header):
                named.add("smooth subdivision (the cage is taken)")
                yield from self._mesh(AbcGeom.ISubD(parent, name).getSchema(), child, place, chosen)
            elif (schema := header.getMetaData().get("schema")) in _SCHEMAS:
                named.add(_SCHEMAS[schema])
            yield from self._parts(child, place, chosen, named)

    def _mesh(self, schema: Any, child: Any, matrix: Float64[np.ndarray, "4 4"], chosen: Any) -> Iterator[Part]:
        sample = schema.getValue(chosen)
        points = np.array(sample.getPositions(), np.float64).reshape(-1, 3)
        sizes, corners = (np.array(of(), np.int64) for of in (sample.getFaceCounts, sample.getFaceIndices))
        if not len(points) or not len(sizes):
            return
        check_corners(f"Alembic mesh {child.getFullName()}", corners, sizes, len(points))
        # Alembic's polygons run clockwise.
        order = backwards(sizes) if np.linalg.det(matrix[:3, :3]) > 0 else np.arange(len(corners))
        colors, one = of_vertices(*_colors(schema, chosen), len(points), corners, sizes)
        uv, params = None, schema.getUVsParam()
        if params.valid():
            values = np.array(params.getExpandedValue(chosen).getVals(), np.float32).reshape(-1, 2)
            uv = of_corners(values, _SCOPES.get(str(params.getScope())), len(points), corners)
        vertices = points @ matrix[:3, :3] + matrix[3, :3]
        yield Part(vertices, corners[order], sizes, colors, None if uv is None else uv[order], Look(one))


def _colors(schema: Any, chosen: Any) -> tuple[np.ndarray, str | None]:
    """Return the colours of a mesh, sRGB, as many as it has, none where it has none; and whose they are."""
    from alembic3d import AbcGeom

    params = schema.getArbGeomParams()
    for number in range(params.getNumProperties() if params.valid() else 0):
        header = params.getPropertyHeader(number)
        for kind in (AbcGeom.IC3fGeomParam, AbcGeom.IC4fGeomParam):
            if header.getName() == COLORS and kind.matches(header):
                param = kind(params, COLORS)
                values = param.getExpandedValue(chosen).getVals()
                light = np.stack([np.array(of, np.float64) for of in (values.r, values.g, values.b)], axis=1)
                return from_linear(np.clip(np.nan_to_num(light), 0, 1)), _SCOPES.get(str(param.getScope()))
    return np.zeros((0, 3), np.uint8), None


def _check(path: Path) -> None:
    """Raise Unreadable if a process that reads the file crashes, and InputError if no process can be started."""
    remedy = "let Python start processes here, or export the file as USD"
    try:
        done = subprocess.run([sys.executable, "-P", "-c", _CHILD, path, *sys.path], capture_output=True)
    except OSError as error:
        raise InputError(f"{path}: Alembic is read by a process first, which fails ({error}); {remedy}") from None
    if done.returncode < 0 or done.returncode >= _CRASHED:
        raise Unreadable("Alembic cannot be read (damaged: its package crashes)")
    if done.returncode:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
        reason = lines[-1][:200] if lines else f"exit code {done.returncode}"
        raise InputError(f"{path}: Alembic is read by a process first, which fails ({reason}); {remedy}")


def read_all(name: str) -> None:
    """Read all that an archive has; that it breaks rules is no fault here, for the parent says so."""
    with suppress(Unreadable):
        archive = AlembicFile(Path(name), is_sound=True)
        for time in archive.times.tolist() or [0.0]:
            with suppress(Unreadable):
                archive.at(time - (archive.times[0] if len(archive.times) else 0.0))
