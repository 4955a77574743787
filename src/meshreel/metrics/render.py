"""Pictures of surface normals, without GL, window or lighting, and their SSIM.

A pixel that a mesh covers has the color (n + 1) / 2 of the interpolated vertex normal n in world axes, as in the paper
(section 4.1); all others are white, the default background of Open3D's viewer. Faces are visible from both sides, with
the same normal. SSIM is as scikit-image has it: 7 x 7 uniform windows, three channels, data range 1, its 3-pixel border
left out. White scores 1 and inflates the whole-picture form; the masked form is the mean over pixels that either mesh
covers. Only the crop around the meshes is rendered: outside, SSIM is 1 by definition.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64
from scipy.ndimage import uniform_filter

from ..geometry.drawing import Crop, SeenPlaces, Viewer, draw_places
from ..types import Mesh
from .surface_samples import interpolate, used_surface, welded_normals

BACKGROUND = 1.0  # white
_SIDE = 7  # pixels, side of the SSIM window: scikit-image's default
_UNBIASED = _SIDE**2 / (_SIDE**2 - 1)  # of covariances in a window
BORDER = _SIDE // 2
MARGIN = 2 * _SIDE  # pixels of a crop around what is seen


@dataclass(frozen=True, slots=True)
class View:
    """Surface that one camera sees in one crop, with the normals at the places that its covered pixels see."""

    places: SeenPlaces
    normals: Float64[np.ndarray, "N 3"]

    @property
    def covered(self) -> Bool[np.ndarray, "H W"]:
        return self.places.covered

    @property
    def points(self) -> Float64[np.ndarray, "N 3"]:
        """Places that the covered pixels see in world coordinates, m."""
        return self.places.points

    @property
    def colors(self) -> Float32[np.ndarray, "H W 3"]:
        """The normal-colored picture of the crop, 0 to 1."""
        image = np.full((*self.covered.shape, 3), BACKGROUND, dtype=np.float32)
        image[self.covered] = (self.normals + 1) / 2
        return image


def crop_of(meshes: list[Mesh], camera: Viewer, border: int = 8) -> Crop:
    """Return the crop of all pixels that can see a mesh, widened by `border` pixels and clipped to the image."""
    vertices = np.concatenate([m.vertices for m in meshes])
    if len(vertices) == 0:
        return Crop(0, 0, 0, 0)
    pixels = camera.project(vertices @ camera.extrinsic[:3, :3].T + camera.extrinsic[:3, 3])
    if not np.isfinite(pixels).all():  # something reaches behind the eye: no rectangle bounds it
        return Crop(0, camera.height, 0, camera.width)
    limits = np.array([camera.width, camera.height])
    low = np.clip(np.floor(pixels.min(axis=0)) - border, 0, limits).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)) + border, 0, limits).astype(int)
    return Crop(int(low[1]), int(high[1]), int(low[0]), int(high[0]))


def look(mesh: Mesh, camera: Viewer, crop: Crop | None = None) -> View:
    return Visible(mesh).look(camera, crop)


@dataclass(frozen=True, slots=True)
class Picture:
    """Picture of a mesh in a crop, without the surface behind it."""

    covered: Bool[np.ndarray, "H W"]
    colors: Float32[np.ndarray, "H W 3"]  # 0 to 1


class Visible:
    """A mesh prepared for several views: its normals are computed once."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = used_surface(mesh)
        self._normals = welded_normals(self.mesh)

    def look(self, camera: Viewer, crop: Crop | None = None) -> View:
        """Return the surface that a camera sees in a crop, or in its whole picture."""
        places = draw_places(self.mesh, camera, crop)
        return View(places, interpolate(self._normals, self.mesh.faces[places.faces], places.barycentric))


_C1, _C2 = 0.01**2, 0.03**2  # Wang et al., at data range 1


class Remembered:
    """A mesh that keeps its normal-colored pictures, for comparisons with several meshes from the same cameras."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh, self._visible = mesh, Visible(mesh)
        self._drawn = dict[int, tuple[Viewer, Crop, Picture]]()  # by the identity of the camera

    def look(self, camera: Viewer, crop: Crop) -> Picture:
        """Return the picture in a crop around the whole mesh, which is rendered once for each camera."""
        if id(camera) not in self._drawn:
            view = self._visible.look(camera, part := crop_of([self.mesh], camera))
            self._drawn[id(camera)] = camera, part, Picture(view.covered, view.colors)
        _, part, drawn = self._drawn[id(camera)]
        at = slice(part.top - crop.top, part.bottom - crop.top), slice(part.left - crop.left, part.right - crop.left)
        covered, colors = np.zeros(crop.shape, bool), np.full((*crop.shape, 3), BACKGROUND, np.float32)
        covered[at], colors[at] = drawn.covered, drawn.colors
        return Picture(covered, colors)


def ssim_normals(original: Mesh | Remembered, decoded: Mesh, cameras: Sequence[Viewer]) -> dict[str, float]:
    """Return SSIM between the normal-colored renderings of two meshes (paper, section 4: four views); 1 is identical.

    `ssim` is over whole pictures, `ssim_masked` over pixels that either mesh covers, without views that see neither.
    """
    pair = original if isinstance(original, Remembered) else Remembered(original), Visible(decoded)
    views = [(camera, crop_of([pair[0].mesh, decoded], camera, MARGIN)) for camera in cameras]
    scores = [ssim_view(pair[0].look(*view), pair[1].look(*view), *view) for view in views]
    counted = [masked for _, masked in scores if masked is not None]
    whole, masked = float(np.mean([whole for whole, _ in scores])), float(np.mean(counted)) if counted else 1.0
    return {"ssim": whole, "ssim_masked": masked}


def ssim_view(a: Picture | View, b: Picture | View, camera: Viewer, crop: Crop) -> tuple[float, float | None]:
    """Return SSIM of two pictures over the whole image, and over pixels that either covers; None without such."""
    interior = np.zeros((camera.height, camera.width), dtype=bool)
    interior[BORDER:-BORDER, BORDER:-BORDER] = True
    inside = interior[crop.top : crop.bottom, crop.left : crop.right]
    if min(crop.shape) < _SIDE:  # the meshes are out of this picture or at its very edge
        return 1.0, None
    scores = ssim_map(a.colors.astype(np.float64), b.colors.astype(np.float64))
    outside = int(interior.sum()) - int(inside.sum())
    whole = (float(scores[inside].sum()) + outside) / int(interior.sum())
    covered = (a.covered | b.covered) & inside
    return whole, float(scores[covered].mean()) if covered.any() else None


def ssim_map(a: Float64[np.ndarray, "H W 3"], b: Float64[np.ndarray, "H W 3"]) -> Float64[np.ndarray, "H W"]:
    """Return the SSIM of every pixel, averaged over the three channels (Wang et al. 2004, eq. 13)."""
    return np.asarray(sum(map(_ssim, np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0))) / 3)


def _ssim(a: Float64[np.ndarray, "H W"], b: Float64[np.ndarray, "H W"]) -> Float64[np.ndarray, "H W"]:
    ux, uy, xx, yy, xy = (uniform_filter(values, _SIDE) for values in (a, b, a * a, b * b, a * b))
    vx, vy, vxy = (_UNBIASED * v for v in (xx - ux * ux, yy - uy * uy, xy - ux * uy))
    return np.asarray((2 * ux * uy + _C1) * (2 * vxy + _C2) / ((ux * ux + uy * uy + _C1) * (vx + vy + _C2)))
