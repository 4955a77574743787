"""Presets: one name and one quality from 0 to 100 set every option of the encoder.

In -> out: what a user chooses -> EncoderOptions. The curves were chosen after rate-distortion points of a captured
dancer; what they give is in docs/results.md.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ..analysis.fit.surface_fit import FitOptions
from ..analysis.follow.template import TemplateOptions
from ..analysis.groups import GroupOptions
from ..analysis.reference.extraction import ReferenceOptions
from ..analysis.reference.track import TrackOptions
from ..coding.layers.coder import LayerCodingOptions
from ..coding.paper.displacements import DisplacementOptions
from ..errors import InputError
from ..format.layout import Form
from .options import EncoderOptions
from .target import Fidelity

PRESETS = ("best", "paper")


def preset_options(
    preset: str = "best",
    quality: float = 50.0,
    basis_size: int | None = None,
    group_size: int | None = None,
    centers: int | None = None,
    key_interval: float | None = None,
) -> EncoderOptions:
    """The encoder's options for a preset at a quality; `basis_size` fixes the components of a group.

    Raises InputError for an unknown preset or values out of range.
    """
    if preset not in PRESETS:
        raise InputError(f"no preset is called {preset!r}; known: {', '.join(PRESETS)}")
    if not 0 <= quality <= 100:
        raise InputError(f"quality must be in 0 to 100, got {quality:g}")
    if preset == "best" and basis_size is not None:
        raise InputError(f"basis size {basis_size}: preset `best` chooses the components; use preset `paper`")
    if preset == "best" and centers is not None:
        raise InputError(f"centers {centers}: preset `best` tracks none; use preset `paper`")
    if preset != "best" and key_interval is not None:
        raise InputError(f"key interval {key_interval:g}: groups of preset `{preset}` all decode on their own")
    chosen = _best(float(quality)) if preset == "best" else _paper(float(quality), centers)
    options = replace(chosen, preset=preset, quality=float(quality))
    if group_size is not None:
        options = replace(options, group_size=group_size)
    if basis_size is not None:
        options = replace(options, displacements=replace(options.displacements, basis_size=basis_size))
    if key_interval is not None:
        options = replace(options, key_interval=key_interval)
    return options


def _paper(quality: float, centers: int | None) -> EncoderOptions:
    step = displacement_step(quality)
    centers = 2000 if centers is None else centers
    return EncoderOptions(
        track=TrackOptions(centers=centers, samples=max(45_000, 4 * centers)),
        target=Fidelity(distance=0.5 * step + 0.0001, angle=7.0, worst=step),
        reference=ReferenceOptions(vertices=reference_vertices(quality)),
        displacements=DisplacementOptions(step=step),
    )


def _best(quality: float) -> EncoderOptions:
    """Layers and template alone belong to this preset: their defaults are its values at quality 50."""
    step = motion_step(quality)
    return EncoderOptions(
        form=Form.LAYERS,
        group_size=16,
        target=Fidelity(distance=0.2 * step + 0.00005, angle=7.0, worst=step),
        template=TemplateOptions(error=0.00088 * (step / 0.0012) ** 0.55),
        layers=LayerCodingOptions(step=step),
        displacements=DisplacementOptions(step=displacement_step(quality)),
        fit=FitOptions(restart=False, pull=0.3, second_smoothing=0.7),  # the defaults are those of `paper`
        groups=GroupOptions(worth=0.9),  # likewise
    )


def motion_step(quality: float) -> float:
    """Quantiser step of the base's motion as a fraction of the diagonal: .0018 at 50, halved every 25 points."""
    return 0.0018 * 2 ** ((50 - quality) / 25)


def displacement_step(quality: float) -> float:
    """Quantiser step of the displacements as a fraction of the diagonal: .0008 at 50, halved every 25 points."""
    return 0.0008 * 2 ** ((50 - quality) / 25)


def reference_vertices(quality: float) -> int:
    """Vertices of the reference mesh: 800 at 0, 2000 at 50, 5000 at 100."""
    return round(2000 * 2.5 ** ((quality - 50) / 50))


def quality_of_vertices(vertices: int) -> float:
    """The quality, 0 to 100, at which a reference mesh has nearest to so many vertices."""
    return min(max(50 + 50 * math.log(max(vertices, 1) / 2000, 2.5), 0.0), 100.0)
