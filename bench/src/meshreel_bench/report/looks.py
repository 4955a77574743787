"""Look of each curve in plots, and order of curves in tables."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from ..names import (
    BEST,
    DECIMATED,
    DRACO,
    KLT,
    MESHOPT,
    NECGS,
    ONCE,
    ONCE_SUBDIVIDED,
    PAINTED,
    SUBDIVIDED,
    TEXTURED,
    TSMC,
    TVMC,
    VDMC,
    VDMC_HERE,
)


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
    "meshreel paper": Look("#E69F00", "s"),
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
    **{
        f"level {level}, {rate} Hz": Look(color, marker)
        for rate, color in ((24, "#009E73"), (30, "#0072B2"), (72, "#D55E00"))
        for level, marker in enumerate("vos")
    },
}
# For all others, by their place among the sorted names: 8 colors and 5 markers make 40 pairs.
_COLORS = ("#882255", "#6699CC", "#999933", "#332288", "#AA4499", "#661100", "#44AA99", "#66A61E")
_MARKERS = (">", "p", "<", "H", "d")


def in_order(names: Iterable[str]) -> list[str]:
    """Return each name once: those that are known in their order, then the others sorted."""
    found = set(names)
    return [name for name in KNOWN if name in found] + sorted(found - set(KNOWN))


def looks_of(names: Iterable[str]) -> dict[str, Look]:
    """Return a look for each name, in order; names that are not known get looks of their own."""
    ordered = in_order(names)
    others = [name for name in ordered if name not in KNOWN]
    rest = {
        name: Look(_COLORS[place % len(_COLORS)], _MARKERS[place % len(_MARKERS)]) for place, name in enumerate(others)
    }
    return {name: KNOWN.get(name) or rest[name] for name in ordered}
