"""Picture of a calibration: the distance of each pair of cameras, and what each sees from above, before and after.

Walls seen by several cameras are single lines where the poses are right. Drawn by matplotlib's Agg, without a display.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from ...io.write import replacing
from ...types import UP_AXES, Up
from .calibrate import Calibration

_UPRIGHT = 0.5  # largest cosine between up and the normals that are shown: floors would hide all (guess)
_SHOWN = 8000  # points of a camera, about (guess)


def write_calibration_sheet(calibration: Calibration, up: Up, path: Path) -> None:
    """Write the PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15, 11), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2, width_ratios=(2, 3))
    before = [view.camera.view.pose.to_world for view in calibration.views]
    after = [camera.view.pose.to_world for camera in calibration.cameras]
    worst = max([1.0, *(1000 * pair.after for pair in calibration.pairs)])
    for row, (when, poses) in zip(axes, (("before", before), ("after", after)), strict=True):
        _draw_distances(row[0], calibration, when, 10 * worst)
        _draw_plan(row[1], calibration, poses, np.abs(UP_AXES[up]))
        row[1].set_title(f"walls from above, m, {when}")
    axes[0, 1].legend(markerscale=12, loc="upper left", bbox_to_anchor=(1, 1))
    with replacing(path) as file:
        figure.savefig(file, format="png")


def _draw_distances(axis: Any, calibration: Calibration, when: str, limit: float) -> None:
    """Draw the median distance of each pair, mm."""
    names = [camera.name for camera in calibration.cameras]
    table = np.full((len(names), len(names)), np.nan)
    for pair in calibration.pairs:
        i, j = (names.index(name) for name in pair.cameras)
        table[i, j] = table[j, i] = 1000 * getattr(pair, when)
    axis.imshow(table, cmap="viridis_r", vmin=0, vmax=limit)
    for i, j in np.argwhere(np.isfinite(table)):
        axis.text(j, i, f"{table[i, j]:.1f}", ha="center", va="center", color="w" if table[i, j] > limit / 2 else "k")
    axis.set(xticks=range(len(names)), yticks=range(len(names)), xticklabels=names, yticklabels=names)
    axis.set_title(f"median distance of surfaces, mm, {when}")


def _draw_plan(axis: Any, calibration: Calibration, poses: list[np.ndarray], up: Float64[np.ndarray, " 3"]) -> None:
    """Draw what stands upright, from above, a colour for each camera."""
    across = np.flatnonzero(up == 0)
    for view, pose in zip(calibration.views, poses, strict=True):
        points, normals = view.points[view.known] @ pose[:3, :3].T + pose[:3, 3], view.normals[view.known]
        places = points[np.abs(normals @ (up @ pose[:3, :3])) < _UPRIGHT][:, across]
        places = places[:: max(1, len(places) // _SHOWN)]
        axis.plot(*places.T, ".", markersize=1, label=view.camera.name)
    axis.set_aspect("equal")
