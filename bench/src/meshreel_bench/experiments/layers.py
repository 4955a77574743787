"""Targets of the preset `best`: rates against the hull of per-frame anchors, on performers and shapes; and speed."""

from __future__ import annotations

from math import log2

from ..datasets import WITH_CRANE
from ..names import BEST, DECIMATED, DRACO, SUBDIVIDED
from ..rows import Options
from . import study
from .study import D2, NORMALS, SYMMETRIC, Always, Bound, Flat, Gains, NoMore, Reaches, Study, Sweep, Which, at_most

REMESHED = ("crane60", "samba60")
BODIES = ("dancer", "basketball_player", "mitch", *REMESHED)
BACKWARDS = tuple(f"{body}-backwards" for body in REMESHED)
QUALITIES: dict[str, study.Values] = {
    "dancer": {"quality": (5.0, 20.0, 35.0, 45.0, 50.0, 65.0, 80.0, 95.0)},
    "basketball_player": {"quality": (5.0, 20.0, 35.0, 50.0, 65.0, 80.0, 95.0)},
    "mitch": {"quality": (50.0, 65.0, 67.0, 69.0, 80.0)},
    **{body: {"quality": (25.0, 50.0, 75.0)} for body in REMESHED},
    "collision": {"quality": (50.0,)},
    **{body: {"quality": (50.0,)} for body in BACKWARDS},
}


def _pairs(*pairs: tuple[float, int]) -> study.Values:
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
JUDGED = (SYMMETRIC, NORMALS, study.KEYLESS)
ANCHORS = (DRACO, DECIMATED, SUBDIVIDED)
USUAL: Options = {"preset": "best", "quality": 50.0}
COLLISION = Which("collision", BEST)
NO_MORE, PAST = at_most("second_half_over_first", 1.0), Bound(SYMMETRIC.key, 70.0, "dB")


def _bounds(mbps: float, db: float, degrees: float, *more: Bound) -> tuple[Bound, ...]:
    """Return bounds of rate, D2 and normals, and some more."""
    rate, normals = at_most("mbps", mbps, "Mbps"), at_most(NORMALS.key, degrees, "degrees")
    return (rate, Bound(D2.key, db, "dB"), normals, *more)


STUDY = Study(
    title="Targets of the preset `best`",
    sequences=(*BODIES, "collision", *BACKWARDS),
    sweeps=(
        Sweep("meshreel", {}, {"preset": "best"}, on=QUALITIES),
        Sweep("meshreel", {}, {"preset": "paper", "quality": 50.0}, only=BODIES[:2]),
        Sweep("draco", {"qp": (9, 10, 11)}, on={body: {"qp": (9,)} for body in FEW}, only=BODIES),
        Sweep("decimated_draco", FINE, {"levels": 1}, on=FINE_ON, only=BODIES),
        Sweep("decimated_draco", PLAIN, {"levels": 0}, on=dict.fromkeys(FEW, PLAIN_ONE), only=BODIES),
        *(Sweep("meshreel", {}, USUAL, only=("collision",), frames=frames) for frames in (20, 60)),
    ),
    metrics="parallel views",
    measures=(SYMMETRIC, study.KEYLESS, D2, NORMALS),
    anchor=SUBDIVIDED,
    promises=(
        Reaches(
            "dancer: rate, D2, normals, SSIM without key frames (released code 5.8 Mbps at 56.4 dB)",
            Which("dancer", BEST),
            _bounds(0.34, 64.0, 5.3, Bound(study.KEYLESS.key, 0.86, "SSIM")),
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
            Always(f"{body}: bytes of frames 31 to 60 over those of 1 to 30", Which(body, BEST), NO_MORE)
            for body in (*REMESHED, *BACKWARDS)
        ),
        Always(
            "collision: decoded triangles that bridge the bodies once they are apart", COLLISION, at_most("bridges", 0)
        ),
        *(Gains(body, BEST, ANCHORS, JUDGED, -60.0, ends_past=PAST) for body in BODIES[:2]),
        Always("bodies: step of PSNR at a border of groups", Which("", BEST), at_most("border_step_db", 1.5, "dB")),
        Always("encode, dancer", Which("dancer", BEST), at_most("encode_s", 4.0, "CPU s/frame")),
        Flat(COLLISION),
        Always("decode, dancer", Which("dancer", BEST), at_most("decode_ms", 1.5, "ms")),
    ),
)

DEFAULT = 50.0  # quality
# CPU s a frame of an encode at the default quality: at most, and the aim.
LIMITS = {"dancer": (0.6, "0.4"), "prism": (0.1, ""), "gears": (1.0, ""), "basketball_player": (1.0, "0.7")}
LIMITS |= {"living_room": (0.7, ""), "mitch": (0.45, ""), "crane": (0.5, ""), "room2": (1.2, "")}
LIMITS |= {"dancer160k": (4.0, "")}
EFFICIENCY = {8: 0.97, 32: 0.95, 100: 0.95}  # of an encode of an hour of frames, at least, by workers
CORES = {4: {8: 0.8}, 60: {8: 0.8}}  # of clips of so many s, on so many cores
WORSE = {"fraction": 0.1, "qp": 10}  # a little worse than the default quality in D2
TOGETHER, OF_FOUR = WITH_CRANE, {35.0: (2.0, "1.5"), 60.0: (2.0, "1.5"), 85.0: (3.0, "")}  # by quality
LEAST = min(OF_FOUR)
# Diagonals of the boxes of ten frames, m: a quality is a step in these, and 25 of quality halve the step.
DIAGONALS = {"dancer": 2.197, "basketball_player": 2.131, "mitch": 2.284, "crane": 2.164}
DIAGONAL_OF_FOUR = 4.559
AROUND = (40.0, DEFAULT, 60.0)  # qualities, for a curve
OTHERS: dict[str, study.Values] = {TOGETHER: {"quality": tuple(OF_FOUR)}, "dancer": {"quality": AROUND}}
FAST = Which("dancer", f"{BEST}, fast", {"quality": DEFAULT})
# Qualities at which each body alone has the step, in metres, that it has among the four at the least quality.
ALONE = {body: round(LEAST - 25 * log2(DIAGONAL_OF_FOUR / own), 1) for body, own in DIAGONALS.items()}


def _which(sequence: str, quality: float = DEFAULT) -> Which:
    return Which(sequence, BEST, {"quality": quality})


EACH: dict[str, study.Values] = {body: {"quality": (quality,)} for body, quality in ALONE.items()}
DANCER, PLAIN_DRACO, DECODE = _which("dancer"), Which("dancer", f"{DECIMATED}, DracoPy"), "decode_ms_at_rest"
APART = tuple(_which(body, quality) for body, quality in ALONE.items())
SPEED = Study(
    title="Speed",
    sequences=(*LIMITS, TOGETHER),
    sweeps=(
        Sweep("meshreel", {"quality": (DEFAULT,)}, {"preset": "best"}, OTHERS),
        Sweep("meshreel", {"quality": AROUND}, {"preset": "best", "variant": "fast"}, only=("dancer",)),
        Sweep("meshreel", {"quality": (DEFAULT,)}, {"preset": "best"}, EACH, tuple(ALONE), frames=10),
        Sweep("decimated_draco", {}, WORSE, sampled=("living_room", "room2")),
        Sweep("decimated_draco", {}, WORSE | {"decoder": "DracoPy"}, only=("dancer",)),
    ),
    metrics="distances",
    measures=(D2, NORMALS),
    promises=(
        *(
            Reaches(f"{which.sequence}: encode", which, (at_most("encode_s_at_rest", limit, "CPU s/frame"),), aim)
            for which, (limit, aim) in [
                *((_which(sequence), limits) for sequence, limits in LIMITS.items()),
                *((_which(TOGETHER, quality), limits) for quality, limits in OF_FOUR.items()),
            ]
        ),
        NoMore(f"{TOGETHER}: encode against four alone", _which(TOGETHER, LEAST), "encode_s_at_rest", 1.2, APART),
        NoMore(f"{TOGETHER}: rate against four alone", _which(TOGETHER, LEAST), "mbps", 1.2, APART),
        Reaches(
            "basketball_player: frames fitted and tracked for a frame that is coded",
            _which("basketball_player"),
            (at_most("work.frames fitted", 2.5), at_most("work.frames tracked", 2.5)),
        ),
        *(
            Reaches(f"{body}: memory of an encode", _which(body), (at_most("encode_mb", 300, "MB"),))
            for body in DIAGONALS
        ),
        *(
            Reaches(
                f"dancer: efficiency of 8, 32 and 100 workers, an hour in intervals of {frames} frames (model)",
                DANCER,
                tuple(Bound(f"efficiency.{workers}.{frames}", least) for workers, least in EFFICIENCY.items()),
            )
            for frames in (60, 120)
        ),
        *(
            Reaches(
                f"dancer: efficiency of 8 cores, a clip of {seconds} s (model)",
                DANCER,
                tuple(Bound(f"cores.{count}.{seconds}", least) for count, least in leasts.items()),
            )
            for seconds, leasts in CORES.items()
        ),
        Reaches("dancer, fast: encode", FAST, (at_most("encode_s_at_rest", 0.25, "CPU s/frame"),), "0.15"),
        Gains("dancer", FAST.curve, (BEST,), (D2, NORMALS), 3.0),
        Reaches("dancer: decode", DANCER, (at_most(DECODE, 0.35, "ms"),), "0.2"),
        NoMore("dancer: decode against decimated Draco that is no better in D2", DANCER, DECODE, 1.0, (PLAIN_DRACO,)),
    ),
    frames={"crane": 60},
    notes=(
        "Times *at rest* are processor times, scaled by those of a fixed loop that runs in the same process meanwhile.",
        "Importing libraries is not counted. Work is what a frame that is coded costs in frames read, tracked and",
        "fitted, in surfaces fused and decimated, and in closest points; it depends on no machine.",
    ),
)
