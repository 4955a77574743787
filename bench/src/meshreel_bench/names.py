"""Names of curves as rows have them (`report.values.curve_of`), and as papers write them."""

from __future__ import annotations

BEST = "meshreel best"
TEXTURED, PAINTED = f"{BEST}, texture", f"{BEST}, vertices"  # in colour
TSMC = "meshreel paper m, quality 50"  # as the paper has it: the number of basis vectors is varied
TUNED = "meshreel paper"  # the same system, the quality varied and the basis chosen by it: spares what m alone cannot
LITERAL = "meshreel paper-literal m, quality 50"  # the same system as near to the text as is known
MORE_CENTERS = 4000  # twice the usual: where they are few, limbs far from the key frame's snap to other vertices
LITERAL_FINEST = f"meshreel paper-literal, the release's step m, quality 50, centers {MORE_CENTERS}"  # and finer yet
TVMC, DRACO, KLT, NECGS, NECGS_FULL = "tvmc", "draco", "klt_tsdf", "necgs", "necgs_full"
DECIMATED, SUBDIVIDED = "decimated_draco", "decimated_draco_subdivided"
ONCE, ONCE_SUBDIVIDED = "background_once_draco", "background_once_draco_subdivided"
MESHOPT = "meshoptimizer"
FLOOR_RATIO = "dynamic_ratio"  # metric of the truth itself: share of the vertices of what moves
FOUND_NAME = "what is found to move"  # the row of a recording in the place of its truth
VDMC, VDMC_HERE = "vdmc", "vdmc on our frames"  # of others: only in plots
OURS, PUBLISHED = "ours", "published"  # trackers of volumes
USUAL = {"centers": 2000, "group_size": 10}  # the paper's own

_TITLES = {
    TSMC: "TSMC (meshreel paper, m varied)",
    TUNED: "TSMC (meshreel paper, quality varied)",
    LITERAL: "TSMC (meshreel paper-literal, m varied)",
    TVMC: "TVMC*",
    DRACO: "Draco",
    KLT: "KLT on TSDF",
    NECGS: "NeCGS (small configuration)",
    NECGS_FULL: "NeCGS (its authors' configuration)",
    DECIMATED: "Draco, decimated",
    SUBDIVIDED: "Draco, decimated, subdivided",
    ONCE: "background once, Draco",
    ONCE_SUBDIVIDED: "background once, Draco, subdivided",
    VDMC: "V-DMC TM4, its own sheet (300 frames, with UVs)",
    VDMC_HERE: "V-DMC TM4, our ten frames (with UVs)",
}


def title(name: str) -> str:
    """Return the title of a curve in legends; that of a variant is its base's title and its change."""
    begin, end = f"{TUNED}, ", TSMC.removeprefix(TUNED)  # of a variant of which m is varied
    if name.startswith(begin) and name.endswith(end):
        return f"{_TITLES[TSMC]}, {name.removeprefix(begin).removesuffix(end)}"
    known = [base for base in _TITLES if name == base or name.startswith(f"{base}, ")]
    if not known:
        return name
    base = max(known, key=len)
    return _TITLES[base] + name[len(base) :]
