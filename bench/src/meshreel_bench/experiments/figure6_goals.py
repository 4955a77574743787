"""What is promised of the baselines of `figure6`: that each reaches what its authors' idea can.

In -> out: rows -> a Promise each.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from ..curves import D2_PAPER, curve, curve_of
from ..promises import Promise
from ..published import DANCER_DRACO, RELEASED_TVMC
from ..rows import Row, curve_rows

WITHIN = 0.02  # of the bytes
MONOTONE = ("tvmc", "klt_tsdf")
INVENTIVE = "necgs"  # a network that fills space may put surface anywhere
STRAYS, STRAY = "hausdorff95_backward_percent", 0.02


def goals(rows: Sequence[Row]) -> list[Promise]:
    """All of them."""
    rising = [_rises(rows, codec) for codec in MONOTONE]
    return [_draco_is_draco(rows), _tvmc_beats_its_release(rows), *rising, _invents_little(rows)]


def _draco_is_draco(rows: Sequence[Row]) -> Promise:
    """Draco's rates are those of Draco's own command."""
    text, bound = "dancer: draco needs the bytes of Draco's own encoder", f"within {100 * WITHIN:g} %"
    own = {row["options"]["qp"]: row["mbps"] for row in curve_rows(rows, "dancer", "draco")}
    ratios = {qp: own[qp] / mbps - 1 for qp, mbps in DANCER_DRACO.items() if qp in own}
    if not ratios:
        return Promise(text, bound)
    told = ", ".join(f"qp {qp}: {100 * ratio:+.1f} %" for qp, ratio in ratios.items())
    return Promise(text, bound, told, all(abs(ratio) <= WITHIN for ratio in ratios.values()))


def _tvmc_beats_its_release(rows: Sequence[Row]) -> Promise:
    """At the released code's quality, less rate."""
    wanted = RELEASED_TVMC
    text = "synthetic4: tvmc is better than its released code"
    bound = f"<= {wanted.mbps:g} Mbps at {wanted.d2_psnr:g} dB"
    own = curve_rows(rows, "synthetic4", "tvmc")
    if not own:
        return Promise(text, bound)
    good = [row for row in own if row["d2_psnr_paper"] >= wanted.d2_psnr]
    shown = min(good, key=lambda row: row["mbps"]) if good else max(own, key=lambda row: row["d2_psnr_paper"])
    met = bool(good) and shown["mbps"] <= (wanted.mbps or 0.0)
    return Promise(text, bound, f"{shown['mbps']:.2f} Mbps at {shown['d2_psnr_paper']:.2f} dB", met)


def _rises(rows: Sequence[Row], codec: str) -> Promise:
    """More rate is more quality, on every sequence."""
    text, bound = f"{codec}: quality rises with rate on every sequence", "D2, paper form"
    told, checked = list[str](), 0
    for sequence in dict.fromkeys(row["sequence"] for row in rows):
        own = [row for row in curve_rows(rows, sequence) if curve_of(row) == codec]
        points = curve(own, codec, D2_PAPER)
        rising = sorted(zip(points.rates, points.qualities, strict=True))
        checked += len(rising) > 1
        told += [f"{sequence}: {a[1]:.2f} and {b[1]:.2f} dB" for a, b in pairwise(rising) if b[1] <= a[1]]
    if not checked:
        return Promise(text, bound)
    return Promise(text, bound, "; ".join(told) or f"on {checked} sequences", not told)


def _invents_little(rows: Sequence[Row]) -> Promise:
    """D2 in the paper's form does not see surface that the input lacks."""
    text = f"{INVENTIVE}: surface that the input lacks is near it, on every sequence"
    bound = f"95 % within {100 * STRAY:g} % of the diagonal"
    own = [row for row in rows if row["codec"] == INVENTIVE and STRAYS in row]
    if not own:
        return Promise(text, bound)
    told = [
        f"{row['sequence']} at {row['mbps']:.3g} Mbps: {row[STRAYS]:.2g} %" for row in own if row[STRAYS] > 100 * STRAY
    ]
    return Promise(text, bound, "; ".join(told) or f"of {len(own)} points", not told)
