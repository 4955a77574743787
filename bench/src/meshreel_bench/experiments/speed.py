"""Targets of speed: processor time of one core at rest, memory and work of encodes, and the time of a decode."""

from __future__ import annotations

from math import log2

from ..names import BEST, DECIMATED
from .study import D2, NORMALS, Bound, Gains, NoMore, Promise, Reaches, Study, Sweep, Values, Which, at_most

DEFAULT = 50.0  # quality
# CPU s a frame of an encode at the default quality: at most, and the aim.
BODY, HARD = (1.3, "1"), (2.5, "1.5")
LIMITS = {"dancer": BODY, "prism": (0.2, ""), "gears": (1.5, ""), "basketball_player": HARD, "crane": BODY}
LIMITS |= {"living_room": HARD, "mitch": BODY, "room2": HARD, "dancer160k": (6.0, "")}
EFFICIENCY = {8: 0.97, 32: 0.9, 100: 0.9}  # of an encode of an hour of frames, at least, by workers
DRACO = {"fraction": 0.1, "qp": 10}  # a little worse than the default quality in D2
TOGETHER, OF_FOUR = "synthetic4", {35.0: (5.0, "4"), 60.0: (6.0, "5"), 85.0: (7.0, "6")}  # by quality
LEAST = min(OF_FOUR)
# Diagonals of the boxes of ten frames, m: a quality is a step in these, and 25 of quality halve the step.
DIAGONALS = {"dancer": 2.197, "basketball_player": 2.131, "mitch": 2.284, "crane": 2.164}
DIAGONAL_OF_FOUR = 4.559
AROUND = (40.0, DEFAULT, 60.0)  # qualities, for a curve
OTHERS: dict[str, Values] = {TOGETHER: {"quality": tuple(OF_FOUR)}, "dancer": {"quality": AROUND}}
FAST = Which("dancer", f"{BEST}, fast", {"quality": DEFAULT})
# Qualities at which each body alone has the step, in metres, that it has among the four at the least quality.
ALONE = {body: round(LEAST - 25 * log2(DIAGONAL_OF_FOUR / own), 1) for body, own in DIAGONALS.items()}


def _which(sequence: str, quality: float = DEFAULT) -> Which:
    return Which(sequence, BEST, {"quality": quality})


APART = tuple(_which(body, quality) for body, quality in ALONE.items())
PROMISES: tuple[Promise, ...] = (
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
    *(Reaches(f"{body}: memory of an encode", _which(body), (at_most("encode_mb", 350, "MB"),)) for body in DIAGONALS),
    *(
        Reaches(
            f"dancer: efficiency of 8, 32 and 100 workers, an hour in intervals of {frames} frames (model)",
            _which("dancer"),
            tuple(Bound(f"efficiency.{workers}.{frames}", least) for workers, least in EFFICIENCY.items()),
        )
        for frames in (60, 120)
    ),
    Reaches("dancer, fast: encode", FAST, (at_most("encode_s_at_rest", 0.5, "CPU s/frame"),), "0.25"),
    Gains("dancer", FAST.curve, (BEST,), (D2, NORMALS), 3.0),
    Reaches("dancer: decode", _which("dancer"), (at_most("decode_ms_at_rest", 0.35, "ms"),), "0.2"),
    NoMore(
        "dancer: decode against decimated Draco that is no better in D2",
        _which("dancer"),
        "decode_ms_at_rest",
        1.0,
        (Which("dancer", f"{DECIMATED}, DracoPy"),),
    ),
)
STUDY = Study(
    title="Speed",
    sequences=(*LIMITS, TOGETHER),
    sweeps=(
        Sweep("meshreel", {"quality": (DEFAULT,)}, {"preset": "best"}, OTHERS),
        Sweep("meshreel", {"quality": AROUND}, {"preset": "best", "variant": "fast"}, only=("dancer",)),
        *(
            Sweep("meshreel", {}, {"preset": "best", "quality": q}, only=(body,), small={"quality": DEFAULT}, frames=10)
            for body, q in ALONE.items()
        ),
        Sweep("decimated_draco", {}, DRACO, sampled=("living_room", "room2")),
        Sweep("decimated_draco", {}, DRACO | {"decoder": "DracoPy"}, only=("dancer",)),
    ),
    metrics="distances",
    measures=(D2, NORMALS),
    promises=PROMISES,
    frames={"crane": 60},
    notes=(
        "Times *at rest* are processor times, scaled by those of a fixed loop that runs in the same process meanwhile.",
        "Importing libraries is not counted. Work is what a frame that is coded costs in frames read, tracked and",
        "fitted, in surfaces fused and decimated, and in closest points; it depends on no machine.",
    ),
)
