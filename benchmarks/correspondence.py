"""Tracked centers against embedded deformation, both followed by the same surface fit, on captured bodies.

python benchmarks/correspondence.py --data ../shared/data/performers        # half an hour; `dancer crane ...` for some

In: folders and .npz files of performers. Out: a table, and the rows `correspondence` of docs/decisions/measured.jsonl.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from captured import Case, Row, asked_cases, keep
from jaxtyping import Float64

from meshreel.analysis.fit.match import Target
from meshreel.analysis.fit.residual import Residual, residual_of
from meshreel.analysis.fit.surface_fit import FitOptions, fit_frames
from meshreel.analysis.follow.embedded import register
from meshreel.analysis.reference.centers import ReferenceCenterOptions, affinity, largest_distances
from meshreel.analysis.reference.deform import DeformOptions, bind, center_motions, move, neighbours
from meshreel.analysis.reference.track import TrackOptions, track_centers
from meshreel.coding import klt
from meshreel.geometry.decimate import decimate
from meshreel.geometry.topology import subdivide_midpoint, unique_edges, vertex_normals
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh

DECISION, BASE, LEVELS, STEP = "correspondence", 1000, 2, 0.0018
Positions = Float64[np.ndarray, "T V 3"]


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


def main() -> int:
    """Measures every case that was asked for and puts its rows in the place of older ones."""
    for case, frames in asked_cases(__doc__, CASES):
        keep(rows_of(case, frames), "case")
    return 0


def rows_of(case: Case, frames: Sequence[Mesh]) -> Iterator[Row]:
    """A row for each way of finding correspondence."""
    base = decimate(frames[case.key], BASE)
    template = subdivide_midpoint(base, LEVELS)
    ways: dict[str, Callable[[Sequence[Mesh], int, Mesh], Positions]] = {"centers": centers, "embedded": embedded}
    for way, predict in ways.items():
        begin = time.process_time()
        predictions = predict(frames, case.key, template)
        cost = (time.process_time() - begin) / len(frames)
        row: Row = {"decision": DECISION, "case": case.name, "way": way, "cpu_s_per_frame": cost}
        before = [residual_of(Mesh(p, template.faces), Target(m)) for p, m in zip(predictions, frames, strict=True)]
        row |= {f"before_{k}": v for k, v in _summary(before).items()}
        fit = fit_frames(template.faces, predictions, frames, FitOptions(key=case.key))
        row |= {f"after_{k}": v for k, v in _summary(fit.residuals).items()}
        errors = [surface_errors(m, Mesh(p, template.faces)) for p, m in zip(fit.positions, frames, strict=True)]
        row["d2_psnr_paper"] = float(np.mean([e.d2_psnr_paper for e in errors]))
        row["worst_d2_psnr_paper"] = min(e.d2_psnr_paper for e in errors)
        row["symmetric_psnr"] = float(np.mean([e.symmetric_psnr for e in errors]))
        row["bits_plain"], row["bits_predicted"] = roughness(fit.positions[:, : len(base.vertices)], base, case.key)
        yield row


def centers(frames: Sequence[Mesh], key: int, template: Mesh) -> Positions:
    """The template's vertices moved by tracked centers, bound in the key frame's own pose."""
    tracked, options = track_centers(frames, TrackOptions()), DeformOptions()
    kin = neighbours(affinity(largest_distances(tracked), ReferenceCenterOptions()), options)
    source = tracked.positions[key]
    binding = bind(template, source, kin, options)
    poses = tracked.positions
    return np.stack([move(template.vertices, binding, center_motions(source, pose, kin), kin) for pose in poses])


def embedded(frames: Sequence[Mesh], key: int, template: Mesh) -> Positions:
    """The template's vertices moved by embedded deformation of the key frame's mesh."""
    return register(frames[key], frames, key).move(template.vertices, vertex_normals(template))


def roughness(positions: Positions, base: Mesh, key: int) -> tuple[float, float]:
    """Bits a vertex of the base's trajectories: sum over KLT columns of log2(1 + energy / step^2) / 2.

    Plain, and of what is left after the mean of a vertex's neighbours is taken off, in the same basis.
    """
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


def _summary(residuals: Sequence[Residual]) -> Row:
    return {
        "rms": float(np.mean([r.rms for r in residuals])),
        "worst_rms": max(r.rms for r in residuals),
        "normal_error_deg": float(np.mean([r.normals for r in residuals])),
    }


if __name__ == "__main__":
    sys.exit(main())
