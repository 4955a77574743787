"""Targets of colour, and table 3: splats on the decoded mesh (paper, section 4.7) of a per-frame codec and of `best`.

The person has three frames. Rates of a key in N frames are those of N frames whose later ones are like the other two.
Splats are fitted and judged at 256 pixels; colours are those of `datasets.solid`, or the sequence's own textures.
"""

from __future__ import annotations

from ..names import PAINTED, TEXTURED, TSMC
from ..rows import Options
from .study import NORMALS, Always, Bound, Measure, Needs, Promise, Reaches, Study, Sweep, Which, at_most

PERSON, ROOM, DEMO, WALKER = "textured/basketball_player", "living_room", "procedural_room", "procedural_walker"
YUV = Measure("yuv_psnr", "YUV 6:1:1, pointwise", " dB")
MEASURES = (
    YUV,
    Measure("view_y_psnr", "Y of views, silhouettes included", " dB"),
    Measure("view_y_psnr_inside", "inside", " dB"),
    Measure("view_ssim", "SSIM of views in colour"),
    Measure("pcqm", "PCQM", "", -1),
    Measure("texel_y_psnr", "Y of texels that cameras see beside the truth", " dB"),
    Measure("picture_y_psnr", "Y beside the cameras' pictures", " dB"),
    Measure("picture_still_y_psnr", "of what stands", " dB"),
    Measure("picture_moving_y_psnr", "of what moves", " dB"),
    Measure("background_near_truth", "background as it truly is, of what is seen, worst frame"),
    Measure("people_near_truth", "people as they truly are, the same"),
    Measure("dark_open_edges", "dark vertices at open edges", "", -1),
    Measure("dark_inside", "dark vertices elsewhere", "", -1),
    Measure("swimming_psnr", "the same place in successive frames", " dB"),
    Measure("texture_psnr", "successive textures", " dB"),
    NORMALS,
    Measure("color_mbps", "colours", " Mbps", -1),
    Measure("background_color_mbps", "of the background", " Mbps", -1),
    Measure("color_share", "their share", "", -1),
    Measure("mbps.120", "all, a key in 120 frames", " Mbps", -1),
    Measure("texture_mbps.120", "textures alone, a key in 120", " Mbps", -1),
    Measure("texture_mbps.32", "a key in 32", " Mbps", -1),
)
FIFTY = 50.0  # quality of geometry beside which that of colours changes
OWN, ALONE = Which(PERSON, TEXTURED), Which(PERSON, f"{TEXTURED}, geometry at {FIFTY:g}")
WALKED, AVIF = Which(WALKER, TEXTURED), "Draco with colours, avif"
GOOD, TEXELS = Bound(YUV.key, 39.8, "dB"), Bound("texel_y_psnr", 33.0, "dB")
TEXTURES, RARE = "texture_mbps.120", "the same with a key in 32"
PROMISES: tuple[Promise, ...] = (
    *(
        Needs("person: textures, key in 120 frames", ALONE, Bound(YUV.key, db, "dB"), TEXTURES, mbps, aim=RARE)
        for db, mbps in ((38.2, 0.07), (40.4, 0.18))
    ),
    Needs("person: all against AVIF and Draco with UVs", OWN, GOOD, "mbps.120", 0.05, Which(PERSON, AVIF)),
    Reaches(
        "person: geometry and colour, a key in 120 frames",
        OWN,
        (GOOD, at_most("mbps.120", 0.5, "Mbps"), at_most(NORMALS.key, 5.0, "degrees")),
        "41 dB",
    ),
    Reaches(
        "person: colours of vertices at the decoded level",
        Which(PERSON, f"{PAINTED}, geometry at {FIFTY:g}"),
        (Bound(YUV.key, 32.0, "dB"), at_most("vertices_mbps.120", 0.02, "Mbps")),
    ),
    Always("person: the same place in successive frames", OWN, Bound("swimming_psnr", 36.0, "dB")),
    Always("walker: successive textures", WALKED, Bound("texture_psnr", 36.0, "dB")),
    Reaches(
        "demo: what stands has the colours of the truth, and no dark edges",
        Which(DEMO, TEXTURED),
        (Bound("background_near_truth", 0.95), at_most("dark_open_edges", 0.015)),
    ),
    Reaches("walker, six cameras that err: texels that they see beside the truth", WALKED, (TEXELS,), "36 dB"),
    Reaches(
        "living_room: what stands still beside the camera's pictures, colours of the background",
        Which(ROOM, TEXTURED),
        (Bound("picture_still_y_psnr", 38.0, "dB"), at_most("background_color_mbps", 0.06, "Mbps")),
        "41 dB",
    ),
)
OURS: Options = {"preset": "best", "color": "texture"}
COLORS = (20.0, 35.0, 50.0, 62.0, 70.0, 80.0)
SMALL: Options = {"color": "vertices", "bits": 8}  # procedural bodies have no textures
STUDY = Study(
    title="Colour",
    sequences=(PERSON, ROOM, DEMO, WALKER),
    sweeps=(
        Sweep("meshreel", {"quality": (20.0, 35.0, 50.0, 65.0, 80.0)}, OURS | {"texture": 1024}, only=(PERSON,)),
        Sweep("meshreel", {"color_quality": COLORS}, OURS | {"texture": 1024, "quality": FIFTY}, only=(PERSON,)),
        Sweep("meshreel", {"color_quality": COLORS}, OURS | {"color": "vertices", "quality": FIFTY}, only=(PERSON,)),
        Sweep("meshreel", {"quality": (50.0, 80.0)}, OURS, only=(DEMO,)),
        Sweep("meshreel", {"quality": (35.0, 50.0)}, OURS, only=(ROOM,)),
        Sweep("meshreel", {"quality": (50.0,)}, OURS | {"texture": 1024}, only=(WALKER,)),
        Sweep("colored_draco", {"bits": (5, 8)}, {"qp": 10}, only=(PERSON,)),
        Sweep("colored_draco", {"quality": (25, 40, 60)}, {"color": "avif", "bits": 11}, only=(PERSON,), small=SMALL),
        Sweep("colored_draco", {"quality": (54, 42, 30)}, {"color": "av1", "bits": 11}, only=(PERSON,), small=SMALL),
    ),
    metrics="colors",
    measures=MEASURES,
    promises=PROMISES,
    frames={DEMO: 20},
    rate="mbps.120",
    notes=(
        "Colours of decoded surface are compared with those of the closest original points, in four parallel views",
        "without light and, where cameras took pictures, with these; of *procedural_walker*, with its true texture.",
        "Places of the demo that a camera sees are as they truly are if their colour is within 12 levels of what the",
        "true surface has within a pixel around. At open edges colours from beyond the surface would be dark.",
        "A person's rates of *a key in 120 frames* follow from three: what a chain begins with counts once.",
    ),
)

PSNR, SSIM = Measure("splats_psnr", "PSNR of held-out views", " dB"), Measure("splats_ssim", "SSIM of held-out views")
SPLAT_MEASURES = (
    PSNR,
    SSIM,
    Measure("splats_own_psnr", "PSNR with new splats in each frame", " dB"),
    Measure("splats_own_ssim", "SSIM with these"),
    Measure("splats_mbps", "splats", " Mbps", -1),
    Measure("splats_per_frame_mbps", "new splats each frame", " Mbps", -1),
    Measure("splats_spz_mbps", "as SPZ each frame", " Mbps", -1),
    Measure("splats_sog_mbps", "as SOG each frame", " Mbps", -1),
    Measure("splats_lost_db", "lost by coding", " dB", -1),
    Measure("splats_between_psnr", "PSNR in frames that were not fitted to", " dB"),
    Measure("splats_fit_s", "fit", " s", -1),
)
SPLAT_BODIES = ("crane60", "samba60", "dancer", "textured/basketball_player")
CUT = f"{PAINTED}, geometry at 50, keys each 1 s"
PAPER_PRESET: Options = {"preset": "paper", "centers": 2000, "group_size": 10}


def _less(key: str, most: float, unit: str = "") -> Bound:
    return Bound(key, -most, unit, over_floor=True)


SPLAT_PROMISES: tuple[Promise, ...] = (
    Reaches(
        "crane60: held-out views of splats on `best` against the uncompressed mesh",
        Which("crane60", CUT),
        (_less("splats_psnr", 0.5, "dB"), _less("splats_ssim", 0.005), at_most("mbps", 0.2, "Mbps")),
        "the same with -.2 dB",
    ),
    Reaches(
        "crane60: splats of `best`, their loss by coding and the time of their fit",
        Which("crane60", CUT),
        (at_most("splats_mbps", 1.0, "Mbps"), at_most("splats_lost_db", 0.1, "dB"), at_most("splats_fit_s", 300, "s")),
    ),
    Reaches(
        "crane60: held-out views of new splats in each frame, as the paper has them, on preset `paper`",
        Which("crane60", TSMC),
        (_less("splats_own_psnr", 0.7, "dB"), at_most("mbps", 0.5, "Mbps")),
    ),
)
IN_COLOUR: Options = {"preset": "best", "quality": 50.0, "color": "vertices", "color_quality": 10.0}
TABLE_3 = Study(
    title="Splats on the decoded mesh (table 3)",
    sequences=SPLAT_BODIES,
    sweeps=(
        Sweep("meshreel", {}, IN_COLOUR),  # keys each 4 s
        Sweep("meshreel", {"key_interval": (1.0, 0.5)}, IN_COLOUR),
        Sweep("draco", fixed={"qp": 9}),
        Sweep("meshreel", {"basis_size": (2, 10)}, PAPER_PRESET),
    ),
    metrics="splats",
    measures=SPLAT_MEASURES,
    promises=SPLAT_PROMISES,
    floors=SPLAT_BODIES,
    notes=(
        "8,000 splats; pictures of 256 pixels, cut to the body. A mesh that is no .reel file has new splats each",
        "frame, as in the paper; those of a .reel file belong to a chain of groups, which a key begins, and are fitted",
        "to every second frame. The mesh of `best` has colours of vertices at quality 10, which its Mbps include: they",
        "hold the tracked surface in place. *Lost by coding* is by how much splats before quantisation are better.",
    ),
)
