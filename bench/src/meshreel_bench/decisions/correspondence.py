"""Decision 11: tracked centers against embedded deformation, both followed by the same surface fit."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from jaxtyping import Float64

from meshreel.analysis.fit.frame import FrameSurface
from meshreel.analysis.fit.residual import Residual, residual_of
from meshreel.analysis.fit.surface_fit import FitOptions, Guides, fit_frames
from meshreel.analysis.follow.embedded import EmbeddedOptions, Tracker
from meshreel.analysis.reference.centers import ReferenceCenterOptions, affinity, largest_distances
from meshreel.analysis.reference.deform import DeformOptions, bind, center_motions, move, neighbours
from meshreel.analysis.reference.track import TrackOptions, track_centers
from meshreel.coding import klt
from meshreel.geometry.decimate import decimate
from meshreel.geometry.topology import subdivide_midpoint, unique_edges
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh

from .rows import Case, Row, Sources

BASE, LEVELS = 1000, 2  # vertices of the template before its subdivisions (decision 14)
STEP = 0.0018  # of the diagonal, at which motion bits are counted: that of quality 50
CASES = (
    Case("dancer"),
    Case("basketball_player"),
    Case("basketball_player", 0, 5, key=2),
    Case("basketball_player", 5, 5, key=2),
    Case("mitch"),
    Case("crane"),
    Case("crane", 80),
    Case("samba"),
    Case("samba", 80),
    Case("collision", 20, 20, key=3),
    Case("collision", 20, 20, key=10),
    Case("crane", 80, stride=2),
    Case("crane", 80, stride=3),
)
Positions = Float64[np.ndarray, "T V 3"]


def measure(sources: Sources) -> Iterator[Row]:
    """Yield a row for each case and way of finding correspondence."""
    ways: dict[str, Callable[[Sequence[Mesh], int, Mesh], Positions]] = {"centers": centers, "embedded": embedded}
    for case in CASES:
        frames = case.frames(sources.data)
        base = decimate(frames[case.key], BASE)
        template = subdivide_midpoint(base, LEVELS)
        for way, predict in ways.items():
            begin = time.process_time()
            predictions = predict(frames, case.key, template)
            cost = (time.process_time() - begin) / len(frames)
            fit = fit_frames(template.faces, predictions, frames, FitOptions(), Guides(key=case.key))
            plain, predicted = motion_bits(fit.positions[:, : len(base.vertices)], base, case.key)
            yield {
                "case": case.name,
                "way": way,
                "cpu_s_per_frame": cost,
                **distances("before", frames, predictions, template),
                **distances("after", frames, fit.positions, template),
                "bits_plain": plain,
                "bits_predicted": predicted,
            }


def centers(frames: Sequence[Mesh], key: int, template: Mesh) -> Positions:
    """Move the template by tracked centers, bound in the key frame's own pose."""
    tracked, options = track_centers(frames, TrackOptions()), DeformOptions()
    kin = neighbours(affinity(largest_distances(tracked), ReferenceCenterOptions()), options)
    source = tracked.positions[key]
    binding = bind(template, source, kin, options)
    poses = tracked.positions
    return np.stack([move(template.vertices, binding, center_motions(source, pose, kin), kin) for pose in poses])


def embedded(frames: Sequence[Mesh], key: int, template: Mesh) -> Positions:
    """Move the template by embedded deformation of the key frame's mesh."""
    return placed(registered(frames, key, EmbeddedOptions()), len(frames), template)


def registered(frames: Sequence[Mesh], key: int, options: EmbeddedOptions) -> Tracker:
    """Track the key frame's mesh through all frames, outward from the key."""
    tracker = Tracker(frames[key], key, options)
    for frame in [*range(key + 1, len(frames)), *range(key - 1, -1, -1)]:
        tracker.step(frame, frames[frame])
    return tracker


def placed(tracker: Tracker, frames: int, template: Mesh) -> Positions:
    """Move a template on or near the key frame's mesh to each frame."""
    binding = tracker.bound(template)
    return np.stack([tracker.placed(frame, template.vertices, binding) for frame in range(frames)])


def distances(stage: str, frames: Sequence[Mesh], positions: Positions, template: Mesh) -> Row:
    """Return residuals of the template at these positions; after the fit also PSNRs."""
    shown = [Mesh(places, template.faces) for places in positions]
    found: list[Residual] = [residual_of(a, FrameSurface(b)) for a, b in zip(shown, frames, strict=True)]
    row: Row = {
        f"{stage}_rms": float(np.mean([each.rms for each in found])),
        f"{stage}_worst_rms": max(each.rms for each in found),
        f"{stage}_normal_error_deg": float(np.mean([each.normals for each in found])),
    }
    if stage == "after":
        errors = [surface_errors(a, b) for a, b in zip(frames, shown, strict=True)]
        row["d2_psnr_paper"] = float(np.mean([each.d2_psnr_paper for each in errors]))
        row["worst_d2_psnr_paper"] = min(each.d2_psnr_paper for each in errors)
        row["symmetric_psnr"] = float(np.mean([each.symmetric_psnr for each in errors]))
    return row


def motion_bits(positions: Positions, base: Mesh, key: int) -> tuple[float, float]:
    """Return bits per vertex of trajectories, log2(1 + energy / step^2) / 2; and of differences from neighbours."""
    field = np.moveaxis(positions - positions[key], 0, 1)
    basis = klt.fit(field)
    edges = unique_edges(base.faces)[0]
    i, j = np.concatenate([edges, edges[:, ::-1]]).T
    flat = field.reshape(len(field), -1)
    mean = np.stack([np.bincount(i, column[j], len(flat)) for column in flat.T], axis=1)
    left = flat - mean / np.maximum(np.bincount(i, minlength=len(flat)), 1)[:, None]
    energies = np.mean(np.square(left @ basis.vectors), axis=0)
    plain, predicted = (float(np.log2(1 + e / STEP**2).sum() / 2) for e in (basis.energies, energies))
    return plain, predicted
