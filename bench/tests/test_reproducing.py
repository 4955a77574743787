"""The page that has the paper's numbers beside ours: every number is of a row or of a source."""

from __future__ import annotations

from meshreel_bench.published import TABLE_2
from meshreel_bench.reproducing import reproducing_page


def row(sequence, codec, mbps, db, **options):
    base = {"sequence": sequence, "codec": codec, "kind": "rated", "mbps": mbps, "d2_psnr_paper": db, "ssim": db / 100}
    told = {"options": options, "decode": {"frame_ms": 2.0}, "experiment": "figure6"}
    return base | told | {"point": f"{sequence} {codec} {mbps}"}


def lines_of(rows):
    return {line.split("|")[1].strip(): line for line in reproducing_page(rows) if line.startswith("|")}


def test_without_rows_there_is_no_page():
    assert reproducing_page([]) == []
    assert reproducing_page([row("dancer", "draco", 1.0, 60) | {"experiment": "layers"}]) == []


def test_what_is_not_measured_is_told_as_that():
    found = lines_of([row("dancer", "meshreel best", 0.3, 65)])
    assert (
        found["KLT (`klt_tsdf`)"].endswith("| not measured |")
        and f"{TABLE_2[3].d2_psnr:.2f}" in found["KLT (`klt_tsdf`)"]
    )
    assert "0.3 Mbps, 65.00 dB, SSIM 0.650, 2.0 ms" in "\n".join(
        reproducing_page([row("dancer", "meshreel best", 0.3, 65)])
    )


def test_ours_is_the_cheapest_point_that_is_as_good():
    rows = [row("synthetic4", "tvmc", mbps, db) for mbps, db in ((1.0, 59), (2.0, 61), (4.0, 66), (9.0, 69))]
    page = "\n".join(reproducing_page(rows))
    assert "| TVMC* (`tvmc`) | 9.847 Mbps, 60.38 dB, SSIM 0.882, 36.5 ms | 2 Mbps, 61.00 dB" in page
    assert "| synthetic4 | TVMC*, released code: 25 Mbps, 68.3 dB | 9 Mbps, 69.00 dB" in page
    page = "\n".join(reproducing_page(rows[:1]))
    assert "| 1 Mbps, 59.00 dB" in page  # its best one


def test_on_scenes_points_stand_beside_the_best_of_ours():
    rows = [row("room2", "meshreel best", 0.3, 55), row("room2", "draco", 8.0, 50), row("room2", "draco", 12.0, 56)]
    found = [line for line in reproducing_page(rows) if line.startswith("| Draco") and "26.43" in line]
    assert len(found) == 1 and "12 Mbps, 56.00 dB" in found[0]
    flat = [row("room2", "tvmc", 1.0, 54.95), row("room2", "tvmc", 9.0, 55.1)]  # the dearer one is no better
    assert "1 Mbps, 54.95 dB" in "\n".join(reproducing_page([*rows, *flat]))
    assert any(line.startswith("| system | paper | here, room2 |") for line in reproducing_page(rows))


def test_tsmc_has_two_curves_and_says_where_it_is_set_to():
    varied = row("synthetic4", "meshreel paper m", 3.0, 64, preset="paper", basis_size=10, quality=50.0)
    tuned = row("synthetic4", "meshreel paper", 2.0, 65, preset="paper", quality=20.0)
    assert "(m 10)" in "\n".join(reproducing_page([varied]))
    page = "\n".join(reproducing_page([varied, tuned]))
    assert "2 Mbps, 65.00 dB, SSIM 0.650, 2.0 ms (quality 20)" in page and "(m 10)" not in page


def test_without_a_sequence_of_the_paper_there_is_no_page():
    assert reproducing_page([row("demo", "meshreel best", 0.3, 65)]) == []
    assert reproducing_page([row("room2", "meshreel best", 0.3, 65)]) != []
