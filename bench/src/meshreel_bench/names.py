"""Names of curves as rows have them (`report.values.curve_of`), their titles as papers write them, their looks."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

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
    """Return the name of a curve in legends: a variant has the title of its codec, then what it changes."""
    begin, end = f"{TUNED}, ", TSMC.removeprefix(TUNED)  # of a variant of which m is varied
    if name.startswith(begin) and name.endswith(end):
        return f"{_TITLES[TSMC]}, {name.removeprefix(begin).removesuffix(end)}"
    base = max((base for base in _TITLES if name == base or name.startswith(f"{base}, ")), key=len, default="")
    return _TITLES.get(base, "") + name[len(base) :]


@dataclass(frozen=True, slots=True)
class Look:
    """Color, marker and line of a curve."""

    color: str
    marker: str
    width: float = 1.1  # points, of the line
    size: float = 3.4  # points, of the marker


# In the order of legends and tables. Colors safe for the color-blind (Okabe and Ito) come first; codecs that are
# never in one plot may share one.
KNOWN: dict[str, Look] = {
    BEST: Look("#D55E00", "o", 2.2, 4.4),
    TEXTURED: Look("#D55E00", "o", 2.2, 4.4),
    PAINTED: Look("#E69F00", "s"),
    TUNED: Look("#E69F00", "s"),
    TSMC: Look("#A6761D", "d"),
    TVMC: Look("#009E73", "P", size=4.2),
    KLT: Look("#CC79A7", "X", size=4.2),
    NECGS: Look("#7B4EA3", "*", size=5.5),
    DRACO: Look("#0072B2", "^"),
    DECIMATED: Look("#56B4E9", "v"),
    SUBDIVIDED: Look("#1B3A5C", "D", size=2.8),
    ONCE: Look("#000000", "<"),
    ONCE_SUBDIVIDED: Look("#777777", "H"),
    MESHOPT: Look("#66A61E", "p"),
    VDMC: Look("#999999", "s", 1.6),
    VDMC_HERE: Look("#000000", "s", 1.6),
    "Draco with colours, avif": Look("#0072B2", "^"),
    "Draco with colours, av1": Look("#009E73", "P", size=4.2),
    "Draco with colours, vertices": Look("#CC79A7", "X", size=4.2),
    "a: decimated Draco": Look("#56B4E9", "v"),
    "a: decimated Draco, subdivided": Look("#1B3A5C", "D", size=2.8),
    "b: background once, decimated Draco": Look("#000000", "<"),
    "b: background once, decimated Draco, subdivided": Look("#777777", "H"),
    "b: background once, decimated Draco, labels found": Look("#8F8F1F", "x", size=4.2),
}
for _rate, _color in ((24, "#009E73"), (30, "#0072B2"), (72, "#D55E00")):
    KNOWN |= {f"level {level}, {_rate} Hz": Look(_color, marker) for level, marker in enumerate("vos")}
# For all others, by their place among the sorted names: 8 colors and 5 markers make 40 pairs.
_COLORS = ("#882255", "#6699CC", "#999933", "#332288", "#AA4499", "#661100", "#44AA99", "#66A61E")
_MARKERS = (">", "p", "<", "H", "d")


def in_order(names: Iterable[str]) -> list[str]:
    """Return each name once: known ones in the order of legends and tables, then the others sorted."""
    given = set(names)
    return [name for name in KNOWN if name in given] + sorted(given - set(KNOWN))


def looks_of(names: Iterable[str]) -> dict[str, Look]:
    """Return a look for each name, in order; unknown names get looks of their own."""
    ordered = in_order(names)
    others = enumerate(name for name in ordered if name not in KNOWN)
    rest = {name: Look(_COLORS[place % len(_COLORS)], _MARKERS[place % len(_MARKERS)]) for place, name in others}
    return {name: KNOWN.get(name) or rest[name] for name in ordered}
