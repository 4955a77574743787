"""Distances, PSNRs and normal errors between two surfaces, from one round of closest-point queries.

Two empty meshes are equal (distances 0, PSNR inf, angle 0); one empty mesh is the worst case (distances inf, PSNR 0 dB,
angle 180 degrees). Distances under 2^-22 of the diagonal, the resolution of the float32 queries, count as 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float64, Int32

from ..geometry import work
from ..geometry.strict import dot
from ..geometry.topology import blend
from ..types import Mesh
from .surface_samples import RESOLUTION, WORST_ANGLE, Samples, angles, interpolate, sample, used_surface

NEAR = 0.006  # diagonals of the original, within which a surface covers another: 1 cm on a body (decision 24)
_LEAST, _MOST = 1e-3, 1e6  # m, extents of meshes that are measured in metres; others are scaled (guess)
PSNR_CEILING = -20 * math.log10(RESOLUTION)  # dB, about 132; stands for an infinite PSNR in a mean over frames


@dataclass(frozen=True, slots=True)
class OneWayErrors:
    """Errors from the samples of one mesh to the surface of the other."""

    point_mse: float  # m^2, mean over the vertices of the squared distance (D1)
    plane_mse: float  # m^2, the same along the normal of the matched point (D2)
    rms: float  # m, over the area
    hausdorff95: float  # m, distance that 95 % of the area does not exceed
    angle: float  # degrees, mean over the area, between interpolated vertex normals
    vertex_angle: float  # degrees, mean over the vertices, where quantisation rotates normals most
    covered: float  # share of the area that is within `NEAR` of the other surface

    def times(self, unit: float) -> OneWayErrors:
        """Return the errors of the same meshes scaled by `unit`."""
        squares = {"point_mse": self.point_mse * unit**2, "plane_mse": self.plane_mse * unit**2}
        return replace(self, **squares, rms=self.rms * unit, hausdorff95=self.hausdorff95 * unit)


@dataclass(frozen=True, slots=True)
class SurfaceErrors:
    """All distances and normal errors of one frame; PSNRs in dB, larger is better."""

    diagonal: float  # m, of the original frame's bounding box: the peak p of every PSNR
    forward: OneWayErrors  # original to decoded: lost surface
    backward: OneWayErrors  # decoded to original: invented surface

    @property
    def d2_psnr_paper(self) -> float:
        """10 log10(p^2 / MSE) from the original vertices to the decoded surface, as TSMC's authors compute it."""
        return psnr(self.forward.point_mse, self.diagonal)

    @property
    def d1_psnr(self) -> float:
        """10 log10(3 p^2 / MSE), point to point, the worse of both directions (MPEG PCC common test conditions).

        Measured from each vertex to the closest point of the surface, while MPEG takes the nearest of sampled points.
        """
        return psnr(max(self.forward.point_mse, self.backward.point_mse) / 3, self.diagonal)

    @property
    def d2_psnr(self) -> float:
        """10 log10(3 p^2 / MSE), point to plane, the worse of both directions (MPEG PCC common test conditions)."""
        return psnr(max(self.forward.plane_mse, self.backward.plane_mse) / 3, self.diagonal)

    @property
    def symmetric_rms(self) -> float:
        """The larger of both directions' RMS over the area, m; the encoder's decisions use it.

        It is not the mean, so that precision elsewhere cannot make up for lost or invented surface.
        """
        return max(self.forward.rms, self.backward.rms)

    @property
    def symmetric_psnr(self) -> float:
        """20 log10(p / symmetric_rms)."""
        return psnr(self.symmetric_rms**2, self.diagonal)

    @property
    def hausdorff95(self) -> float:
        """The larger of both directions' 95 % Hausdorff distance, m."""
        return max(self.forward.hausdorff95, self.backward.hausdorff95)

    @property
    def angle(self) -> float:
        """Mean of both directions' normal error, degrees."""
        return (self.forward.angle + self.backward.angle) / 2

    @property
    def vertex_angle(self) -> float:
        """Mean of both directions' normal error at the vertices, degrees."""
        return (self.forward.vertex_angle + self.backward.vertex_angle) / 2

    def percent(self, distance: float) -> float:
        """Return a distance in m as % of the diagonal."""
        if distance == 0:
            return 0.0
        return 100 * distance / self.diagonal if self.diagonal > 0 else math.inf


class Original:
    """An original mesh prepared for comparisons with decoded ones."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = used_surface(mesh)
        self.is_whole = len(self.mesh.faces) == len(mesh.faces)

    @cached_property
    def samples(self) -> Samples:
        """The mesh's samples, around the middle of its box."""
        return sample(self.mesh, self.mesh.middle)


Closest = tuple[Int32[np.ndarray, " _"], Float64[np.ndarray, "_ 3"]]  # faces, and weights of their corners
BothClosest = tuple[Closest, Closest]  # decoded surface closest to samples of the original, and the other way


def surface_errors(original: Mesh | Original, decoded: Mesh, closest: BothClosest | None = None) -> SurfaceErrors:
    """Measure all distances and normal errors between two meshes of one frame.

    Faces without area and vertices without faces are no surface: they are ignored, also in the diagonal. `closest` is
    what is known: of the vertices and middles of faces of both meshes; it is not used where other points are compared.
    """
    work.passed("measure")
    prepared, shown = original if isinstance(original, Original) else Original(original), Original(decoded)
    if not (prepared.is_whole and shown.is_whole):
        closest = None
    original, decoded = prepared.mesh, shown.mesh
    if original.is_empty or decoded.is_empty:
        errors = _PERFECT if original.is_empty and decoded.is_empty else _WORST
        return SurfaceErrors(original.diagonal, errors, errors)
    a, b = prepared.samples, sample(decoded, original.middle)
    extent = max(float(np.abs(mesh.vertices).max()) for mesh in (a.mesh, b.mesh))
    if not _LEAST <= extent <= _MOST:  # in metres, squares of the queries' float32 would be inf or 0
        unit = 2.0 ** math.floor(math.log2(extent))
        scaled = [Mesh.of(mesh.vertices * (1 / unit), mesh.faces) for mesh in (original, decoded)]
        smaller = surface_errors(scaled[0], scaled[1])
        return SurfaceErrors(original.diagonal, smaller.forward.times(unit), smaller.backward.times(unit))
    ways = (_one_way(*way, original.diagonal) for way in zip((a, b), (b, a), closest or (None, None), strict=True))
    return SurfaceErrors(original.diagonal, *ways)


_PERFECT = OneWayErrors(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
_WORST = OneWayErrors(math.inf, math.inf, math.inf, math.inf, WORST_ANGLE, WORST_ANGLE, 0.0)


def _one_way(source: Samples, target: Samples, closest: Closest | None, diagonal: float) -> OneWayErrors:
    """Measure from the samples of one mesh to the surface of the other; distances below `RESOLUTION` become 0."""
    vertices = len(source.mesh.vertices)
    if closest is None or len(closest[0]) != len(source.points):  # of a mesh that is sampled more finely
        hits = target.surface.closest(source.points)
        closest = hits.faces, hits.barycentric
    corners = target.mesh.faces[closest[0]]
    offsets = blend(target.mesh.vertices, corners, closest[1]) - source.points
    distances = np.sqrt(np.einsum("nd,nd->n", offsets, offsets))
    noise = distances < RESOLUTION * diagonal
    offsets[noise], distances[noise] = 0, 0
    normals = interpolate(target.vertex_normals, corners, closest[1])
    squared = distances**2
    along = np.einsum("nd,nd->n", offsets, normals) ** 2
    along = np.where(normals.any(axis=1), along, squared)  # without a normal the whole distance counts
    normal_angles = angles(source.normals, normals)
    return OneWayErrors(
        point_mse=float(squared[:vertices].mean()),
        plane_mse=float(along[:vertices].mean()),
        rms=float(np.sqrt(dot(source.weights, squared))),
        hausdorff95=quantile(distances, source.weights, 0.95),
        angle=dot(source.weights, normal_angles),
        vertex_angle=float(normal_angles[:vertices].mean()),
        covered=dot(source.weights, np.where(distances <= NEAR * diagonal, 1.0, 0.0)),
    )


def quantile(values: Float64[np.ndarray, " N"], weights: Float64[np.ndarray, " N"], share: float) -> float:
    """Return the value that this share of the weights does not exceed; N > 0."""
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weights[order])
    return float(values[order[min(np.searchsorted(reached, share * reached[-1]), len(values) - 1)]])


def psnr(mse: float, peak: float) -> float:
    """Return 10 log10(peak^2 / mse), dB; 0 for a peak of 0 or an infinite error."""
    if mse <= (RESOLUTION * peak) ** 2:
        return math.inf
    if math.isinf(mse) or peak == 0:
        return 0.0
    return 10 * math.log10(peak**2 / mse)
