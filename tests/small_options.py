"""Encoder options that are quick on small procedural bodies: few centers, a coarse reference, few trials."""

from __future__ import annotations

from dataclasses import replace

from meshreel.choice import IntraOptions, Quality
from meshreel.presets import preset_options
from meshreel.windows import EncoderOptions


def quick(
    preset: str = "paper",
    quality: float = 50.0,
    basis_size: int | None = None,
    group_size: int = 10,
    centers: int = 150,
) -> EncoderOptions:
    """The preset's options made small; takes what `preset_options` takes."""
    options = preset_options(preset, quality, basis_size, group_size, min(centers, 150))
    fuse = replace(options.reference.fuse, poisson=replace(options.reference.fuse.poisson, depth=6))
    return replace(
        options,
        target=Quality(distance=0.003, angle=15.0, worst=0.006),
        track=replace(options.track, samples=3000),
        reference=replace(options.reference, vertices=150, keys=1, trial_depth=5, trial_vertices=150, fuse=fuse),
        intra=IntraOptions(fractions=(1.0,), steps=(1.4, 0.7), levels=(0,)),
    )
