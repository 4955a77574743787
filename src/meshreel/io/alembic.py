"""Surfaces of Alembic files (.abc): the visible polygon meshes of an archive at a time, with colours and UVs.

A frame is a sample: between two, the one before holds, for topology may change. Needs the extra `alembic`, whose
package may end the process that reads a damaged file: another process reads all of it before, and tells.
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

from ..errors import needed
from ..types import Up
from .glb_file import from_linear
from .looks import Look, Part, joined, of_vertices
from .polygons import Polygons, Unreadable

EXTENSION, COLORS = ".abc", "Cs"  # the name that film tools give the colours of a surface
_FEW = 1e-3  # of a frame, by which a moment may be missed by rounding
_SCHEMAS = {"AbcGeom_Curve_v2": "curves", "AbcGeom_Points_v1": "points", "AbcGeom_NuPatch_v2": "NURBS"}
_ONE_THREAD = Lock()  # at a time, at an archive, whose file has one position


class Archive:
    """An Alembic file that is open."""

    up: Up = "y"  # the format does not tell; film tools write y

    def __init__(self, path: Path, is_sound: bool = False) -> None:
        """Raises Unreadable if the file is damaged, and InputError without the package."""
        with needed(f"{path}: Alembic needs the extra alembic: pip install 'meshreel[alembic]'"):
            from alembic3d import Abc
        if not is_sound and subprocess.run([sys.executable, "-m", __name__, path], capture_output=True).returncode:
            raise Unreadable("Alembic cannot be read (damaged)")
        try:
            self._top = (archive := Abc.IArchive(str(path))).getTop()
            self._archive = archive
            spans = [times for _, times in self._times(self._top)]
        except (RuntimeError, ValueError, MemoryError) as error:
            raise Unreadable(f"Alembic cannot be read ({' '.join(str(error).split())[:200]})") from None
        times = self.times = np.unique(np.concatenate([np.zeros(0), *spans]))
        steps = np.diff(times)
        self.frame_rate: float | None = float(f"{1 / np.median(steps):.9g}") if len(steps) else None
        self._begin, self._end = (float(times[0]), float(times[-1])) if len(times) else (0.0, 0.0)

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

    def _times(self, parent: Any) -> Iterator[tuple[str, np.ndarray]]:
        """Yield the times of the samples of what moves, s."""
        from alembic3d import AbcGeom

        for child in parent.children:
            header = child.getHeader()
            for kind in (AbcGeom.IPolyMesh, AbcGeom.ISubD, AbcGeom.IXform):
                if kind.matches(header):
                    schema = kind(parent, child.getName()).getSchema()
                    count, sampling = schema.getNumSamples(), schema.getTimeSampling()
                    if count > 1:
                        yield child.getFullName(), np.array([sampling.getSampleTime(k) for k in range(count)])
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
        if (sizes < 0).any() or sizes.sum() != len(corners):
            raise Unreadable(f"{child.getFullName()} has {len(corners)} corners, and its polygons {int(sizes.sum())}")
        if not 0 <= corners.min() <= corners.max() < len(points):
            text = f"{child.getFullName()} refers to point {int(corners.max())}, and has {len(points)}"
            raise Unreadable(text)
        order = np.arange(len(corners))
        if np.linalg.det(matrix[:3, :3]) > 0:  # Alembic's polygons run clockwise
            ends = np.cumsum(sizes)
            order = np.repeat(ends - sizes + ends - 1, sizes) - order
        colors, one = of_vertices(_colors(schema, chosen), len(points), corners, sizes)
        uv, places = None, schema.getUVsParam()
        if places.valid():
            values = np.array(places.getExpandedValue(chosen).getVals(), np.float32).reshape(-1, 2)
            uv = values if len(values) == len(corners) else values[corners] if len(values) == len(points) else None
        vertices = points @ matrix[:3, :3] + matrix[3, :3]
        yield Part(vertices, corners[order], sizes, colors, None if uv is None else uv[order], Look(one))


def _colors(schema: Any, chosen: Any) -> np.ndarray:
    """Return the colours of a mesh, sRGB, as many as it has; none where it has none."""
    from alembic3d import AbcGeom

    params = schema.getArbGeomParams()
    for number in range(params.getNumProperties() if params.valid() else 0):
        header = params.getPropertyHeader(number)
        for kind in (AbcGeom.IC3fGeomParam, AbcGeom.IC4fGeomParam):
            if header.getName() == COLORS and kind.matches(header):
                found = kind(params, COLORS).getExpandedValue(chosen).getVals()
                light = np.stack([np.array(of, np.float64) for of in (found.r, found.g, found.b)], axis=1)
                return from_linear(np.clip(light, 0, 1))
    return np.zeros((0, 3), np.uint8)


def _read_all(path: Path) -> None:
    """Read all that an archive has."""
    archive = Archive(path, is_sound=True)
    for time in archive.times.tolist() or [0.0]:
        archive.at(time - archive.times[0] if len(archive.times) else 0.0)


if __name__ == "__main__":
    with suppress(Unreadable):  # whom it may concern reads it again
        _read_all(Path(sys.argv[1]))
