"""Options of the layered encoder for frames that are noisy: below the noise there is nothing to follow or to code.

In -> out: EncoderOptions that name the noise of the frames -> the same with all that is compared with a frame above it.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ..analysis.fit.surface_fit import FitOptions
from ..analysis.follow.embedded import EmbeddedOptions
from .options import EncoderOptions

LOST = 3.0  # RMS distances of the noise that a residual may have besides: legs come and go in noisy frames
KEYS = 2  # tried at most: what one of them lacks, the fused template has from the other frames
FOLLOWED = 6e-4  # RMS noise from which the second fit believes the coherent positions more than the frames
ROUNDS = slice(1, 3)  # of the first fit: motion is smooth under noise, and tighter rounds lay the template onto it
GATE = 6.0  # RMS distances that a pair of closest points may be apart at least: three standard deviations
BASE = 0.5  # RMS distances of the noise that a base mesh may miss besides
BORDER = 100.0  # weight of open borders in the base mesh: a coarse one cuts their corners, and holes grow
STEP = 0.8  # RMS distances of the noise that a step of the base's motion is wide besides


def above_noise(options: EncoderOptions) -> EncoderOptions:
    """The options for frames with `options.noise`; the same object where there is none."""
    noise = options.noise
    if noise == 0:
        return options
    template, layers, tails = options.template, options.layers, options.tails
    return replace(
        options,
        embedded=_tracking(options.embedded, noise),
        fit=_fit(options.fit, noise),
        template=replace(template, error=math.hypot(template.error, BASE * noise), border=BORDER),
        layers=replace(layers, step=math.hypot(layers.step, STEP * noise)),
        tails=tails and replace(tails, noise=noise),
        keys=min(options.keys, KEYS),
    )


def _tracking(options: EmbeddedOptions, noise: float) -> EmbeddedOptions:
    lost = math.hypot(options.lost, LOST * noise)  # a key from which nothing is lost is in no doubt
    return replace(
        options,
        doubt=math.hypot(options.doubt, noise),
        settled=math.hypot(options.settled, noise),
        rekeyed=lost,
        uneven=math.inf,
        lost=lost,
    )


def _fit(options: FitOptions, noise: float) -> FitOptions:
    rounds = ROUNDS if len(options.gates) >= ROUNDS.stop else slice(None)
    stiffer = math.hypot(1.0, noise / FOLLOWED)
    second = options.smoothing[-1] if options.second_smoothing is None else options.second_smoothing
    return replace(
        options,
        gates=tuple(max(gate, GATE * noise) for gate in options.gates[rounds]),
        smoothing=options.smoothing[rounds],
        pull=stiffer * options.pull,
        second_smoothing=stiffer * second,
    )
