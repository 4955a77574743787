"""Table 3: splats on the decoded mesh (paper, section 4.7), with the rows of a per-frame codec and of `best`.

Splats are fitted and judged at 256 pixels; colours are those of `datasets.solid`, or the sequence's own textures.
"""

from __future__ import annotations

from ..names import PAINTED, TSMC
from ..rows import Options
from .study import Bound, Measure, Promise, Reaches, Study, Sweep, Which, at_most

PSNR, SSIM = Measure("splats_psnr", "PSNR of held-out views", " dB"), Measure("splats_ssim", "SSIM of held-out views")
MEASURES = (
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
BODIES = ("crane60", "samba60", "dancer", "textured/basketball_player")
CHAINED = f"{PAINTED}, geometry at 50"
CUT = f"{CHAINED}, keys each 1 s"
PAPER: Options = {"preset": "paper", "centers": 2000, "group_size": 10}
PROMISES: tuple[Promise, ...] = (
    Reaches(
        "crane60: held-out views of splats on `best` against the uncompressed mesh",
        Which("crane60", CUT),
        (
            Bound("splats_psnr", -0.5, "dB", over_floor=True),
            Bound("splats_ssim", -0.005, over_floor=True),
            at_most("mbps", 0.2, "Mbps"),
        ),
        "the same with -.2 dB",
    ),
    Reaches(
        "crane60: splats of `best`, their loss by coding and the time of their fit",
        Which("crane60", CUT),
        (
            at_most("splats_mbps", 1.0, "Mbps"),
            at_most("splats_lost_db", 0.1, "dB"),
            at_most("splats_fit_s", 300.0, "s"),
        ),
    ),
    Reaches(
        "crane60: held-out views of new splats in each frame, as the paper has them, on preset `paper`",
        Which("crane60", TSMC),
        (Bound("splats_own_psnr", -0.7, "dB", over_floor=True), at_most("mbps", 0.5, "Mbps")),
    ),
)
BEST: Options = {"preset": "best", "quality": 50.0, "color": "vertices", "color_quality": 10.0}
TABLE_3 = Study(
    title="Splats on the decoded mesh (table 3)",
    sequences=BODIES,
    sweeps=(
        Sweep("meshreel", {}, BEST),  # keys each 4 s
        Sweep("meshreel", {"key_interval": (1.0, 0.5)}, BEST),
        Sweep("draco", fixed={"qp": 9}),
        Sweep("meshreel", {"basis_size": (2, 10)}, PAPER),
    ),
    metrics="splats",
    measures=MEASURES,
    promises=PROMISES,
    floors=BODIES,
    notes=(
        "8,000 splats; pictures of 256 pixels, cut to the body. A mesh that is no .reel file has new splats each",
        "frame, as in the paper; those of a .reel file belong to a chain of groups, which a key begins, and are fitted",
        "to every second frame. The mesh of `best` has colours of vertices at quality 10, which its Mbps include: they",
        "hold the tracked surface in place. *Lost by coding* is by how much splats before quantisation are better.",
    ),
)
