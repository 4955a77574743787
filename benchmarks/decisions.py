"""The numbers in docs/decisions, measured on one group of the procedural story: one JSON row a line.

python benchmarks/decisions.py > docs/decisions/measured.jsonl        # some minutes
That drops the rows of captured bodies, which benchmarks/correspondence.py and benchmarks/tails.py put in again.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np

from meshreel.analysis.fit.surface_fit import fit_frames
from meshreel.analysis.reference.centers import affinity, largest_distances
from meshreel.analysis.reference.deform import neighbours
from meshreel.analysis.reference.extraction import MDS
from meshreel.analysis.reference.fuse import Group
from meshreel.coding.group import decode_group, encode_group
from meshreel.coding.paper import quantize
from meshreel.coding.paper.displacements import DisplacementOptions, decode_displacements, encode_displacements
from meshreel.coding.paper.laplacian import System, anchors
from meshreel.coding.reference_mesh import code_reference
from meshreel.encoder.draco import cheapest_intra
from meshreel.encoder.presets import displacement_step, preset_options
from meshreel.encoder.target import measure
from meshreel.format.layout import AnchorRule
from meshreel.types import Mesh

sys.path.insert(0, str(Path(__file__).parent))
from stages import Stages, compute, story

Row = dict[str, Any]


def main() -> int:
    """Prints every row as soon as it is there."""
    apart, meeting = compute(story(0), preset_options("paper")), compute(story(), preset_options("paper"))
    rows = (float_rows(), lattice_rows(apart), noise_rows(apart.frames[0]), anchor_rows(apart))
    for row in chain(*rows, floor_rows(apart), second_fit_rows(apart), pose_rows(meeting)):
        print(json.dumps(row), flush=True)
    return 0


def float_rows() -> Iterator[Row]:
    """The distance from one float32 to the next, for a coordinate as geo-referenced captures have them."""
    for coordinate in (1.0, 1e3, 1e6):
        yield {
            "decision": "float64",
            "coordinate_m": coordinate,
            "float32_gap_m": float(np.spacing(np.float32(coordinate))),
        }


def lattice_rows(stages: Stages) -> Iterator[Row]:
    """How far the positions that Draco gives are from the lattice, in its steps."""
    cells = np.asarray(DracoPy.decode(stages.coded.data).points, dtype=np.float64) / stages.coded.step
    yield {"decision": "lattice", "largest_distance_steps": float(np.abs(cells - np.rint(cells)).max())}


def noise_rows(base: Mesh) -> Iterator[Row]:
    """The variance of the error that rounding leaves in smooth weights on a mesh, in units of step^2 / 12."""
    points = base.vertices
    weights = np.concatenate([np.sin(k * points + k) for k in range(1, 5)], axis=1)
    steps, free = np.full(weights.shape[1], 1e-3), np.zeros(weights.shape[1])
    tenth, hundredth = len(points) // 10, len(points) // 100
    ways = [("plain", tenth, 1), ("plain", hundredth, 1), ("plain", 12, 1), ("plain", 2, 1)]
    ways += [("shaped", tenth, 1), ("shaped", 12, 4), ("shaped", 2, 4)]
    for rounding, count, weight in ways:
        system = System(base, anchors(AnchorRule.FARTHEST, count, base.faces, len(points)), weight)
        deltas = system.forward(weights)
        symbols = system.quantize(deltas, steps, free) if rounding == "shaped" else quantize.forward(deltas, steps)
        variance = float(np.mean(np.square(system.inverse(symbols * steps) - weights)))
        yield {"decision": "noise", "rounding": rounding, "anchors": count, "anchor_weight": weight,
               "vertices": len(points), "variance": variance / (steps[0] ** 2 / 12)}  # fmt: skip


def anchor_rows(stages: Stages) -> Iterator[Row]:
    """Rate and error of the displacements: plain or shaped rounding, few or many anchors, some steps."""
    base = stages.coded.base
    field = np.moveaxis(stages.fit.positions, 0, 1) - base.vertices[:, None]
    few, many = 12, len(base.vertices) // 20
    ways: dict[str, Row] = {
        "plain, few": {"anchor_count": few, "dead_zone": 0.5},
        "plain, one in twenty": {"anchor_count": many, "anchor_weight": 1, "dead_zone": 0.5},
        "dead zone, one in twenty": {"anchor_count": many, "anchor_weight": 1, "dead_zone": 0.6},
        "shaped, few": {"anchor_count": few},
    }
    for name, how in ways.items():
        for factor in (0.35, 0.7, 1.4, 2.8):
            options = DisplacementOptions(step=factor * displacement_step(50), **how)
            data = encode_displacements(field, base, options)
            error = decode_displacements(data, base) - field
            rms = float(np.sqrt(np.mean(np.sum(np.square(error), axis=2))))
            yield {"decision": "anchors", "rounding": name, "step": options.step, "bytes": len(data), "rms": rms}


def pose_rows(stages: Stages) -> Iterator[Row]:
    """The fit of the reference that each pose would have given, mean and worst frame, and which was chosen."""
    options = preset_options("paper")
    distances = largest_distances(stages.centers)
    kin = neighbours(affinity(distances, options.reference.centers), options.reference.deform)
    how = (options.reference.deform, options.reference.fuse)
    group = Group(stages.frames, stages.centers.positions, distances, kin, how)
    keys = sorted(trial.key for trial in stages.reference.trials if trial.frame != MDS)
    for frame, key in [(MDS, key) for key in keys] + [(key, key) for key in keys]:
        pose = stages.spread if frame == MDS else stages.centers.positions[frame]
        mesh = group.fused(pose, key, options.reference.fuse.poisson.depth, options.reference.vertices)
        base = code_reference(mesh, options.reference_bits, options.levels).base
        fit = fit_frames(base.faces, group.sent(base, pose), stages.frames, replace(options.fit, key=key))
        rms = [residual.rms for residual in fit.residuals]
        chosen = (frame, key) == (stages.reference.frame, stages.reference.key)
        yield {"decision": "pose", "pose": "MDS" if frame == MDS else f"frame {frame}", "key": key,
               "chosen": chosen, "mean_rms": float(np.mean(rms)), "worst_rms": max(rms)}  # fmt: skip


def floor_rows(stages: Stages) -> Iterator[Row]:
    """Bytes of the group in the laplacian form, and in the draco form that is as good."""
    quality = measure(stages.frames, stages.decoded)
    found = cheapest_intra(stages.frames, quality, np.inf, preset_options("paper").intra)
    yield {"decision": "floor", "laplacian_bytes": len(stages.payload), "draco_bytes": len(found[0]) if found else None,
           "rms": quality.distance, "normal_error_deg": quality.angle}  # fmt: skip


def second_fit_rows(stages: Stages) -> Iterator[Row]:
    """Bytes and distance of fits made without a second fit, or with one from few or many components of the first."""
    options = preset_options("paper")
    key, base = stages.reference.key, stages.coded.base
    for start in (0, 3, 15):
        fit = fit_frames(base.faces, stages.predictions, stages.frames, replace(options.fit, key=key, components=start))
        field = np.ascontiguousarray(np.moveaxis(fit.positions, 0, 1) - base.vertices[:, None])
        for sent in (3, 10, None):
            how = replace(options.displacements, basis_size=sent)
            payload, layers = encode_group(stages.coded, field, how)
            quality = measure(stages.frames, decode_group(payload, len(stages.frames)))
            yield {"decision": "second fit", "start": start, "basis_size": sent, "components": len(layers) - 1,
                   "bytes": len(payload), "rms": quality.distance, "normal_error_deg": quality.angle}  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
