"""The numbers in docs/decisions, measured on one group of the procedural story: one JSON row a line.

python benchmarks/decisions.py > docs/decisions/measured.jsonl        # some minutes
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np

from meshreel.choice import cheapest_intra, measure
from meshreel.coding.displacements import DisplacementOptions, decode_displacements, encode_displacements
from meshreel.presets import displacement_step, preset_options

sys.path.insert(0, str(Path(__file__).parent))
from stages import Stages, compute, story

Row = dict[str, Any]


def main() -> int:
    """Prints every row as soon as it is there."""
    stages = compute(story(), preset_options())
    for rows in (float_rows(), lattice_rows(stages), anchor_rows(stages), pose_rows(stages), floor_rows(stages)):
        for row in rows:
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


def anchor_rows(stages: Stages) -> Iterator[Row]:
    """Rate and error of the displacements: plain or shaped rounding, few or many anchors, at three qualities."""
    base = stages.coded.base
    field = np.moveaxis(stages.fit.positions, 0, 1) - base.vertices[:, None]
    few, many = 12, len(base.vertices) // 20
    ways: dict[str, Row] = {
        "plain, few": {"anchor_count": few, "dead_zone": 0.5},
        "plain, one in twenty": {"anchor_count": many, "anchor_weight": 1, "dead_zone": 0.5},
        "dead zone, one in twenty": {"anchor_count": many, "anchor_weight": 1, "dead_zone": 0.6},
        "shaped, few": {"anchor_count": few},
        "shaped, one in twenty": {"anchor_count": many},
    }
    for quality in (20, 50, 80):
        step = displacement_step(quality)
        for name, how in ways.items():
            for factor in (0.25, 0.5, 1.0, 2.0):
                options = DisplacementOptions(step=factor * step, **how)
                data = encode_displacements(field, base, options)
                error = decode_displacements(data, base) - field
                rms = float(np.sqrt(np.mean(np.sum(np.square(error), axis=2))))
                yield {"decision": "anchors", "quality": quality, "rounding": name, "step": factor * step,
                       "bytes": len(data), "rms": rms}  # fmt: skip


def pose_rows(stages: Stages) -> Iterator[Row]:
    """The trials that the reference's pose was chosen from: symmetric distances as fractions of the diagonal."""
    for trial in stages.reference.trials:
        name = "MDS" if trial.frame < 0 else f"frame {trial.frame}"
        yield {"decision": "pose", "pose": name, "rms": trial.rms, "q95": trial.tail}


def floor_rows(stages: Stages) -> Iterator[Row]:
    """Bytes of the group in the laplacian form, and in the draco form that is as good."""
    quality = measure(stages.frames, stages.decoded)
    found = cheapest_intra(stages.frames, quality, np.inf, replace(preset_options().intra))
    yield {"decision": "floor", "laplacian_bytes": len(stages.payload), "draco_bytes": len(found[0]) if found else None,
           "rms": quality.distance, "normal_error_deg": quality.angle}  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
