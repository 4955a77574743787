"""Presets: one name and one quality from 0 to 100 set every option of the encoder.

In -> out: what a user chooses -> EncoderOptions. The curves were chosen after rate-distortion points of a captured
dancer; what they give is in docs/results.md.
"""

from __future__ import annotations

from .analysis.reference import ReferenceOptions
from .analysis.track import TrackOptions
from .choice import Quality
from .coding.displacements import DisplacementOptions
from .errors import InputError
from .windows import EncoderOptions

PRESETS = ("paper",)


def preset_options(
    preset: str = "paper",
    quality: float = 50.0,
    basis_size: int | None = None,
    group_size: int = 10,
    centers: int = 2000,
) -> EncoderOptions:
    """The encoder's options for a preset at a quality; `basis_size` fixes the components of a group.

    Raises InputError for an unknown preset or values out of range.
    """
    if preset not in PRESETS:
        raise InputError(f"no preset is called {preset!r}; known: {', '.join(PRESETS)}")
    if not 0 <= quality <= 100:
        raise InputError(f"quality must be in 0 to 100, got {quality:g}")
    step = displacement_step(quality)
    return EncoderOptions(
        preset=preset,
        quality=float(quality),
        group_size=group_size,
        target=Quality(distance=0.5 * step + 0.0001, angle=7.0, worst=step),
        track=TrackOptions(centers=centers, samples=max(45_000, 4 * centers)),
        reference=ReferenceOptions(vertices=reference_vertices(quality)),
        displacements=DisplacementOptions(step=step, basis_size=basis_size),
    )


def displacement_step(quality: float) -> float:
    """Quantiser step of the displacements as a fraction of the diagonal: .0008 at 50, halved every 25 points."""
    return 0.0008 * 2 ** ((50 - quality) / 25)


def reference_vertices(quality: float) -> int:
    """Vertices of the reference mesh: 800 at 0, 2000 at 50, 5000 at 100."""
    return round(2000 * 2.5 ** ((quality - 50) / 50))
