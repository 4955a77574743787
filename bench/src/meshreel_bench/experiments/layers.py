"""Targets of the preset `best`: against the hull of all per-frame anchors, on performers and colliding shapes."""

from __future__ import annotations

from ..names import BEST, DECIMATED, DRACO, SUBDIVIDED
from .study import (
    D2,
    KEYLESS,
    NORMALS,
    SYMMETRIC,
    Always,
    Bound,
    Flat,
    Gains,
    Promise,
    Reaches,
    Study,
    Sweep,
    Values,
    Which,
    at_most,
)

REMESHED = ("crane60", "samba60")
BODIES = ("dancer", "basketball_player", "mitch", *REMESHED)
BACKWARDS = tuple(f"{body}-backwards" for body in REMESHED)
QUALITIES: dict[str, Values] = {
    "dancer": {"quality": (5.0, 20.0, 35.0, 45.0, 50.0, 65.0, 80.0, 95.0)},
    "basketball_player": {"quality": (5.0, 20.0, 35.0, 50.0, 65.0, 80.0, 95.0)},
    "mitch": {"quality": (50.0, 65.0, 67.0, 69.0, 80.0)},
    **{body: {"quality": (25.0, 50.0, 75.0)} for body in REMESHED},
    "collision": {"quality": (50.0,)},
    **{body: {"quality": (50.0,)} for body in BACKWARDS},
}


def _pairs(*pairs: tuple[float, int]) -> Values:
    return {"fraction": tuple(fraction for fraction, _ in pairs), "qp": tuple(qp for _, qp in pairs)}


# Fraction of the vertices and bits of the anchors: those on or next to the hull of a full sweep on one frame. Free
# subdivision changes neither rate nor distance, and normals for the better below half of the vertices: plain
# decimation needs few points. QEM leaves 5 % of a remeshed body at least.
PLAIN = _pairs((0.06, 9), (0.12, 10), (0.3, 11), (0.5, 11), (0.75, 12))
PLAIN_ONE = _pairs((0.3, 11))
FINE = _pairs(
    *((0.015, 8), (0.02, 8), (0.03, 8), (0.03, 9), (0.04, 8), (0.04, 9), (0.06, 8), (0.06, 9), (0.08, 9), (0.08, 10)),
    *((0.12, 10), (0.2, 10), (0.2, 11), (0.3, 11), (0.3, 12), (0.5, 11), (0.5, 12), (0.75, 12)),
)
FINE_ON = {
    "mitch": _pairs((0.03, 8), (0.12, 10), (0.75, 12)),  # for the eye: nothing is judged by it
    "crane60": _pairs((0.05, 7), (0.08, 8), (0.12, 9), (0.2, 10), (0.3, 11), (0.5, 11)),
    "samba60": _pairs((0.08, 8), (0.2, 10), (0.5, 11)),
}
FEW = ("mitch", "crane60", "samba60")  # one point each of Draco and of plain decimation, which are off the hull there
JUDGED = (SYMMETRIC, NORMALS, KEYLESS)
ANCHORS = (DRACO, DECIMATED, SUBDIVIDED)


def _bounds(mbps: float, db: float, degrees: float, *more: Bound) -> tuple[Bound, ...]:
    """Return bounds of rate, D2 and normals, and some more."""
    rate, normals = at_most("mbps", mbps, "Mbps"), at_most(NORMALS.key, degrees, "degrees")
    return (rate, Bound(D2.key, db, "dB"), normals, *more)


PROMISES: tuple[Promise, ...] = (
    Reaches(
        "dancer: rate, D2, normals, SSIM without key frames (released code 5.8 Mbps at 56.4 dB)",
        Which("dancer", BEST),
        _bounds(0.34, 64.0, 5.3, Bound(KEYLESS.key, 0.86, "SSIM")),
    ),
    Reaches("dancer, high: rate, D2, normals", Which("dancer", BEST), _bounds(1.0, 67.9, 4.1)),
    Reaches(
        "basketball_player: rate, D2, normals, worst frame's D2",
        Which("basketball_player", BEST),
        _bounds(0.39, 65.0, 4.3, Bound("d2_psnr_paper_worst", 62.0, "dB")),
    ),
    Reaches("mitch: rate, D2, normals", Which("mitch", BEST), _bounds(0.27, 70.0, 3.4)),
    *(Gains(body, BEST, ANCHORS, JUDGED, -70.0) for body in REMESHED),
    *(
        Always(
            f"{body}: bytes of frames 31 to 60 over those of 1 to 30",
            Which(body, BEST),
            at_most("second_half_over_first", 1.0),
        )
        for body in (*REMESHED, *BACKWARDS)
    ),
    Always(
        "collision: decoded triangles that bridge the bodies once they are apart",
        Which("collision", BEST),
        at_most("bridges", 0),
    ),
    *(
        Gains(body, BEST, ANCHORS, JUDGED, -60.0, ends_past=Bound(SYMMETRIC.key, 70.0, "dB"))
        for body in ("dancer", "basketball_player")
    ),
    Always("bodies: step of PSNR at a border of groups", Which("", BEST), at_most("border_step_db", 1.5, "dB")),
    Always("encode, dancer", Which("dancer", BEST), at_most("encode_s", 4.0, "CPU s/frame")),
    Flat(Which("collision", BEST)),
    Always("decode, dancer", Which("dancer", BEST), at_most("decode_ms", 1.5, "ms")),
)
STUDY = Study(
    title="Targets of the preset `best`",
    sequences=(*BODIES, "collision", *BACKWARDS),
    sweeps=(
        Sweep("meshreel", {}, {"preset": "best"}, on=QUALITIES),
        Sweep("meshreel", {}, {"preset": "paper", "quality": 50.0}, only=BODIES[:2]),
        Sweep("draco", {"qp": (9, 10, 11)}, on={body: {"qp": (9,)} for body in FEW}, only=BODIES),
        Sweep("decimated_draco", FINE, {"levels": 1}, on=FINE_ON, only=BODIES),
        Sweep("decimated_draco", PLAIN, {"levels": 0}, on=dict.fromkeys(FEW, PLAIN_ONE), only=BODIES),
        *(
            Sweep("meshreel", {}, {"preset": "best", "quality": 50.0}, only=("collision",), frames=frames)
            for frames in (20, 60)
        ),
    ),
    metrics="parallel views",
    measures=(SYMMETRIC, KEYLESS, D2, NORMALS),
    anchor=SUBDIVIDED,
    promises=PROMISES,
)
