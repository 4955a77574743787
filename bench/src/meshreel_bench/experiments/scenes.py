"""Targets of scenes against the truth and the noisy input, four simulated depth cameras; and of a real recording.

Anchor a is decimated Draco of whole frames, anchor b a background once and decimated people, both by true labels.
"""

from __future__ import annotations

from ..datasets.rooms import SENSED
from ..names import BEST, PAINTED, TEXTURED
from ..rows import Options
from .study import D2, Always, Bound, Flat, Gains, Measure, NoMore, Reaches, Rises, Study, Sweep, Which, at_most

ROOM, STANDING, ROOM3 = "room2", "room2-standing", "room3"
LOOPED = f"{ROOM}-forth-and-back"
WHOLE = {"share": (0.2, 0.1, 0.05, 0.02, 0.01), "qp": (12, 11, 11, 10, 9)}  # anchor a: share of the faces, bits
WHOLE_SUBDIVIDED = {"share": (0.05, 0.02), "qp": (11, 10)}
PEOPLE = {"share": (0.5, 0.25, 0.1, 0.05, 0.02), "qp": (11, 11, 10, 10, 9)}  # anchor b, of what moves
PEOPLE_SUBDIVIDED = {"share": (0.1, 0.02), "qp": (10, 9)}
# Each with and without subdivision, and the change of rate against it, %.
ANCHORS = (("a: decimated Draco", -85.0), ("b: background once, decimated Draco", -20.0))
INPUT = (Measure("input_d2_psnr_forward", "D2 to the input", " dB"), Measure("input_ssim_masked", "SSIM to the input"))
SMALL, ALIKE = at_most("background_bytes", 60_000, "bytes"), Bound("truth_ssim_masked", 0.76, "SSIM")
MEASURES = (
    *INPUT,
    Measure("truth_d2_psnr_backward", "D2 to the truth", " dB"),
    Measure("truth_ssim_masked", "SSIM to the truth"),
    Measure("truth_people_ssim_masked", "SSIM of people to the truth"),
    Measure("truth_people_median_m", "people to the truth, median", " m", -1),
    Measure("truth_people_normal_error_deg", "normals of people", " degrees", -1),
)
DEFAULT = Which(ROOM, BEST, {"quality": 50.0, "variant": None}, metrics="regions")
IN_ROOM3 = Which(ROOM3, BEST, DEFAULT.options, "regions")
SYSTEM = Which(ROOM, BEST, metrics="regions")
USUAL: Options = {"preset": "best", "quality": 50.0}


def _overlaps(room: str, *bounds: Bound, aim: str = "") -> Reaches:
    return Reaches(f"{room}: segmentation, IoU of the dynamic faces", Which(room, "segmentation"), bounds, aim)


def _over_input(key: str, limit: float, unit: str = "", least: bool = False) -> Bound:
    return Bound(key, limit, unit, least, over_floor=True)


NOTES = (
    "Anchors are given the frames that are measured, and their rate is that of these. Anchor b has true labels.",
    "D2: peak is the scene's diagonal; to the truth from the decoded surface, to the input from the input's. Coverage",
    "counts what the cameras can see. SSIM: masked, from where the cameras stand.",
)
STUDY = Study(
    title="Scenes against the truth",
    sequences=(ROOM, STANDING, ROOM3, LOOPED),
    sweeps=(
        Sweep("meshreel", {"quality": (50.0, 20.0, 80.0, 35.0, 10.0, 0.0)}, {"preset": "best"}, only=(ROOM,)),
        Sweep("meshreel", {}, {"preset": "paper", "centers": 2000, "group_size": 10}, only=(ROOM,)),
        Sweep("meshreel", {}, {"preset": "best", "quality": 50.0, "variant": "background from meshes"}, only=(ROOM,)),
        Sweep("segmentation", {}, {"labels": "found"}, only=(ROOM, STANDING, ROOM3)),
        Sweep("meshreel", {}, {"preset": "best", "quality": 50.0}, only=(ROOM3,)),
        Sweep("background_draco", PEOPLE, only=(ROOM,), sampled=(ROOM,)),
        Sweep("background_draco", PEOPLE_SUBDIVIDED, {"levels": 1}, only=(ROOM,), sampled=(ROOM,)),
        Sweep("labelled_draco", {}, {"share": 0.1, "qp": 10, "labels": "found"}, only=(ROOM,), sampled=(ROOM,)),
        Sweep("scene_draco", WHOLE, only=(ROOM,), sampled=(ROOM,)),
        Sweep("scene_draco", WHOLE_SUBDIVIDED, {"levels": 1}, only=(ROOM,), sampled=(ROOM,)),
        *(Sweep("meshreel", {}, USUAL, only=(LOOPED,), frames=k, metrics="distances") for k in (60, 240)),
    ),
    metrics="regions",
    measures=MEASURES,
    best=BEST,
    promises=(
        Reaches(
            f"{ROOM}: segmentation, IoU of the dynamic faces, share of static ones called dynamic",
            Which(ROOM, "segmentation"),
            (Bound("iou_mean", 0.95), Bound("iou_worst", 0.9), at_most("static_called_dynamic", 0.002)),
            "0.98, 0.96, 0.0005",
        ),
        _overlaps(STANDING, Bound("iou_mean", 0.85), aim="0.94"),
        Reaches(
            f"{ROOM}: background: median error to the clean room, share covered within 20 mm, bytes",
            DEFAULT,
            (at_most("truth_background_median_m", 1.2e-3, "m"), Bound("truth_background_covered", 0.99), SMALL),
            "0.8 mm, 99.5 %, 40 kB",
        ),
        Reaches(
            f"{ROOM}: rate with the background once in 10 s, D2 and SSIM to the truth",
            SYSTEM,
            (at_most("mbps_background_10s", 0.8, "Mbps"), Bound("truth_d2_psnr_backward", 62.5, "dB"), ALIKE),
            "0.5 Mbps",
        ),
        Reaches(
            f"{ROOM}: people to the truth against the noisy input: median distance, normals, SSIM, coverage",
            DEFAULT,
            (
                _over_input("truth_people_median_m", 0.0, "m"),
                _over_input("truth_people_normal_error_deg", 0.0, "degrees"),
                _over_input("truth_people_ssim_masked", 0.1, "SSIM", least=True),
                _over_input("truth_people_coverage_rms_m", 1e-3, "m"),
            ),
            "2.2 mm, 16 degrees, no loss of coverage",
        ),
        _overlaps(ROOM3, Bound("iou_mean", 0.95), Bound("iou_worst", 0.92)),
        Reaches(
            f"{ROOM3}: people to the truth, share missed by 30 mm, door's bytes over theirs, until things are room",
            IN_ROOM3,
            (
                at_most("truth_people_rms_backward_m", 4.5e-3, "m"),
                at_most("truth_people_missed", 0.02),
                at_most("door_bytes_of_people", 0.2),
                at_most("crate_room_s", 1.0, "s"),
                at_most("door_room_s", 1.0, "s"),
            ),
        ),
        *(
            Reaches(
                f"{own.sequence}: flicker of people over the input's", own, (at_most("people_flicker_of_input", 0.5),)
            )
            for own in (DEFAULT, IN_ROOM3)
        ),
        Always(f"{ROOM}: encode", SYSTEM, at_most("encode_s", 6.0, "CPU s/frame")),
        Always(f"{ROOM}: decode", SYSTEM, at_most("decode_ms", 5.0, "ms")),
        Always(f"{ROOM}: first frame", SYSTEM, at_most("first_frame_ms", 200.0, "ms")),
        Flat(Which(LOOPED, BEST)),
        *(Gains(ROOM, BEST, (name, f"{name}, subdivided"), INPUT, most, below_floor=True) for name, most in ANCHORS),
    ),
    floors=(ROOM, STANDING, ROOM3),
    notes=NOTES,
)
SENSORS = Study(
    title="Sensors against the truth",
    sequences=tuple(SENSED),
    sweeps=(Sweep("meshreel", {}, {"preset": "best", "quality": 50.0}),),
    metrics="regions",
    measures=MEASURES,
    promises=tuple(
        Reaches(
            f"{name}: people to the truth against the noisy input: median distance, coverage",
            Which(name, BEST),
            (_over_input("truth_people_median_m", 0.0, "m"), _over_input("truth_people_covered", -0.005, least=True)),
        )
        for name in SENSED
    ),
    floors=tuple(SENSED),
    frames=dict.fromkeys(SENSED, 12),
    notes=(
        "Four cameras with the errors that are published of them see a room from corners, from overhead or from low",
        "down, 5 to 60 times a second.",
    ),
)

LIVING_ROOM = "living_room"
RECORDED = (Which(LIVING_ROOM, BEST), Which(LIVING_ROOM, TEXTURED))
DIAL = {10.0: 1.0, 50.0: 1.5, 90.0: 2.5}  # quality: least rate over that of the first
COVERED, STEP = Measure("body_covered", "body covered"), at_most("border_step_db", 1.5, "dB")
DEPTH_MEASURES = (
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
    return Reaches(f"{LIVING_ROOM}: {text}", RECORDED[1], bounds)


def _dial(quality: float) -> Which:
    return Which(LIVING_ROOM, BEST, {"quality": quality})


RECORDINGS = Study(
    title="Recordings by their depth pictures",
    sequences=(LIVING_ROOM,),
    sweeps=(
        Sweep("meshreel", {"quality": tuple(DIAL)}, {"preset": "best"}),
        Sweep("meshreel", {}, USUAL | {"color": "texture"}),
    ),
    metrics="depth",
    measures=DEPTH_MEASURES,
    promises=(
        _reaches("still surface covered, invented", Bound("still_covered", 0.97), at_most("still_invented", 0.005)),
        _reaches("body covered", Bound("body_covered", 0.95)),
        _reaches("frames that show the body's lower third and have not half of it", at_most("limbs_lost", 0)),
        _reaches("groups of bodies, those of Draco", Bound("group_frames", 8, "frames"), at_most("draco_groups", 0)),
        _reaches(
            "rate, the background's share", at_most("mbps", 0.12, "Mbps"), at_most("background_mbps", 0.12, "Mbps")
        ),
        _reaches("change of still surface between refreshes", at_most("still_flicker_m", 0, "m")),
        *(Always(f"{LIVING_ROOM}: step of PSNR at a border of groups", which, STEP) for which in RECORDED),
        *(
            NoMore(
                f"{LIVING_ROOM}: rate at quality 10 and at {high:g}", _dial(10.0), "mbps", 1 / factor, (_dial(high),)
            )
            for high, factor in list(DIAL.items())[1:]
        ),
        *(Rises(BEST, measure) for measure in (COVERED, D2)),
    ),
    notes=(
        "What is decoded is rendered into each depth camera: *covered* is the share of measured pixels with surface",
        "there, *invented* that with surface where the camera saw through; lost runs are missing areas over 100 cm2,",
        "cracks the share of measured pixels, those beside steps, too, in slits where nothing is decoded.",
        "Flicker: RMS change of normals on bodies from a frame to the next, after motion is taken out.",
    ),
)

LONG_ROOM, TAKES = "long_room", (300, 900, 1800)  # frames
LONG_TAKES = Study(
    title="Long takes of a room: drift, changing light, moved furniture, and visitors who come and go",
    sequences=(LONG_ROOM,),
    sweeps=tuple(Sweep("meshreel", {}, USUAL | {"color": "vertices"}, frames=count) for count in TAKES),
    metrics="distances",
    measures=(
        D2,
        Measure("tracks", "tracks", sign=-1),
        Measure("encode_mb", "memory", " MB", -1),
        Measure("background_mbps", "background with its colours", " Mbps", -1),
        Measure("bodies_mbps", "bodies with their colours", " Mbps", -1),
        Measure("color_mbps", "colours", " Mbps", -1),
    ),
    promises=(
        *(Flat(Which(LONG_ROOM, PAINTED), key=key) for key in ("encode_mb", "encode_s_at_rest")),
        Always(f"{LONG_ROOM}: a track for each visit and move", Which(LONG_ROOM, PAINTED), at_most("tracks", 21)),
    ),
    notes=("Every 120 frames somebody comes in for 90; every 600 a stool and a crate are moved; .5 % of drift.",),
)
