"""The targets of the experiment `scenes` that the system's own rows decide, with the figures to be proud of.

In -> out: rows of one codec on one scene, and the noise floor's -> a Promise each.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..bounds import Bound, bounds_text, judge
from ..promises import Promise, flat_memory, of_row, of_rows
from ..rows import Row

SEGMENTATION = {"room2": ((0.95, 0.98), (0.90, 0.96)), "room2-standing": ((0.85, 0.94), None)}  # IoU: mean, worst
STATIC_CALLED_DYNAMIC = (0.002, 0.0005)
BACKGROUND_MEDIAN = (1.2e-3, 0.8e-3)  # m
BACKGROUND_COVERED = (0.99, 0.995)
BACKGROUND_BYTES = (60_000, 40_000)
STREAM = (
    Bound("mbps", 0.8, "Mbps", least=False),
    Bound("truth_d2_psnr_backward", 62.5, "dB"),
    Bound("truth_ssim_masked", 0.76, "SSIM"),
)
PROUD_MBPS = 0.5
SSIM_GAIN = 0.1
COVERAGE_LOSS = 1e-3  # m
ENCODE_S, FRAME_MS, FIRST_MS = 6.0, 5.0, 200.0


def segmentation_goal(scene: str, rows: Sequence[Row]) -> Promise:
    """IoU of the dynamic faces, and the static ones that are called dynamic."""
    (mean, proud_mean), worst = SEGMENTATION[scene]
    parts = [f"mean >= {mean:g} (aim {proud_mean:g})"]
    if worst is not None:
        parts.append(f"worst frame >= {worst[0]:g} ({worst[1]:g})")
        parts.append(f"static called dynamic <= {STATIC_CALLED_DYNAMIC[0]:.2%} ({STATIC_CALLED_DYNAMIC[1]:.2%})")

    def measure(row: Row) -> tuple[str, bool]:
        kept = row["iou_mean"] >= mean
        if worst is not None:
            kept &= row["iou_worst"] >= worst[0] and row["static_called_dynamic"] <= STATIC_CALLED_DYNAMIC[0]
        told = f"mean {row['iou_mean']:.3f}, worst frame {row['iou_worst']:.3f}"
        return f"{told}, static called dynamic {row['static_called_dynamic']:.2%}", kept

    text = f"{scene}: segmentation, IoU of the dynamic faces"
    return of_row(text, ", ".join(parts), rows[0] if rows else None, measure)


def own_goals(system: Sequence[Row], floor: Sequence[Row], memory: Sequence[Row], quality: float) -> list[Promise]:
    """Background, stream, people, times and memory; people and background at the quality that is the default."""
    default = next((row for row in system if row["options"].get("quality") == quality), None)
    return [
        _background(default),
        _stream(system),
        *_people(default, floor[0] if floor else None),
        _encoding(system),
        _decoding(system),
        flat_memory(memory, "room2, forth and back"),
    ]


def _background(row: Row | None) -> Promise:
    def measure(row: Row) -> tuple[str, bool]:
        median, covered, size = (
            row[k] for k in ("truth_background_median_m", "truth_background_covered", "background_bytes")
        )
        kept = median <= BACKGROUND_MEDIAN[0] and covered >= BACKGROUND_COVERED[0] and 0 < size <= BACKGROUND_BYTES[0]
        return f"{1000 * median:.2f} mm, {covered:.2%}, {size / 1000:.1f} kB", kept

    bound = f"<= {1000 * BACKGROUND_MEDIAN[0]:g} mm (aim {1000 * BACKGROUND_MEDIAN[1]:g}), "
    bound += f">= {BACKGROUND_COVERED[0]:.0%} ({BACKGROUND_COVERED[1]:.1%}), "
    bound += f"<= {BACKGROUND_BYTES[0] / 1000:g} kB ({BACKGROUND_BYTES[1] / 1000:g})"
    return of_row("room2: background: median error to the clean room, covered within 20 mm, bytes", bound, row, measure)


def _stream(rows: Sequence[Row]) -> Promise:
    bound = f"{bounds_text(STREAM)} (aim {PROUD_MBPS:g} Mbps)"
    text = "room2: rate with the background once in 10 s, D2 and SSIM to the truth"
    return of_rows(text, bound, rows, lambda found: judge(found, STREAM))


def _people(row: Row | None, floor: Row | None) -> list[Promise]:
    def accuracy(row: Row) -> tuple[str, bool]:
        names = ("truth_people_median_m", "truth_people_normal_error_deg")
        told = [(row[name], floor[name]) for name in names] if floor else []
        text = f"{1000 * told[0][0]:.2f} mm of {1000 * told[0][1]:.2f}, {told[1][0]:.2f} degrees of {told[1][1]:.2f}"
        return text, all(own < before for own, before in told)

    def pictures(row: Row) -> tuple[str, bool]:
        own, before = (r["truth_people_ssim_masked"] for r in (row, floor or row))
        return f"{own:.3f} of {before:.3f}", own >= before + SSIM_GAIN

    def coverage(row: Row) -> tuple[str, bool]:
        own, before = (r["truth_people_coverage_rms_m"] for r in (row, floor or row))
        return f"{1000 * own:.2f} mm of {1000 * before:.2f}", own <= before + COVERAGE_LOSS

    known = row if floor is not None else None
    better = "better than the input's (aim 2.2 mm, 16 degrees)"
    return [
        of_row("room2: people to the truth, median distance and normal error", better, known, accuracy),
        of_row("room2: people to the truth, SSIM", f">= the input's + {SSIM_GAIN:g}", known, pictures),
        of_row("room2: people's coverage of the truth, RMS", "<= the input's + 1 mm (aim no loss)", known, coverage),
    ]


def _encoding(rows: Sequence[Row]) -> Promise:
    def measure(rows: Sequence[Row]) -> tuple[str, bool]:
        slow = max(row["encode_s"] for row in rows)
        return f"{min(row['encode_s'] for row in rows):.2f} to {slow:.2f}", slow <= ENCODE_S

    return of_rows("room2: encode, slowest point", f"<= {ENCODE_S:g} CPU s/frame", rows, measure)


def _decoding(rows: Sequence[Row]) -> Promise:
    def measure(rows: Sequence[Row]) -> tuple[str, bool]:
        frame, first = (max(row["decode"][name] for row in rows) for name in ("frame_ms", "first_frame_ms"))
        return f"{frame:.2f} ms, first frame {first:.0f} ms", frame <= FRAME_MS and first <= FIRST_MS

    bound = f"<= {FRAME_MS:g} ms a frame, first frame <= {FIRST_MS:g} ms"
    return of_rows("room2: decode, steady state, slowest point", bound, rows, measure)
