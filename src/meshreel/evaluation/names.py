"""Names of curves, as rows have them, as papers write them, and as files may have them.

In -> out: the name of a curve -> its title; any name -> that of a file. The name of a curve is its codec's `name`, with
more behind it where a basis is fixed (`curves.curve_of`).
"""

from __future__ import annotations

import hashlib
import re

BEST = "meshreel best"
TSMC = "meshreel paper m, quality 50"  # as the paper has it: the number of basis vectors is varied
TVMC, DRACO, KLT, NECGS = "tvmc", "draco", "klt_tsdf", "necgs"
DECIMATED, SUBDIVIDED = "decimated_draco", "decimated_draco_subdivided"
ONCE, ONCE_SUBDIVIDED = "background_once_draco", "background_once_draco_subdivided"

_TITLES = {
    TSMC: "TSMC (meshreel paper)",
    TVMC: "TVMC*",
    DRACO: "Draco",
    KLT: "KLT on TSDF",
    NECGS: "NeCGS",
    DECIMATED: "Draco, decimated",
    SUBDIVIDED: "Draco, decimated, subdivided",
    ONCE: "background once, Draco",
    ONCE_SUBDIVIDED: "background once, Draco, subdivided",
}


def title(name: str) -> str:
    """What a legend calls a curve."""
    return _TITLES.get(name, name)


def file_name(name: str) -> str:
    """A name as that of a file anywhere; two names never make one."""
    plain = re.sub(r"[^A-Za-z0-9._-]", "_", name)
    return plain if plain == name else f"{plain}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
