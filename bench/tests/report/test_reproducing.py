"""The page of the paper's numbers: what a browser that is slowed down still holds."""

from __future__ import annotations

import msgspec
from meshreel_bench.report.reproducing import reproducing_page
from meshreel_bench.rows import Point, Row, Stream

from bench.tests.made_up import row


def played(level, throttle, share, load=0.5):
    options = {"level": level, "throttle": throttle, "rate": 24}
    keys = ("decode_group_ms", "main_ms", "main_99_ms", "fps", "upload_mb_s", "triangles")
    metrics = dict.fromkeys(keys, 10.0 * throttle) | {"shown_share": share, "decode_load": load}
    point = Point("dancer", "headset", options)
    return Row(point=point, name=f"level {level}", options=options, stream=Stream(1, 1), metrics=metrics)


def test_figure_9_tells_the_strongest_throttle_below_which_all_is_held():
    rows = [played(0, 1, 1.0), played(0, 4, 0.96), played(0, 6, 0.9), played(0, 10, 1.0)]
    rows += [played(1, 1, 1.0), played(1, 4, 1.0, load=1.5), played(2, 1, 0.5), played(3, 4, 0.99), played(3, 1, 0.99)]
    page = reproducing_page({"figure6": [row("dancer", "draco", 1.0, 60)], "headset": rows})
    lines = [line for line in page if line.startswith("| dancer, ")]
    assert [line.split(" | ")[2] for line in lines] == ["4", "1", "none", "4 or more"]
    assert lines[0].split(" | ")[1:4] == ["10", "4", "10 / 40 / 60"]


def test_what_is_played_is_in_no_other_table():
    page = reproducing_page(own := {"figure6": [row("dancer", "draco", 1.0, 60)]})
    with_played = reproducing_page(own | {"headset": [played(0, 1, 1.0)]})
    assert [line for line in with_played if line not in page] == [line for line in with_played if "dancer, 0" in line]


def literal(m, mbps, db, **options):
    variant = f", {options['variant']}" if options else ""
    made = row("dancer", f"meshreel paper-literal{variant} m", mbps, db)
    return msgspec.structs.replace(
        made, options={"preset": "paper-literal", "quality": 50.0, "basis_size": m} | options
    )


def test_beside_the_released_code_stands_the_paper_as_written_with_more_centers_only_where_the_usual_are_short():
    finest = {"centers": 4000, "variant": "the release's step"}
    rows = [
        literal(3, 0.5, 52.0),
        literal(10, 1.0, 57.0),
        literal(10, 2.0, 58.0, **finest),
        literal(30, 6.0, 59.5, **finest),
    ]
    page = reproducing_page({"figure6": [row("dancer", "draco", 1.0, 60)], "ablation_paper": rows})
    shown = [line.split(" | ")[2] for line in page if line.startswith("| dancer | m = ")]
    assert [cell.partition("(")[2] for cell in shown] == [
        "m 3)",
        "m 10)",
        "m 10)",
        "m 30, 4000 centers, the release's step)",
    ]
    short = reproducing_page({"figure6": [row("dancer", "draco", 1.0, 60)], "ablation_paper": rows[:2]})
    shown = [line.split(" | ")[2] for line in short if line.startswith("| dancer | m = ")]
    assert [cell.endswith("†") for cell in shown] == [False, False, False, True]
