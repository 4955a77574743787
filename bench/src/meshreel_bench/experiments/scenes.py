"""Scenes: a room that stands still and two people in it, four simulated depth cameras, half a million faces a frame.

The noisy input is the noise floor. Anchor a is decimated Draco of whole frames, anchor b a background once and
decimated people, system c is meshreel. Everything against the noisy input and against the truth (`scene_rows`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from meshreel.metrics.bd_rate import BdRate, Curve, bd_bound, hull
from meshreel.metrics.comparison import ComparisonOptions

from ..curves import Measure, curve, value
from ..datasets.scenes import FOUND, SCENES
from ..names import BEST
from ..promises import Promise
from ..rows import Point, Row, curve_rows, select
from ..scene_rows import BACKGROUND_S, FLOOR, MEASURED_EVERY, MEMORY, NOISE_FLOOR, SCENE, SEGMENTATION
from .scenes_goals import own_goals, segmentation_goal

COMPARISON = ComparisonOptions(ssim=True)  # scenes are looked at from where their cameras stood
ROOM, STANDING = SCENES
WHOLE = ((0.2, 12), (0.1, 11), (0.05, 11), (0.02, 10), (0.01, 9))  # anchor a: share of the faces, bits
WHOLE_SUBDIVIDED = ((0.05, 11), (0.02, 10))
PEOPLE = ((0.5, 11), (0.25, 11), (0.1, 10), (0.05, 10), (0.02, 9))  # anchor b, of what moves
PEOPLE_SUBDIVIDED = ((0.1, 10), (0.02, 9))
PEOPLE_FOUND = ((0.1, 10),)
QUALITIES = (50.0, 20.0, 80.0, 35.0, 10.0, 0.0)
DEFAULT = 50.0
MESHES_ALONE = "background from meshes"  # in place of from the cameras' depth
LENGTHS = (60, 240)  # frames whose memory is compared
ANCHORS = {"a": "a: decimated Draco", "b": "b: background once, decimated Draco"}  # each with and without subdivision

D2_INPUT = Measure("input_d2_psnr_forward", "D2 to the input", " dB")
SSIM_INPUT = Measure("input_ssim_masked", "SSIM to the input", "")
D2_TRUTH = Measure("truth_d2_psnr_backward", "D2 to the truth", " dB")
SSIM_TRUTH = Measure("truth_ssim_masked", "SSIM to the truth", "")
D2_PEOPLE = Measure("input_people_d2_psnr_forward", "D2 of people to the input", " dB")
SSIM_PEOPLE = Measure("input_people_ssim_masked", "SSIM of people to the input", "")
SSIM_PEOPLE_TRUTH = Measure("truth_people_ssim_masked", "SSIM of people to the truth", "")
JUDGED = (D2_INPUT, SSIM_INPUT)
MEASURES = (*JUDGED, D2_TRUTH, SSIM_TRUTH, D2_PEOPLE, SSIM_PEOPLE, SSIM_PEOPLE_TRUTH)
# Over these a codec is nearer to the noisy input than the truth is: it codes noise.
FLOOR_OF = {
    D2_INPUT.key: "truth_d2_psnr_backward",
    SSIM_INPUT.key: "truth_ssim_masked",
    D2_PEOPLE.key: "truth_people_d2_psnr_backward",
    SSIM_PEOPLE.key: "truth_people_ssim_masked",
}
METRICS = (
    ("input_d2_psnr_forward", "D2 to the noisy input (dB)"),
    ("input_ssim_masked", "SSIM to the noisy input"),
    ("truth_d2_psnr_backward", "D2 to the truth (dB)"),
    ("truth_ssim_masked", "SSIM to the truth"),
    ("truth_people_ssim_masked", "SSIM of people to the truth"),
    ("truth_people_median_m", "people to the truth, median (m)"),
    ("truth_people_normal_error_deg", "normals of people (degrees)"),
)
GAINS = {"a": (-85.0, -90.0), "b": (-20.0, -50.0)}  # %: the target, and the figure to be proud of


def points(small: bool) -> Iterator[Point]:
    """The noise floor, both anchors, meshreel; a few of a dozen frames where `small`."""
    frames = 12 if small else None
    yield Point(ROOM, "captured", {}, frames, FLOOR)
    if small:
        yield _anchor("scene_draco", 0.1, 11, frames)
        yield _anchor("background_draco", 0.25, 11, frames)
        yield _system(DEFAULT, frames)
        return
    yield Point(STANDING, "captured", {}, None, FLOOR)
    yield from (_system(quality) for quality in QUALITIES)
    yield Point(ROOM, "meshreel", {"preset": "paper", "centers": 2000, "group_size": 10}, None, SCENE)
    yield from (Point(name, "segmentation", {"labels": FOUND}, None, SEGMENTATION) for name in SCENES)
    yield from (_anchor("background_draco", *point) for point in PEOPLE)
    yield from (_anchor("background_draco", *point, None, levels=1) for point in PEOPLE_SUBDIVIDED)
    yield from (_anchor("labelled_draco", *point, None, labels=FOUND) for point in PEOPLE_FOUND)
    yield from (_anchor("scene_draco", *point) for point in WHOLE)
    yield from (_anchor("scene_draco", *point, None, levels=1) for point in WHOLE_SUBDIVIDED)
    yield _system(DEFAULT, variant=MESHES_ALONE)
    yield from (Point(ROOM, "meshreel", {"quality": DEFAULT}, length, MEMORY) for length in LENGTHS)


def references(_sequence: str) -> dict[str, list[tuple[float, float]]]:
    """Curves that were not measured here: none."""
    return {}


def floors(rows: Sequence[Row]) -> dict[str, float]:
    """What the noisy input itself reaches, by metric, from the rows of one scene; empty where it was not measured."""
    for row in rows:
        if row["kind"] == FLOOR:
            own = {key: row.get(key) for key, _ in METRICS} | {k: row.get(source) for k, source in FLOOR_OF.items()}
            return {key: float(found) for key, found in own.items() if found is not None}
    return {}


def promises(rows: Sequence[Row]) -> list[Promise]:
    """The targets, with what the rows say."""
    found = [segmentation_goal(name, select(rows, name, kind=SEGMENTATION)) for name in SCENES]
    system = curve_rows(rows, ROOM, BEST)
    found += own_goals(system, select(rows, ROOM, kind=FLOOR), select(rows, ROOM, kind=MEMORY), DEFAULT)
    own = [row for row in rows if row["sequence"] == ROOM]
    return found + [_gain(own, anchor) for anchor in ANCHORS]


def comparisons(_rows: Sequence[Row]) -> Iterator[str]:
    """Nothing a scene: what needs the noise floor is in `sections`."""
    return iter(())


def shown(_rows: Sequence[Row]) -> list[Row]:
    """No rows in the common table: that of `sections` has all."""
    return []


def _rates(rows: Sequence[Row]) -> Iterator[str]:
    """Lines of Markdown on the rows of one scene: the noise floor, and BD-rates against both anchors."""
    floor = floors(rows)
    if floor:
        labels = dict(METRICS)
        told = ", ".join(f"{labels[key]} {number:.4g}" for key, number in floor.items() if key.startswith("truth_"))
        yield f"- {NOISE_FLOOR} (the input against the truth): {told}"
    for anchor in ANCHORS:
        for measure in MEASURES:
            for limited in (True, False) if measure.key in FLOOR_OF else (False,):
                found = _against(rows, anchor, measure, limited)
                if found is not None:
                    yield f"- BD-rate, {measure.name}{', below the noise floor' if limited else ''}: {found}"


def sections(rows: Sequence[Row]) -> Iterator[str]:
    """A table of everything against the truth, how it was measured, and BD-rates."""
    own = [row for row in rows if row["kind"] in (FLOOR, SCENE)]
    if not own:
        return
    text = f"Means over every {MEASURED_EVERY}th frame; anchors code these frames only. A background that is sent once "
    text += f"counts as sent every {BACKGROUND_S:g} s. D2: peak is the scene's diagonal; to the truth from the decoded "
    text += (
        "surface, to the input from the input's. Coverage counts what the cameras can see. SSIM: masked, from where "
    )
    yield from ("", "## Scenes against the truth", "", text + "the cameras stand.", "")
    heads = ("scene", "codec", "operating point", "Mbps", "background kB", *(name for name, _ in _COLUMNS))
    yield f"| {' | '.join(heads)} |"
    yield "|" + "---|" * len(heads)
    for row in own:
        options = ", ".join(f"{k} {v}" for k, v in row["options"].items() if v is not None)
        size = f"{row['background_bytes'] / 1000:.1f}" if row.get("background_bytes") else ""
        rate = f"{row['mbps']:.3f}" if "mbps" in row else ""
        cells = [row["sequence"], row["codec"], options, rate, size]
        yield f"| {' | '.join([*cells, *(_cell(row, key) for _, key in _COLUMNS)])} |"
    yield ""
    yield from _seams(own)
    yield from _rates([row for row in rows if row["sequence"] == ROOM])


def _seams(rows: Sequence[Row]) -> Iterator[str]:
    """Lines of Markdown on where bodies meet the background, at the default quality."""
    at_default = (row for row in rows if row["codec"] == BEST and row["options"].get("quality") == DEFAULT)
    for row in at_default:
        if row.get("seam_gap_mm_median") is None:
            continue
        gap, overlap = (f"{row[f'seam_{n}_mm_median']:.1f} ({row[f'seam_{n}_mm_95']:.1f})" for n in ("gap", "overlap"))
        text = f"- {row['sequence']}, {row['codec']}, quality {DEFAULT:g}: seam of bodies and what they touch, median "
        yield f"{text}(95 %): gap {gap} mm, overlap {overlap} mm; surface near it uncovered {row['seam_uncovered']:.2%}"


_COLUMNS = (
    ("people mm", "truth_people_median_m"),
    ("people degrees", "truth_people_normal_error_deg"),
    ("people coverage mm", "truth_people_coverage_rms_m"),
    ("people within 20 mm %", "truth_people_covered"),
    ("people SSIM", "truth_people_ssim_masked"),
    ("background mm", "truth_background_median_m"),
    ("background degrees", "truth_background_normal_error_deg"),
    ("background coverage mm", "truth_background_coverage_rms_m"),
    ("background within 20 mm %", "truth_background_covered"),
    ("all D2 dB", "truth_d2_psnr_backward"),
    ("all SSIM", "truth_ssim_masked"),
    ("D2 to the input dB", "input_d2_psnr_forward"),
    ("SSIM to the input", "input_ssim_masked"),
    ("encode s/frame", "encode_s"),
)


def _cell(row: Row, key: str) -> str:
    found = value(row, key)
    if found is None:
        return ""
    if key.endswith("_m"):
        return f"{1000 * found:.2f}"
    return f"{100 * found:.2f}" if key.endswith("covered") else f"{found:.4g}"


def _anchor(codec: str, share: float, qp: int, frames: int | None = None, **changed: Any) -> Point:
    return Point(ROOM, codec, {"share": share, "qp": qp} | changed, frames, SCENE)


def _system(quality: float, frames: int | None = None, **changed: Any) -> Point:
    return Point(ROOM, "meshreel", {"preset": "best", "quality": quality} | changed, frames, SCENE)


def _against(rows: Sequence[Row], anchor: str, measure: Measure, limited: bool) -> BdRate | None:
    """BD-rate of the system against the hull of an anchor's forms; None where either was not measured."""
    forms = [name for name in (ANCHORS[anchor], f"{ANCHORS[anchor]}, subdivided") if _of(rows, name)]
    if not forms or not _of(rows, BEST):
        return None
    highest = floors(rows).get(measure.key, float("inf")) if limited else float("inf")
    peers: list[Curve] = [curve(_of(rows, name), name, measure) for name in forms]
    return bd_bound(hull(f"anchor {anchor}", peers), curve(_of(rows, BEST), BEST, measure), highest)


def _gain(rows: Sequence[Row], anchor: str) -> Promise:
    """Whether distance and pictures to the input cost so much less; over all qualities where none is below it."""
    limit, proud = GAINS[anchor]
    text = f"{ROOM}: BD-rate against anchor {anchor} (D2 and masked SSIM to the input, below the noise floor)"
    bound, found = f"<= {limit:g} % each (aim {proud:g} %)", []
    for measure in JUDGED:
        rate = _against(rows, anchor, measure, True)
        if rate is not None and rate.percent is None:
            rate = _against(rows, anchor, measure, False)
        if rate is not None:
            found.append((measure, rate))
    if not found:
        return Promise(text, bound)
    told = "; ".join(f"{measure.name}: {rate}" for measure, rate in found)
    return Promise(text, bound, told, all(r.percent is not None and r.percent <= limit for _, r in found))


def _of(rows: Sequence[Row], codec: str) -> list[Row]:
    return [row for row in rows if row["kind"] == SCENE and row["codec"] == codec]
