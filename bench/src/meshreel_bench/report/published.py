"""Numbers published by others, or measured of their released code, beside which ours stand.

Each table says where it is from. Nothing here was measured by this package.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..names import DRACO, KLT, NECGS, TSMC, TVMC


@dataclass(frozen=True, slots=True)
class Published:
    """Numbers of a system; None: not published."""

    system: str  # as the source has it
    codec: str  # the curve of ours that stands beside it
    d2_psnr: float  # dB
    ssim: float | None  # whole pictures, four views
    decode_ms: float | None  # a frame
    mbps: float | None


# TSMC, table 1: mean of four captured scenes, 13.73 % of the vertices dynamic, "under similar bitrates" (not given).
TABLE_1 = (
    Published("TSMC", TSMC, 53.48, 0.8949, 34.50, None),
    Published("TVMC*", TVMC, 53.84, 0.8585, 10.78, None),
    Published("Draco", DRACO, 26.43, 0.7915, 13.25, None),
    Published("KLT", KLT, 37.27, 0.8174, 95.43, None),
    Published("NeCGS", NECGS, 38.85, 0.8191, 69.95, None),
)
# TSMC, table 2: Synthetic, four people side by side, 300 frames.
TABLE_2 = (
    Published("TSMC", TSMC, 63.472, 0.9416, 66.04, 8.72),
    Published("TVMC*", TVMC, 60.385, 0.8820, 36.46, 9.847),
    Published("Draco", DRACO, 57.597, 0.8990, 9.10, 14.487),
    Published("KLT", KLT, 61.450, 0.9424, 24.70, 10.737),
    Published("NeCGS", NECGS, 61.739, 0.9340, 6.89, 6.931),
)
# The code that TSMC's authors released, run on one group of 10 frames, 2000 centers, by its number of basis vectors.
# Of the second one it is known that it has four people, not which.
RELEASED = {
    "dancer": (
        Published("m = 3", TSMC, 51.87, 0.9609, None, 2.23),
        Published("m = 5", TSMC, 54.35, 0.9681, None, 3.29),
        Published("m = 10", TSMC, 56.40, 0.9735, None, 5.78),
        Published("m = 30", TSMC, 59.02, 0.9770, None, 15.46),
    ),
    "synthetic4": (
        Published("m = 3", TSMC, 60.34, 0.9734, None, 6.72),
        Published("m = 5", TSMC, 61.69, 0.9764, None, 10.23),
        Published("m = 10", TSMC, 65.58, 0.9822, None, 18.48),
        Published("m = 30", TSMC, 68.35, 0.9841, None, 48.92),
    ),
}
RELEASED_TVMC = Published("TVMC*, released code", TVMC, 68.3, None, None, 25.0)  # on four people, 10 frames
# Draco, compression level 7, every frame on its own, on dancer: bits and bytes as Mbps.
DANCER_DRACO = {7: 3.99, 8: 4.87, 9: 6.13}
