"""What the template and the steps of `layers` are chosen from: base meshes, levels, midpoints and ratios of steps.

python benchmarks/templates.py --data ../shared/data/performers        # twenty minutes

In: the frames of the dancer. Out: a line a point, and the rows `template` of docs/decisions/measured.jsonl.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from captured import Case, Row, asked_cases, keep

from meshreel.analysis.fit.match import Target
from meshreel.analysis.fit.surface_fit import Guides, fit_targets
from meshreel.analysis.follow.correspond import choose_key
from meshreel.analysis.follow.template import shared_detail
from meshreel.coding.layers.coder import LayerCodingOptions, encode_layers
from meshreel.coding.reference_mesh import CodedReference, code_on_lattice
from meshreel.encoder.presets import preset_options
from meshreel.encoder.target import measure
from meshreel.geometry.decimate import decimate
from meshreel.types import Mesh

DECISION, CASES = "template", (Case("dancer"),)
BEST = preset_options("best")
TEMPLATES = ((500, 2), (700, 2), (1000, 2), (1500, 2), (2500, 1), (500, 3))  # vertices of the base, levels
STEPS = (0.0035, 0.0018, 0.0009)
CHOICES: dict[str, dict[str, Any]] = {  # of the coder, on the base of 1000 vertices
    "flat midpoints": {"curvatures": (0,)},
    "ratios .8, .8": {"detail_ratios": (0.8, 0.8)},
    "ratios .6, 1.2": {"detail_ratios": (0.6, 1.2)},
    "price .04": {"price": 0.04},
    "price .12": {"price": 0.12},
}


def main() -> int:
    """Measures every point and replaces the rows of this decision."""
    for case, frames in asked_cases(__doc__, CASES):
        keep({"decision": DECISION, "sequence": case.performer} | row for row in _measured(frames))
    return 0


def _measured(frames: list[Mesh]) -> Iterator[Row]:
    targets = [Target(frame) for frame in frames]
    course = choose_key(targets, BEST.embedded)
    for vertices, levels in TEMPLATES:
        lattice = 0.33 * BEST.layers.step
        reference = code_on_lattice(decimate(frames[course.key], vertices), lattice, levels)
        base, faces = reference.mesh, reference.base.faces
        shared = shared_detail(base.faces, len(base.vertices), levels)
        fit = replace(BEST.fit, key=course.key)
        positions = fit_targets(faces, course.move(reference.base), targets, fit, Guides(None, shared))
        name = f"{vertices} vertices, {levels} levels"
        tried: dict[str, dict[str, Any]] = {"": {}} | (CHOICES if (vertices, levels) == (1000, 2) else {})
        for choice, changes in tried.items():
            for step in STEPS:
                options = replace(BEST.layers, step=step, **changes)
                yield {"template": name, "choice": choice, "step": step} | _point(frames, reference, positions, options)


def _point(frames: list[Mesh], reference: CodedReference, positions: np.ndarray, options: LayerCodingOptions) -> Row:
    coded = encode_layers(reference, positions, options)
    quality = measure(frames, [Mesh(places, reference.base.faces) for places in coded.positions])
    mbps = len(coded.payload) * 8 * 30 / len(frames) / 1e6
    symmetric = -20 * np.log10(quality.distance / np.mean([frame.diagonal for frame in frames]))
    return {
        "mbps": round(mbps, 4),
        "d2_psnr_paper": round(quality.psnr, 2),
        "symmetric_psnr": round(float(symmetric), 2),
        "normal_error_deg": round(quality.angle, 3),
    }


if __name__ == "__main__":
    sys.exit(main())
