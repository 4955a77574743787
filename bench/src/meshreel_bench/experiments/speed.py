"""Targets of speed: processor time, memory and work of encodes, and the time of a decode.

Times are those of one core of a machine at rest: each is scaled by a fixed loop that runs beside it, in its process.
"""

from __future__ import annotations

from math import log2

from ..names import BEST, DECIMATED
from .study import D2, NORMALS, Bound, NoMore, Promise, Reaches, Study, Sweep, Values, Which

TOGETHER, APART = "synthetic4", ("dancer", "basketball_player", "mitch", "crane")
BODIES = ("dancer", "mitch", "crane", "basketball_player")
SEQUENCES = ("dancer", "prism", "gears", "basketball_player", "crane", "living_room", "mitch", "room2", TOGETHER)
LARGE = "dancer160k"
DEFAULT = 50.0  # quality
OF_FOUR = (35.0, 60.0, 85.0)  # qualities
# Diagonals of the boxes of ten frames, m: a quality is a step in these, and a halving of the step is 25 of quality.
DIAGONALS = {TOGETHER: 4.559, "dancer": 2.197, "basketball_player": 2.131, "mitch": 2.284, "crane": 2.164}
# Qualities at which each body alone has the step, in metres, that it has among the four at their first quality.
ALONE = {body: round(OF_FOUR[0] - 25 * log2(DIAGONALS[TOGETHER] / DIAGONALS[body]), 1) for body in APART}
ON: dict[str, Values] = {TOGETHER: {"quality": OF_FOUR}}
# CPU s a frame: at most, and the aim.
LIMITS = {
    "dancer": (1.3, 1.0),
    "mitch": (1.3, 1.0),
    "crane": (1.3, 1.0),
    "basketball_player": (2.5, 1.5),
    "room2": (2.5, 1.5),
    "living_room": (2.5, 1.5),
    "gears": (1.5, None),
    "prism": (0.2, None),
    LARGE: (6.0, None),
}
SMALL = {"quality": DEFAULT}  # one point in all
LIMITS_OF_FOUR = dict(zip(OF_FOUR, ((5.0, 4.0), (6.0, 5.0), (7.0, 6.0)), strict=True))


def _which(sequence: str, quality: float = DEFAULT) -> Which:
    return Which(sequence, BEST, {"quality": quality})


def _most(key: str, limit: float, unit: str = "") -> Bound:
    return Bound(key, limit, unit, least=False)


def _encode(sequence: str, quality: float, limit: float, aim: float | None) -> Promise:
    bound = _most("encode_s_at_rest", limit, "CPU s/frame")
    text = f"{sequence}, quality {quality:g}: encode"
    return Reaches(text, _which(sequence, quality), (bound,), "" if aim is None else f"{aim:g}")


PROMISES: tuple[Promise, ...] = (
    *(_encode(sequence, DEFAULT, *limit) for sequence, limit in LIMITS.items()),
    *(_encode(TOGETHER, quality, *limit) for quality, limit in LIMITS_OF_FOUR.items()),
    Reaches(
        "basketball_player: frames fitted and tracked for a frame that is coded",
        _which("basketball_player"),
        (_most("work.frames fitted", 2.5), _most("work.frames tracked", 2.5)),
    ),
    *(
        NoMore(f"{TOGETHER}: {name} against the four bodies alone", _which(TOGETHER, OF_FOUR[0]), key, 1.2, of)
        for of in [tuple(_which(body, ALONE[body]) for body in APART)]
        for name, key in (("encode", "encode_s_at_rest"), ("rate", "mbps"))
    ),
    *(Reaches(f"{body}: memory of an encode", _which(body), (_most("encode_mb", 350, "MB"),)) for body in BODIES),
    Reaches("dancer: decode", _which("dancer"), (_most("decode_ms_at_rest", 0.35, "ms"),), "0.2"),
    NoMore(
        "dancer: decode against decimated Draco that is no better in D2",
        _which("dancer"),
        "decode_ms_at_rest",
        1.0,
        (Which("dancer", DECIMATED, {"fraction": 0.1}),),
    ),
)
NOTES = (
    "Times *at rest* are processor times, scaled by those of a fixed loop that runs in the same process meanwhile.",
    "Importing libraries is not counted. Work is what a frame that is coded costs in frames read, tracked and fitted,",
    "in surfaces fused and decimated, and in closest points; it depends on no machine.",
)
STUDY = Study(
    title="Speed",
    sequences=(*SEQUENCES, LARGE),
    sweeps=(
        Sweep("meshreel", {"quality": (DEFAULT,)}, {"preset": "best"}, ON),
        *(
            Sweep("meshreel", {}, {"preset": "best", "quality": quality}, only=(body,), small=SMALL, frames=10)
            for body, quality in ALONE.items()
        ),
        Sweep("decimated_draco", {"fraction": (0.1,), "qp": (10,)}, sampled=("living_room", "room2")),
    ),
    metrics="distances",
    measures=(D2, NORMALS),
    promises=PROMISES,
    frames={"crane": 60},
    notes=NOTES,
)
