"""Decision 14: the template and the steps of `layers`; base meshes, levels, midpoints and ratios of steps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from meshreel.analysis.fit.frame import FrameSurface
from meshreel.analysis.fit.surface_fit import Guides, fit_surfaces
from meshreel.analysis.follow.template import shared_detail
from meshreel.coding.layers.coder import LayerCodingOptions, encode_layers
from meshreel.coding.reference_mesh import CodedReference, code_on_lattice
from meshreel.encoder.options import LayersOptions
from meshreel.encoder.target import measure as measure_fidelity
from meshreel.geometry.decimate import decimate
from meshreel.types import Mesh

from .correspondence import placed, registered
from .rows import Case, Row, Sources, mbps_of

CASE = Case("dancer")
TEMPLATES = ((500, 2), (700, 2), (1000, 2), (1500, 2), (2500, 1), (500, 3))  # vertices of the base, levels
STEPS = (0.0035, 0.0018, 0.0009)  # of the diagonal
LATTICE = 0.33  # step of the base mesh's lattice, in steps
TRIED = (1000, 2)  # the template on which choices of the coder are tried
CHOICES: dict[str, dict[str, Any]] = {
    "flat midpoints": {"curvatures": (0,)},
    "ratios .8, .8": {"detail_ratios": (0.8, 0.8)},
    "ratios .6, 1.2": {"detail_ratios": (0.6, 1.2)},
    "price .04": {"price": 0.04},
    "price .12": {"price": 0.12},
}


def measure(sources: Sources) -> Iterator[Row]:
    """Yield a row for each point."""
    best, frames = LayersOptions(), CASE.frames(sources.data)
    targets = [FrameSurface(frame) for frame in frames]
    key = len(frames) // 2
    tracker = registered(frames, key, best.embedded)
    for vertices, levels in TEMPLATES:
        reference = code_on_lattice(decimate(frames[key], vertices), LATTICE * best.layers.step, levels)
        base, faces = reference.mesh, reference.base.faces
        shared = shared_detail(base.faces, len(base.vertices), levels)
        predictions = placed(tracker, len(frames), reference.base)
        positions = fit_surfaces(faces, predictions, targets, best.fit, Guides(None, shared, key))
        name = f"{vertices} vertices, {levels} levels"
        tried: dict[str, dict[str, Any]] = {"": {}} | (CHOICES if (vertices, levels) == TRIED else {})
        for choice, changes in tried.items():
            for step in STEPS:
                options = replace(best.layers, step=step, **changes)
                head: Row = {"sequence": CASE.performer, "template": name, "choice": choice, "step": step}
                yield head | _point(frames, reference, positions, options)


def _point(frames: list[Mesh], reference: CodedReference, positions: np.ndarray, options: LayerCodingOptions) -> Row:
    coded = encode_layers(reference, positions, options)
    fidelity = measure_fidelity(frames, [Mesh(places, reference.base.faces) for places in coded.positions])
    symmetric = -20 * np.log10(fidelity.distance / np.mean([frame.diagonal for frame in frames]))
    return {
        "mbps": round(mbps_of(len(coded.payload), len(frames)), 4),
        "d2_psnr_paper": round(fidelity.psnr, 2),
        "symmetric_psnr": round(float(symmetric), 2),
        "normal_error_deg": round(fidelity.angle, 3),
    }
