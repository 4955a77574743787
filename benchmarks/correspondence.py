"""Tracked centers against embedded deformation, both followed by the same surface fit, on captured bodies.

python benchmarks/correspondence.py --data ../shared/data/performers        # half an hour; `dancer crane ...` for some

In: folders and .npz files of performers. Out: a table, and the rows `correspondence` of docs/decisions/measured.jsonl.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from meshreel.analysis.deform import DeformOptions, bind, center_motions, move, neighbours
from meshreel.analysis.embedded import register
from meshreel.analysis.fit import FitOptions, fit_frames
from meshreel.analysis.fit_match import Target
from meshreel.analysis.fit_residual import Residual
from meshreel.analysis.fit_residual import measure as residual
from meshreel.analysis.reference_centers import ReferenceCenterOptions, affinity, largest_distances
from meshreel.analysis.survey import survey
from meshreel.analysis.track import TrackOptions, track_centers
from meshreel.coding import klt
from meshreel.geometry.decimate import decimate
from meshreel.geometry.topology import subdivide_midpoint, unique_edges, vertex_normals, weld
from meshreel.io.sequence import SequenceOptions, open_sequence
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh, MeshList

ROWS = Path(__file__).resolve().parents[1] / "docs" / "decisions" / "measured.jsonl"
DECISION, BASE, LEVELS, STEP = "correspondence", 1000, 2, 0.0018
Row = dict[str, Any]
Positions = Float64[np.ndarray, "T V 3"]


@dataclass(frozen=True, slots=True)
class Case:
    """Which frames of a performer, and the key among them."""

    performer: str
    first: int = 0
    count: int = 10
    stride: int = 1
    key: int = 5

    @property
    def name(self) -> str:
        """What the table calls it."""
        last = self.first + self.stride * (self.count - 1)
        every = f", every {self.stride}." if self.stride > 1 else ""
        return f"{self.performer} {self.first}-{last}{every}, key {self.first + self.stride * self.key}"


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
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="the folder of the performers")
    parser.add_argument("performers", nargs="*", help="all if none is named")
    given = parser.parse_args()
    for case in CASES:
        if given.performers and case.performer not in given.performers:
            continue
        rows = measure(case, frames_of(case, given.data))
        for row in rows:
            print("  ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{v}" for k, v in row.items()), flush=True)
        keep(rows)
    return 0


def frames_of(case: Case, data: Path) -> list[Mesh]:
    """The case's frames in normalised coordinates; a performer in one file loses its vertices' order."""
    numbers = range(case.first, case.first + case.stride * case.count, case.stride)
    packed = data / f"{case.performer}.npz"
    source = packed if packed.is_file() else data / case.performer
    sequence = open_sequence(source, SequenceOptions(weld=weld))
    meshes = MeshList(tuple(sequence[n] for n in numbers))
    seen = survey(meshes)
    frames = [seen.normalise(mesh) for mesh in meshes]
    return [shuffled(frame, n) for n, frame in enumerate(frames)] if packed.is_file() else frames


def shuffled(mesh: Mesh, seed: int) -> Mesh:
    """The mesh with its vertices in another order."""
    order = np.random.default_rng(seed).permutation(len(mesh.vertices))
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return Mesh.of(mesh.vertices[order], rank[mesh.faces])


def measure(case: Case, frames: Sequence[Mesh]) -> list[Row]:
    """A row for each way of finding correspondence."""
    base = decimate(frames[case.key], BASE)
    template = subdivide_midpoint(base, LEVELS)
    rows = []
    ways: dict[str, Callable[[Sequence[Mesh], int, Mesh], Positions]] = {"centers": centers, "embedded": embedded}
    for way, predict in ways.items():
        begin = time.process_time()
        predictions = predict(frames, case.key, template)
        cost = (time.process_time() - begin) / len(frames)
        row: Row = {"decision": DECISION, "case": case.name, "way": way, "cpu_s_per_frame": cost}
        before = [residual(Mesh(p, template.faces), Target(m)) for p, m in zip(predictions, frames, strict=True)]
        row |= {f"before_{k}": v for k, v in _summary(before).items()}
        fit = fit_frames(template.faces, predictions, frames, FitOptions(key=case.key))
        row |= {f"after_{k}": v for k, v in _summary(fit.residuals).items()}
        errors = [surface_errors(m, Mesh(p, template.faces)) for p, m in zip(fit.positions, frames, strict=True)]
        row["d2_psnr_paper"] = float(np.mean([e.d2_psnr_paper for e in errors]))
        row["worst_d2_psnr_paper"] = min(e.d2_psnr_paper for e in errors)
        row["symmetric_psnr"] = float(np.mean([e.symmetric_psnr for e in errors]))
        row["bits_plain"], row["bits_predicted"] = roughness(fit.positions[:, : len(base.vertices)], base, case.key)
        rows.append(row)
    return rows


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


def keep(rows: Sequence[Row]) -> None:
    """Puts rows into measured.jsonl, in place of those of the same case."""
    cases = {row["case"] for row in rows}
    lines = ROWS.read_text(encoding="utf-8").splitlines()
    others = [line for line in lines if json.loads(line).get("case") not in cases]
    text = "\n".join([*others, *(json.dumps(row) for row in rows)]) + "\n"
    new = ROWS.with_suffix(".new")
    new.write_text(text, encoding="utf-8")
    new.replace(ROWS)


def _summary(residuals: Sequence[Residual]) -> Row:
    return {
        "rms": float(np.mean([r.rms for r in residuals])),
        "worst_rms": max(r.rms for r in residuals),
        "normal_error_deg": float(np.mean([r.normals for r in residuals])),
    }


if __name__ == "__main__":
    sys.exit(main())
