"""Ablations of TSMC as the paper has it (section 4.4), of preset `best` part by part, and trackers (section 3.1)."""

from __future__ import annotations

from ..codecs.broken import STAGES as BROKEN_STAGES
from ..codecs.meshreel import BOTH, FROM_MESHES, IN_MDS_POSE, PARTS, RELEASED, TOGETHER, UNIFORM
from ..names import BEST, LITERAL, LITERAL_FINEST, MORE_CENTERS, OURS, PUBLISHED, TSMC
from ..rows import Options
from .scenes import MEASURES
from .study import D2, MASKED, NORMALS, SYMMETRIC, TRACKER, Bound, Measure, Needs, NoMore, Reaches, Study, Sweep, Which

LITERAL_PRESET = "paper-literal"
POSES = (Measure("canonical_groups", "groups in the MDS pose"), Measure("draco_frames", "frames of Draco", sign=-1))
M = {"basis_size": (2, 5, 10)}
IN_TENS: Options = {"preset": "paper", "centers": 2000, "group_size": 10}
CENTERS = Study(
    title="Number of volume centers, TSMC",
    sequences=("dancer", "mitch"),
    sweeps=[Sweep("meshreel", M, IN_TENS | {"centers": k}) for k in (1000, 2000, 3000, 4000)],
    anchor=TSMC,
)
GOF = Study(
    title="Frames of a group, TSMC",
    sequences=("crane60", "samba60"),
    sweeps=[Sweep("meshreel", {"basis_size": (2, 3, 5)}, IN_TENS | {"group_size": size}) for size in (5, 10, 15)],
    frames={"crane60": 30, "samba60": 30},
    anchor=TSMC,
)
RELEASE = {3: (2.23, 51.87), 5: (3.29, 54.35), 10: (5.78, 56.40), 30: (15.46, 59.02)}  # its Mbps and D2, dB, by m
AT_10: Options = {"preset": "paper", "basis_size": 10}
FINEST: Options = {"preset": LITERAL_PRESET, "variant": RELEASED, "centers": MORE_CENTERS}
M_IS_10 = {name: {"basis_size": (10,)} for name in ("crane60", "procedural_room")}
PAPER = Study(
    title="The paper as written: preset `paper` put back step by step",
    sequences=("dancer", "crane60", "procedural_room"),
    sweeps=(
        Sweep("meshreel", {"basis_size": (3, 5, 10, 30)}, {"preset": "paper"}, M_IS_10),
        *(Sweep("meshreel", {}, AT_10 | {"variant": name}) for name in (UNIFORM, IN_MDS_POSE, BOTH)),
        Sweep("meshreel", {"basis_size": (3, 5, 10, 30)}, {"preset": LITERAL_PRESET}, M_IS_10),
        Sweep("meshreel", {}, {"preset": LITERAL_PRESET, "basis_size": 10, "variant": RELEASED}),
        Sweep("meshreel", {"basis_size": (10, 30)}, FINEST, only=("dancer",)),
    ),
    measures=(D2, MASKED, SYMMETRIC, NORMALS, *POSES),
    frames={"crane60": 30, "procedural_room": 30},
    promises=tuple(
        Needs(
            f"dancer, m = {m}: as written{', with more centers and its step' if m == 30 else ''}, "
            "less rate than the released code at its D2",
            Which("dancer", LITERAL_FINEST if m == 30 else LITERAL),
            Bound("d2_psnr_paper", quality, "dB"),
            "mbps",
            mbps,
        )
        for m, (mbps, quality) in RELEASE.items()
    ),
    notes=(
        "`paper-literal` is as near to the paper's text as is known: the MDS pose, groups of ten frames without cuts,",
        "one step for all components, plain rounding; the surface through all frames is Poisson's, and a vertex is",
        "displaced to the nearest of the frame's, as the release does. Pose with cuts, and step with rounding, are put",
        "back on their own; surface and displacement come together in `paper-literal`. Nearest vertices are its limit",
        f"at m = 30: more centers, {MORE_CENTERS}, predict better where they are, and {RELEASED} codes them finely.",
    ),
)
LONG = "crane60"  # groups alone show only where there are several
WHOLE = {"preset": "best"}
AROUND = {"quality": (20.0, 50.0, 80.0)}  # the whole's curve reaches around every variant's
QUALITIES = {"quality": (35.0, 65.0)}
STAGES = Study(
    title="Preset `best` with one of its improvements over `paper` switched off at a time",
    sequences=("dancer", LONG),
    sweeps=(
        Sweep("meshreel", AROUND, WHOLE),
        *(Sweep("meshreel", QUALITIES, WHOLE | {"variant": part}, only=("dancer",)) for part in PARTS),
        Sweep("meshreel", QUALITIES, WHOLE | {"variant": "groups alone"}, only=(LONG,)),
    ),
    anchor=BEST,
    frames={LONG: 32},
    notes=("Positive: without the part more rate is needed.",),
)
BROKEN = Study(
    title="Stages that are broken on purpose: the encoder must catch each, and deliver what covers the frames",
    sequences=("dancer", "mitch", "crane60", "prism"),
    sweeps=(Sweep("meshreel", {"variant": tuple(BROKEN_STAGES)}, {"preset": "best", "quality": 50.0}),),
    frames=dict.fromkeys(("dancer", "mitch", "crane60", "prism"), 8),
    measures=(D2, Measure("covered_worst", "covered, worst frame")),
    promises=tuple(
        Reaches(f"{name}: a stage that {stage}", Which(name, f"{BEST}, {stage}"), (Bound("covered_worst", 0.98),))
        for name in ("dancer", "mitch", "crane60", "prism")
        for stage in BROKEN_STAGES
    ),
)
SCENE = Study(
    title="A scene: one sequence of all that moves against a track a body, and a background from meshes against depth",
    sequences=("room2",),
    sweeps=(
        Sweep("meshreel", AROUND, WHOLE),
        *(Sweep("meshreel", QUALITIES, WHOLE | {"variant": part}) for part in (TOGETHER, FROM_MESHES)),
    ),
    metrics="regions",
    measures=MEASURES,
    anchor=BEST,
    frames={"room2": 30},
)
CAPTURED = ("crane", "samba")
TURNING = ("gears", "prism")
TRACKERS = Study(
    title="Volume tracking against known motion",
    sequences=(*CAPTURED, *TURNING),
    sweeps=(Sweep(TRACKER, {"method": (OURS, PUBLISHED)}),),
    frames=dict.fromkeys(CAPTURED, 30) | dict.fromkeys(TURNING, 10),
    promises=tuple(
        NoMore(
            f"{name}: distance of centers from the true motion against the published energy's",
            Which(name, TRACKER, {"method": OURS}),
            "center_rms_mm",
            1.0,
            (Which(name, TRACKER, {"method": PUBLISHED}),),
        )
        for name in (*CAPTURED, *TURNING)
    ),
    notes=(
        "Centers of the first frame are the same for both. The true motion of one is that of the surface around it, as",
        "rigid as it can be; `truth_rms_mm` is by how much that differs with the number of vertices it is taken from.",
    ),
)
