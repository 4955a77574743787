"""Targets of the preset `paper`: against per-frame anchors and the released code of TSMC, on captured performers."""

from __future__ import annotations

from ..names import TUNED
from .study import D2, MASKED, NORMALS, SYMMETRIC, Always, Bound, Flat, Promise, Reaches, Study, Sweep, Which

BODIES = ("dancer", "basketball_player", "mitch")
# The authors' released code on dancer, one group of 10 frames, K = 2000: m -> Mbps, D2 in dB (`report.published`).
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
            (Bound("mbps", mbps, "Mbps", least=False), Bound("d2_psnr_paper", db, "dB")),
        )
        for m, (mbps, db) in RELEASED.items()
    ),
    Reaches(
        "dancer: one point by rate-distortion",
        Which("dancer", TUNED),
        (
            Bound("mbps", 1.8, "Mbps", least=False),
            Bound("d2_psnr_paper", 61.0, "dB"),
            Bound("normal_error_deg", 6.0, "degrees", least=False),
        ),
    ),
    *(
        Always(f"{body}: worst frame of the whole curve", Which(body, TUNED), Bound("d2_psnr_paper_worst", 55.0, "dB"))
        for body in ("mitch", "basketball_player")
    ),
    Always(
        "collision: decoded triangles that bridge the bodies once they are apart",
        Which("collision", TUNED, {"centers": None}),
        Bound("bridges", 0, least=False),
    ),
    Reaches(
        "dancer, quality 50: D2 of the first and last frame below that of the middle",
        HALF,
        (Bound("fall_at_ends_db", 3.0, "dB", least=False),),
    ),
    Reaches(
        "dancer, quality 50: faces with less than a thousandth of the median area",
        HALF,
        (Bound("degenerate_faces", 0, least=False),),
    ),
    Reaches("volume tracking, dancer, K = 2000", HALF, (Bound("encode_s.track", 2.0, "CPU s/frame", least=False),)),
    Reaches("encode, dancer at quality 50", HALF, (Bound("encode_s", 8.0, "CPU s/frame", least=False),)),
    Flat(Which("collision", TUNED, {"centers": 200})),
    Reaches(
        "decode, dancer at m = 10", Which("dancer", f"{TUNED} m", LARGEST), (Bound("decode_ms", 25.0, "ms", False),)
    ),
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
