"""Options of the layered encoder for frames that are noisy: below the noise there is nothing to follow or to code.

In -> out: EncoderOptions that name the noise of the frames -> the same with all that is compared with a frame above it.
"""

from __future__ import annotations

import math
from dataclasses import replace

from .windows import EncoderOptions

FOLLOWED = 6e-4  # RMS noise from which the second fit believes the coherent positions more than the frames
LOST = 2.0  # RMS distances of the noise that a residual may have besides what it may have without


def above_noise(options: EncoderOptions) -> EncoderOptions:
    """The options for frames with `options.noise`; the same object where there is none."""
    noise = options.noise
    if noise == 0:
        return options
    known = options.embedded
    embedded = replace(
        known,
        doubt=math.hypot(known.doubt, noise),
        settled=math.hypot(known.settled, noise),
        rekeyed=math.hypot(known.rekeyed, LOST * noise),
        lost=math.hypot(known.lost, LOST * noise),
    )
    stiffer = math.hypot(1.0, noise / FOLLOWED)
    fit, tails = options.fit, options.tails
    second = fit.smoothing[-1] if fit.second_smoothing is None else fit.second_smoothing
    fit = replace(fit, pull=stiffer * fit.pull, second_smoothing=stiffer * second)
    tails = tails and replace(tails, noise=noise)
    return replace(options, embedded=embedded, fit=fit, tails=tails)
