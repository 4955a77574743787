"""Targets of recordings, which have no truth: a real room with a person, judged by the depth pictures behind it."""

from __future__ import annotations

from ..names import BEST, TEXTURED
from .study import D2, Always, Bound, Measure, NoMore, Promise, Reaches, Rises, Study, Sweep, Which, at_most

ROOM = "living_room"
DIAL = {10.0: 1.0, 50.0: 1.5, 90.0: 2.5}  # quality: least rate over that of the first
COVERED = Measure("body_covered", "body covered")
MEASURES = (
    COVERED,
    Measure("still_covered", "still covered"),
    Measure("all_invented", "invented", sign=-1),
    Measure("all_lost_runs", "lost runs a frame", sign=-1),
    Measure("cracks", "cracks", sign=-1),
    Measure("limbs_lost", "frames without legs", sign=-1),
    Measure("body_flicker_deg", "flicker", " degrees", -1),
    Measure("input_body_flicker_deg", "of the input", " degrees", -1),
    Measure("background_mbps", "background with its colours", " Mbps", -1),
    D2,
)


def _reaches(text: str, *bounds: Bound) -> Reaches:
    return Reaches(f"{ROOM}: {text}", Which(ROOM, TEXTURED), bounds)


def _dial(quality: float) -> Which:
    return Which(ROOM, BEST, {"quality": quality})


PROMISES: tuple[Promise, ...] = (
    _reaches("still surface covered, invented", Bound("still_covered", 0.97), at_most("still_invented", 0.005)),
    _reaches("body covered", Bound("body_covered", 0.95)),
    _reaches("frames that show the body's lower third and have not half of it", at_most("limbs_lost", 0)),
    _reaches("groups of bodies, those of Draco", Bound("group_frames", 8, "frames"), at_most("draco_groups", 0)),
    _reaches("rate, the background's share", at_most("mbps", 0.12, "Mbps"), at_most("background_mbps", 0.12, "Mbps")),
    _reaches("change of still surface between refreshes", at_most("still_flicker_m", 0, "m")),
    *(
        Always(f"{ROOM}: step of PSNR at a border of groups", Which(ROOM, curve), at_most("border_step_db", 1.5, "dB"))
        for curve in (BEST, TEXTURED)
    ),
    *(
        NoMore(f"{ROOM}: rate at quality 10 and at {quality:g}", _dial(10.0), "mbps", 1 / factor, (_dial(quality),))
        for quality, factor in list(DIAL.items())[1:]
    ),
    *(Rises(BEST, measure) for measure in (COVERED, D2)),
)
STUDY = Study(
    title="Recordings by their depth pictures",
    sequences=(ROOM,),
    sweeps=(
        Sweep("meshreel", {"quality": tuple(DIAL)}, {"preset": "best"}),
        Sweep("meshreel", {}, {"preset": "best", "quality": 50.0, "color": "texture"}),
    ),
    metrics="depth",
    measures=MEASURES,
    promises=PROMISES,
    notes=(
        "What is decoded is rendered into each depth camera: *covered* is the share of measured pixels with surface",
        "there, *invented* that with surface where the camera saw through; lost runs are missing areas over 100 cm2,",
        "cracks the share of measured pixels, those beside steps, too, in slits where nothing is decoded.",
        "Flicker: RMS change of normals on bodies from a frame to the next, after motion is taken out.",
    ),
)
