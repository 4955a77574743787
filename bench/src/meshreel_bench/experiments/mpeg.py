"""MPEG's measures on the bodies that its own conditions have: D1, D2 and IBSM, where V-DMC's sheet gives D1."""

from __future__ import annotations

from ..names import BEST
from .study import LeastRate, Measure, Study, Sweep

D1 = Measure("mpeg_d1_psnr", "D1 of MPEG", " dB", least=0.5)
POINT_TO_PLANE = Measure("mpeg_d2_psnr", "D2 of MPEG", " dB", least=0.5)
GEOMETRY = Measure("ibsm_geometry_psnr", "IBSM, geometry", " dB", least=0.5)
STUDY = Study(
    title="By MPEG's measures, beside V-DMC",
    sequences=("dancer", "basketball_player", "mitch"),
    sweeps=(
        Sweep("meshreel", {"quality": (10.0, 35.0, 60.0, 85.0, 95.0, 98.0, 99.0, 100.0)}, {"preset": "best"}),
        Sweep("draco", {"qp": (8, 9, 10)}),
        Sweep("decimated_draco", {"fraction": (0.08, 0.2, 0.5), "qp": (9, 10, 11)}),
    ),
    metrics="mpeg",
    measures=(D1, POINT_TO_PLANE, GEOMETRY),
    best=BEST,
    promises=(LeastRate(BEST, (D1, POINT_TO_PLANE, GEOMETRY)),),
    notes=(
        "Measured as mmetric does under V-DMC's conditions, but for the box, which is that of the frames here, and for",
        "pictures of 512 pixels instead of 2048, which tell the same to some tenths of a decibel. V-DMC's sheet is of",
        "300 frames with UVs, ours of ten without.",
    ),
)
