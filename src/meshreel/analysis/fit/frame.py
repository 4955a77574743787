"""Frames prepared for fits: search structure, vertex normals, and samples on open borders.

In: a mesh. Out: FrameSurface.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from jaxtyping import Float64, Int64

from ... import _core
from ...geometry.closest_points import Hits, Surface, area_samples
from ...geometry.depth import FreeSpace
from ...geometry.topology import border_edges, vertex_normals
from ...types import Mesh
from .border import sample_border

ON_BORDER = 1e-6  # points of a surface with an interpolated `inside` up to this lie on an open border: rounding


class FrameSurface:
    """A frame prepared for matching: search structure, vertex normals, and which vertices are on no open border."""

    def __init__(self, mesh: Mesh, free: FreeSpace | None = None) -> None:
        """`free`: the space that cameras saw through in the frame, if known."""
        self.mesh, self.free = mesh, free
        self.surface = Surface(mesh)
        self.normals = vertex_normals(mesh)
        self.inside = np.ones(len(mesh.vertices), bool)
        self.inside[border_edges(mesh).reshape(-1)] = False
        self._samples, self._sampled = dict[int, Int64[np.ndarray, " S"]](), dict[int, _core.DeformTarget]()

    def inside_at(self, hits: Hits) -> Float64[np.ndarray, " N"]:
        """Interpolate 1 for vertices inside and 0 for those on open borders at points of the surface."""
        return np.einsum("nk,nk->n", hits.barycentric, self.inside[self.mesh.faces[hits.faces]])

    def samples(self, count: int) -> Int64[np.ndarray, " S"]:
        """Return about `count` vertices, spread evenly over the area."""
        if count not in self._samples:
            self._samples[count] = area_samples(self.mesh, count)
        return self._samples[count]

    def sampled(self, count: int) -> _core.DeformTarget:
        """Return the frame with about `count` samples, as the core's embedded deformation takes it."""
        if count not in self._sampled:
            samples, spacing = self.samples(count), float(np.sqrt(self.surface.areas.sum() / count))
            samples = samples[self.inside[samples]]
            points, normals = self.mesh.vertices[samples], self.normals[samples]
            whole = (self.surface.tree, self.mesh.vertices, self.mesh.faces, self.normals, self.inside.view(np.uint8))
            self._sampled[count] = _core.DeformTarget(*whole, points, normals, spacing)
        return self._sampled[count]

    @cached_property
    def target(self) -> _core.FitTarget:
        rim = sample_border(self.mesh)
        whole = (self.surface.tree, self.mesh.vertices, self.mesh.faces, self.normals, self.inside.view(np.uint8))
        return _core.FitTarget(*whole, rim.points, rim.normals, rim.outward)
