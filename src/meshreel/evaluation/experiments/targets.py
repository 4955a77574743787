"""The first experiment: meshreel's preset `paper` against the anchors on captured performers, ten frames each.

Declares which codecs run at which operating points on which sequences, and what is promised of the rows.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

Point = tuple[str, str, dict[str, Any]]  # sequence, kind of codec, operating point

BODIES = ("dancer", "basketball_player", "mitch")
FRAMES = {"dancer": 10, "basketball_player": 10, "mitch": 10, "collision": 60}
BASIS_SIZES = (3, 5, 10, 30)
QUALITIES = (20.0, 35.0, 50.0, 65.0, 80.0)


def points(small: bool) -> Iterator[Point]:
    """All operating points; a handful where `small`."""
    qualities = (50.0,) if small else QUALITIES
    for body in ("dancer",) if small else BODIES:
        for qp in (9,) if small else (7, 8, 9, 10):
            yield body, "draco", {"qp": qp}
        for fraction, qp in ((0.15, 9),) if small else ((0.04, 8), (0.08, 9), (0.15, 9), (0.25, 10), (0.5, 10)):
            for levels in (0, 1):
                yield body, "decimated_draco", {"fraction": fraction, "qp": qp, "levels": levels}
        for quality in qualities:
            yield body, "meshreel", {"quality": quality}
    for m in (10,) if small else BASIS_SIZES:
        yield "dancer", "meshreel", {"basis_size": m}
    if not small:
        yield "collision", "meshreel", {"quality": 50.0}
