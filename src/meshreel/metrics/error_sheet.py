"""Comparison sheet: original, decoded mesh and error heat map of chosen frames in one PNG.

The heat map shows, where a ray meets the original, the distance of that point from the decoded surface; pixels that
only the decoded mesh covers (invented surface) are magenta.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from ..errors import InputError
from ..geometry.cameras import Camera
from ..geometry.closest_points import Surface
from ..io.write import replacing
from ..types import Frames, Mesh
from .color import Colored
from .distance import surface_errors
from .render import View, look
from .surface_samples import used_surface
from .viewpoints import Box, ViewOptions, extent, views_around

_COLUMNS = ("original", "decoded", "error (magenta: only decoded)")
_LEFT, _RIGHT, _TOP, _GAP = 64, 100, 32, 8  # pixels around and between the pictures
_DPI = 100
_INVENTED = (1.0, 0.0, 1.0)  # magenta
_LEAST_LIMIT = 1e-3  # % or mm; below it the color bar would show rounding (guess)


@dataclass(frozen=True, slots=True)
class SheetOptions:
    """Frames, cameras and size of a sheet."""

    frames: tuple[int, ...] = ()  # their numbers; empty: first, middle and last
    cameras: tuple[Camera, ...] = ()  # of one size; empty: one from which all meshes are visible
    height: int = 480  # pixels of one picture
    unit: str = "percent"  # of the heat map: percent (of the diagonal) or mm
    up: str = "y"  # the axis that points up: y, z, -y or -z
    first: int = 0  # number of the sequences' first frame

    def __post_init__(self) -> None:
        if len({(camera.width, camera.height) for camera in self.cameras}) > 1:
            raise InputError("cameras of several sizes: give a sheet cameras of one size")


@dataclass(frozen=True, slots=True)
class SheetRow:
    """Row of the sheet: a frame from one camera."""

    label: str
    original: View
    decoded: View
    pictures: list[np.ndarray]  # of original and decoded mesh, H x W x 3, 0 to 1
    errors: Float64[np.ndarray, " N"]  # in the sheet's unit, one for each covered pixel of the original


def write_sheet(originals: Frames, decoded: Frames, path: Path, options: SheetOptions = SheetOptions()) -> None:
    """Write the PNG, with a line for each chosen frame and camera."""
    figure = _draw(list(_rows(originals, decoded, options)), options)
    with replacing(path) as file:
        figure.savefig(file, format="png", dpi=_DPI)


def error_at_pixels(view: View, decoded: Mesh) -> Float64[np.ndarray, " N"]:
    """Return the distances from the visible points of the original to the decoded surface, m; inf if it is empty."""
    decoded = used_surface(decoded)
    return np.full(len(view.points), np.inf) if decoded.is_empty else Surface(decoded).distances(view.points)


def _rows(originals: Frames, decoded: Frames, options: SheetOptions) -> Iterator[SheetRow]:
    count = len(originals)
    if count != len(decoded) or count == 0:
        raise InputError(f"a sheet needs as many decoded frames as originals: {len(decoded)} and {count}")
    first = options.first
    frames = options.frames or tuple(sorted({first, first + count // 2, first + count - 1}))
    if not all(first <= frame < first + count for frame in frames):
        raise InputError(f"frames {frames}: the sequence has frames {first} to {first + count - 1}")
    pairs = [(frame, originals[frame - first], decoded[frame - first]) for frame in frames]
    cameras = _cameras([mesh for _, mesh, _ in pairs], options)
    for frame, *meshes in pairs:
        errors = surface_errors(meshes[0], meshes[1])
        factor = 1000.0 if options.unit == "mm" else 100 / (errors.diagonal or 1.0)
        label = f"frame {frame}\nD2 {errors.d2_psnr_paper:.1f} dB\nnormals {errors.angle:.1f}°"
        for camera in cameras:
            views = [look(mesh, camera) for mesh in meshes]
            if all(mesh.is_colored for mesh in meshes):
                pictures = [Colored(mesh).look(camera).colors for mesh in meshes]
            else:
                pictures = [view.colors for view in views]  # of their normals
            yield SheetRow(label, views[0], views[1], pictures, factor * error_at_pixels(views[0], meshes[1]))


def _cameras(meshes: list[Mesh], options: SheetOptions) -> list[Camera]:
    if options.cameras:
        return list(options.cameras)
    box = Box.of(meshes)
    across, height = extent(box, options.up)
    width = int(options.height * min(max(across / height, 0.5), 3.0))
    return views_around(box, ViewOptions(width, options.height, fov=30.0, up=options.up))[:1]


def _draw(rows: list[SheetRow], options: SheetOptions) -> Any:
    from matplotlib.figure import Figure

    height, width = rows[0].original.covered.shape
    size = np.array([_LEFT + 3 * (width + _GAP) + _RIGHT, _TOP + len(rows) * (height + _GAP)])
    errors = np.concatenate([row.errors[np.isfinite(row.errors)] for row in rows])
    limit = max(float(np.quantile(errors, 0.99)), _LEAST_LIMIT) if len(errors) else 1.0
    figure = Figure(figsize=tuple(size / _DPI), dpi=_DPI)

    def axes_at(left: int, top: int, wide: int, high: int) -> Any:  # pixels, so that pictures are not resampled
        return figure.add_axes((left / size[0], 1 - (top + high) / size[1], wide / size[0], high / size[1]))

    image: Any = None
    for i, row in enumerate(rows):
        top = _TOP + i * (height + _GAP)
        panels = [axes_at(_LEFT + k * (width + _GAP), top, width, height) for k in range(3)]
        panels[0].imshow(row.pictures[0])
        panels[1].imshow(row.pictures[1])
        image = _heat_map(panels[2], row, limit)
        panels[0].set_ylabel(row.label)
        for panel, title in zip(panels, _COLUMNS, strict=True):
            panel.set(xticks=[], yticks=[], title=title if i == 0 else "")
    unit = "mm" if options.unit == "mm" else "% of the diagonal"
    bar = axes_at(int(size[0]) - _RIGHT + _GAP, _TOP, 16, height)
    figure.colorbar(image, cax=bar, label=f"error, {unit}", extend="max")
    return figure


def _heat_map(axis: Any, row: SheetRow, limit: float) -> Any:
    backdrop = np.ones((*row.original.covered.shape, 3))
    backdrop[row.decoded.covered & ~row.original.covered] = _INVENTED
    axis.imshow(backdrop)
    errors = np.ma.masked_array(np.zeros(row.original.covered.shape), mask=~row.original.covered)
    errors[row.original.covered] = np.minimum(row.errors, 2 * limit)
    return axis.imshow(errors, cmap="viridis", vmin=0, vmax=limit, interpolation="nearest")
