"""Targets of the preset `paper`: against per-frame anchors and the released code of TSMC, on captured performers."""

from __future__ import annotations

from ..names import TUNED
from .study import D2, MASKED, NORMALS, SYMMETRIC, Always, Bound, Flat, Promise, Reaches, Study, Sweep, Which, at_most

BODIES = ("dancer", "basketball_player", "mitch")
# The authors' released code on dancer, one group of 10 frames, K = 2000: m -> Mbps, D2 in dB (`published.json`).
RELEASED = {3: (2.23, 51.87), 5: (3.29, 54.35), 10: (5.78, 56.4), 30: (15.46, 59.02)}
LARGEST = {"basis_size": 10, "quality": 100.0}  # the reference subdivides to 20k vertices
# Fractions and bits on or near the hull of a full sweep on dancer; others only cost time.
DECIMATED = {"fraction": (0.04, 0.08, 0.2), "qp": (9, 9, 10)}
HALF = Which("dancer", TUNED, {"quality": 50.0, "basis_size": None})
MEMORY = {"quality": 50.0, "centers": 200}


def _of_m(m: int) -> Which:
    return Which("dancer", f"{TUNED} m", {"basis_size": m, "quality": 50.0})


PROMISES: tuple[Promise, ...] = (
    *(
        Reaches(
            f"dancer, m = {m}: against the released code",
            _of_m(m),
            (at_most("mbps", mbps, "Mbps"), Bound("d2_psnr_paper", db, "dB")),
        )
        for m, (mbps, db) in RELEASED.items()
    ),
    Reaches(
        "dancer: one point by rate-distortion",
        Which("dancer", TUNED),
        (at_most("mbps", 1.8, "Mbps"), Bound("d2_psnr_paper", 61.0, "dB"), at_most("normal_error_deg", 6.0, "degrees")),
    ),
    *(
        Always(f"{body}: worst frame of the whole curve", Which(body, TUNED), Bound("d2_psnr_paper_worst", 55.0, "dB"))
        for body in ("mitch", "basketball_player")
    ),
    Always(
        "collision: decoded triangles that bridge the bodies once they are apart",
        Which("collision", TUNED, {"centers": None}),
        at_most("bridges", 0),
    ),
    Reaches(
        "dancer, quality 50: D2 of the first and last frame below that of the middle",
        HALF,
        (at_most("fall_at_ends_db", 3.0, "dB"),),
    ),
    Reaches(
        "dancer, quality 50: faces with less than a thousandth of the median area",
        HALF,
        (at_most("degenerate_faces", 0),),
    ),
    Reaches("volume tracking, dancer, K = 2000", HALF, (at_most("encode_s.track", 2.0, "CPU s/frame"),)),
    Reaches("encode, dancer at quality 50", HALF, (at_most("encode_s", 8.0, "CPU s/frame"),)),
    Flat(Which("collision", TUNED, {"centers": 200})),
    Reaches("decode, dancer at m = 10", Which("dancer", f"{TUNED} m", LARGEST), (at_most("decode_ms", 25.0, "ms"),)),
)
STUDY = Study(
    title="Targets of the preset `paper`",
    sequences=(*BODIES, "collision"),
    sweeps=(
        Sweep("meshreel", {"basis_size": tuple(RELEASED)}, only=("dancer",)),
        Sweep("meshreel", {}, LARGEST, only=("dancer",)),
        Sweep("meshreel", {"quality": (15.0, 35.0, 50.0, 75.0)}, on={"collision": {"quality": (50.0,)}}),
        Sweep("draco", {"qp": (7, 8, 9)}, only=BODIES),
        Sweep("decimated_draco", DECIMATED, {"levels": 0}, only=BODIES),
        Sweep("decimated_draco", DECIMATED, {"levels": 1}, only=BODIES),
        *(Sweep("meshreel", {}, MEMORY, only=("collision",), frames=frames) for frames in (20, 60)),
    ),
    measures=(D2, MASKED, SYMMETRIC, NORMALS),
    anchor="decimated_draco_subdivided",
    promises=PROMISES,
)
