"""Decisions 1, 2, 5, 6, 7 and 10, measured on one group of the procedural story at quality 50, in some minutes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache

import DracoPy
import numpy as np

from meshreel.analysis.fit.surface_fit import Guides, fit_frames
from meshreel.analysis.reference.centers import affinity, largest_distances
from meshreel.analysis.reference.deform import neighbours
from meshreel.analysis.reference.extraction import MDS
from meshreel.analysis.reference.fuse import Group, GroupCenters
from meshreel.coding.group import decode_group
from meshreel.coding.paper import quantize
from meshreel.coding.paper.displacements import DisplacementOptions, decode_displacements, encode_displacements
from meshreel.coding.paper.group import encode_laplacian
from meshreel.coding.paper.laplacian import System, anchors
from meshreel.coding.reference_mesh import code_reference
from meshreel.encoder.draco import cheapest_intra
from meshreel.encoder.options import PaperOptions
from meshreel.encoder.presets import displacement_step
from meshreel.encoder.target import measure
from meshreel.format.layout import AnchorRule
from meshreel.types import Mesh

from .rows import Row, Sources
from .stages import FIRST, Stages, compute, story


@cache
def stages_of(first: int = 0) -> Stages:
    """Return the stages of ten frames of the story: apart from the first on, taking hands from `FIRST` on."""
    return compute(story(first), PaperOptions())


def float_rows() -> Iterator[Row]:
    """Yield the distance from one float32 to the next, at coordinates up to those of geo-referenced captures."""
    for coordinate in (1.0, 1e3, 1e6):
        yield {"coordinate_m": coordinate, "float32_gap_m": float(np.spacing(np.float32(coordinate)))}


def lattice_rows(stages: Stages) -> Iterator[Row]:
    """Yield the largest distance of Draco's positions from the lattice, in its steps."""
    cells = np.asarray(DracoPy.decode(stages.coded.data).points, dtype=np.float64) / stages.coded.step
    yield {"largest_distance_steps": float(np.abs(cells - np.rint(cells)).max())}


def noise_rows(base: Mesh) -> Iterator[Row]:
    """Yield the variance of the error that rounding leaves in smooth weights on a mesh, in units of step^2 / 12."""
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
        yield {
            "rounding": rounding,
            "anchors": count,
            "anchor_weight": weight,
            "vertices": len(points),
            "variance": variance / (steps[0] ** 2 / 12),
        }


def anchor_rows(stages: Stages) -> Iterator[Row]:
    """Yield rate and error of the displacements: plain or shaped rounding, few or many anchors, some steps."""
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
            yield {"rounding": name, "step": options.step, "bytes": len(data), "rms": rms}


def pose_rows(stages: Stages) -> Iterator[Row]:
    """Yield the residual of the fit from each pose, of all frames and of the worst one, and which pose was chosen."""
    options = PaperOptions()
    distances = largest_distances(stages.centers)
    kin = neighbours(affinity(distances, options.reference.centers), options.reference.deform)
    tracked = GroupCenters(stages.centers.positions, distances, kin)
    group = Group(stages.frames, tracked, options.reference.deform, options.reference.fuse)
    keys = sorted(trial.key for trial in stages.reference.trials if trial.frame != MDS)
    for frame, key in [(MDS, key) for key in keys] + [(key, key) for key in keys]:
        pose = stages.spread if frame == MDS else stages.centers.positions[frame]
        mesh = group.fused(pose, key, options.reference.fuse.poisson.depth, options.reference.vertices)
        base = code_reference(mesh, options.reference_bits, options.levels).base
        fit = fit_frames(base.faces, group.sent(base, pose), stages.frames, options.fit, Guides(key=key))
        rms = [residual.rms for residual in fit.residuals]
        chosen = (frame, key) == (stages.reference.frame, stages.reference.key)
        yield {
            "pose": "MDS" if frame == MDS else f"frame {frame}",
            "key": key,
            "chosen": chosen,
            "mean_rms": float(np.mean(rms)),
            "worst_rms": max(rms),
        }


def floor_rows(stages: Stages) -> Iterator[Row]:
    """Yield bytes of the group in the laplacian form, and in the draco form of the same fidelity."""
    quality = measure(stages.frames, stages.decoded)
    found = cheapest_intra(stages.frames, quality, np.inf, PaperOptions().intra)
    yield {
        "laplacian_bytes": len(stages.payload),
        "draco_bytes": len(found[0]) if found else None,
        "rms": quality.distance,
        "normal_error_deg": quality.angle,
    }


def second_fit_rows(stages: Stages) -> Iterator[Row]:
    """Yield bytes and distance of fits without a second fit, or with one from few or many components of the first."""
    options = PaperOptions()
    faces, guides = stages.coded.base.faces, Guides(key=stages.reference.key)
    starts = (0, 3, 15)
    fits = [
        fit_frames(faces, stages.predictions, stages.frames, replace(options.fit, components=start), guides)
        for start in starts
    ]
    for sent in (3, 10, None):
        for start, fit in zip(starts, fits, strict=True):
            field = np.ascontiguousarray(np.moveaxis(fit.positions, 0, 1) - stages.coded.base.vertices[:, None])
            payload, layers = encode_laplacian(stages.coded, field, replace(options.displacements, basis_size=sent))
            shown = measure(stages.frames, decode_group(payload, len(stages.frames)))
            yield {
                "start": start,
                "basis_size": sent,
                "components": len(layers) - 1,
                "bytes": len(payload),
                "rms": shown.distance,
                "normal_error_deg": shown.angle,
            }


MEASURE: dict[str, Callable[[Sources], Iterable[Row]]] = {
    "float64": lambda _: float_rows(),
    "lattice": lambda _: lattice_rows(stages_of()),
    "noise": lambda _: noise_rows(stages_of().frames[0]),
    "anchors": lambda _: anchor_rows(stages_of()),
    "floor": lambda _: floor_rows(stages_of()),
    "second_fit": lambda _: second_fit_rows(stages_of()),
    "pose": lambda _: pose_rows(stages_of(FIRST)),
}
