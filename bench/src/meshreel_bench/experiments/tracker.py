"""Accuracy of volume tracking where the motion is known (`measure.tracker`), ours beside the published energy's."""

from __future__ import annotations

from ..names import OURS, PUBLISHED
from .study import TRACKER, NoMore, Study, Sweep, Which

BODIES = ("crane", "samba")
TURNING = ("gears", "prism")
STUDY = Study(
    title="Volume tracking against known motion",
    sequences=(*BODIES, *TURNING),
    sweeps=(Sweep(TRACKER, {"method": (OURS, PUBLISHED)}),),
    frames=dict.fromkeys(BODIES, 30) | dict.fromkeys(TURNING, 10),
    promises=tuple(
        NoMore(
            f"{name}: distance of centers from the true motion against the published energy's",
            Which(name, TRACKER, {"method": OURS}),
            "center_rms_mm",
            1.0,
            (Which(name, TRACKER, {"method": PUBLISHED}),),
        )
        for name in (*BODIES, *TURNING)
    ),
    notes=(
        "Centers of the first frame are the same for both. The true motion of one is that of the surface around it, as",
        "rigid as it can be; `truth_rms_mm` is by how much that differs with the number of vertices it is taken from.",
    ),
)
