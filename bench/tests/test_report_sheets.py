"""Sheets of pictures: which rows have a place, where the box is, and what is drawn."""

from __future__ import annotations

import zlib
from itertools import combinations

import numpy as np
import pytest
from meshreel_bench.names import BEST
from meshreel_bench.report import write_report
from meshreel_bench.report.boxes import cut_out, detail_box, is_covered, layout_of
from meshreel_bench.report.plots import WIDTH, matplotlib_settings
from meshreel_bench.report.sheets import draw_sheet, find_shots, sheet_figure
from meshreel_bench.report.tables import DAGGER
from PIL import Image

from bench.tests.report_rows import SIZE, body, experiment, pictured, row, save
from meshreel.metrics.render import Window

CODECS = ("draco", BEST, "somebody's codec with a long name")


@pytest.fixture
def shots(tmp_path):
    """Pictures of three codecs at three rates each; rows in the order of rates."""
    folder = tmp_path / "rows.pictures"
    return folder, [
        pictured(folder, row("dancer", codec, mbps, 60 + mbps)) for mbps in (0.5, 1.0, 8.0) for codec in CODECS
    ]


def texts(figure):
    return [text.get_text() for text in figure.texts]


@pytest.mark.parametrize("detail", [(60, 20), (12, 50), (30, 65)])
def test_the_box_is_where_the_detail_is(detail):
    assert detail_box(body(detail)) == Window(detail[0], detail[0] + 20, detail[1], detail[1] + 20)


def test_an_outline_is_no_detail_and_what_is_hardly_covered_has_no_box():
    picture = body()
    picture[60:80, 20:40] = 129  # nothing but outline is left, and a step by one
    box = detail_box(picture)
    inside = is_covered(picture)[box.top : box.bottom, box.left : box.right]
    assert inside.mean() >= 0.7 and box.top < 80 and box.bottom > 60 and box.left < 40 and box.right > 20
    assert detail_box(np.full((SIZE, SIZE, 3), 255, dtype=np.uint8)) is None


def test_the_box_of_a_small_body_is_smaller():
    picture = np.full((SIZE, SIZE, 3), 255, dtype=np.uint8)
    picture[40:52, 40:52] = np.random.default_rng(1).integers(0, 250, (12, 12, 3))
    box = detail_box(picture)
    assert box.shape == (10, 10) and is_covered(picture)[box.top : box.bottom, box.left : box.right].mean() >= 0.7


def tall():
    picture = np.full((SIZE, SIZE, 3), 255, dtype=np.uint8)
    picture[5:95, 40:62] = np.random.default_rng(1).integers(0, 250, (90, 22, 3))
    return picture


@pytest.mark.parametrize(
    "picture", [body(), tall(), np.tile(body()[10:90, 15:85], (2, 2, 1)), body((30, 65))[:, 20:70]]
)
def test_the_inset_never_hides_the_box_and_all_that_is_seen_is_shown(picture):
    layout = layout_of(picture, [picture])
    cut, box, inset = layout.cut, layout.box, layout.inset
    rows, columns = np.nonzero(is_covered(picture))
    assert cut.top <= rows.min() and rows.max() < cut.bottom and cut.left <= columns.min() and columns.max() < cut.right
    assert cut.top <= inset.top and inset.bottom <= cut.bottom and cut.left <= inset.left and inset.right <= cut.right
    assert inset.right <= box.left or box.right <= inset.left or inset.bottom <= box.top or box.bottom <= inset.top
    assert inset.shape[0] / box.shape[0] == pytest.approx(inset.shape[1] / box.shape[1], rel=0.05)
    assert inset.shape[0] > 1.5 * box.shape[0]


def test_beside_a_tall_body_the_inset_hides_nothing():
    layout = layout_of(tall(), [])
    assert not is_covered(cut_out(tall(), layout.inset)).any()


def test_what_a_codec_adds_is_not_cut_off():
    other = body()
    other[:, 99] = 7
    assert layout_of(body(), [other]).cut.right >= 100 > layout_of(body(), []).cut.right


def test_a_window_beyond_the_picture_is_white():
    out = cut_out(body(), Window(-5, 20, 90, 120))
    assert out.shape == (25, 30, 3) and (out[:5] == 255).all() and (out[:, 10:] == 255).all()
    assert (cut_out(body(), Window(10, 12, 15, 17)) == 128).all()


def test_each_codec_has_one_column_at_its_point_nearest_to_the_common_rate(shots):
    folder, rows = shots
    found = find_shots(rows, [folder])
    assert [files.row["codec"] for files in found.columns] == [BEST, "draco", "somebody's codec with a long name"]
    assert {files.row["mbps"] for files in found.columns} == {1.0} and found.mbps == pytest.approx(1.0)
    assert (found.frame, found.limit_percent, found.left_out) == (5, 0.5, ())


def test_a_sheet_has_the_original_a_column_a_codec_two_rows_boxes_and_a_scale(shots):
    folder, rows = shots
    with matplotlib_settings():
        figure = sheet_figure(find_shots(rows, [folder]))
        figure.canvas.draw()
    columns = len(CODECS) + 1
    panels = {axes.get_label(): axes for axes in figure.axes if axes.get_images()}
    assert sorted(panels) == sorted([f"{c} 0" for c in range(columns)] + [f"{c} 1" for c in range(1, columns)])
    assert all(len(panels[f"{c} 0"].get_images()) == 2 for c in range(columns))  # with the inset
    places = {tuple((p.get_xy(), p.get_linestyle()) for p in panels[f"{c} 0"].patches) for c in range(columns)}
    assert len(places) == 1  # the same box in all columns
    (box, dotted), (_, solid) = places.pop()
    assert box == (20, 60) and (dotted, solid) == (":", "-")
    inset = np.asarray(panels["0 0"].get_images()[1].get_array())
    assert (inset == body()[60:80, 20:40]).all()
    told = texts(figure)
    assert {"original", "frame 5", BEST, "Draco", "1 Mbps", "D2 61.00 dB", "masked SSIM 0.610"} <= set(told)
    assert told.count("1 Mbps") == 3 and figure.get_size_inches()[0] <= WIDTH + 1e-9
    [scale] = [axes for axes in figure.axes if axes.get_label() == "scale"]
    assert "% of" in scale.get_xlabel() and [t.get_text() for t in scale.get_xticklabels()] == ["0", "0.25", "0.5"]


@pytest.mark.parametrize("count", [1, 5, 8, 12])
@pytest.mark.parametrize("picture", [body(), np.tile(body()[10:90, 15:85], (1, 4, 1))])
def test_nothing_of_a_sheet_covers_anything_else(tmp_path, count, picture):
    rows = [
        pictured(tmp_path, row("dancer", f"decimated_draco_number_{i}", 12.345, 61.234), picture) for i in range(count)
    ]
    with matplotlib_settings():
        figure = sheet_figure(find_shots(rows, [tmp_path]))
        figure.canvas.draw()
    renderer = figure.canvas.get_renderer()
    parts = [text.get_window_extent(renderer) for text in figure.texts]
    parts += [axes.get_tightbbox(renderer) for axes in figure.axes]
    assert len(figure.axes) == 2 * count + 2
    page = figure.bbox.padded(2)
    assert all(page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1 for box in parts)
    boxes = [box.padded(-1.5) for box in parts]  # letters have a little air around them
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))


def test_the_sheet_is_on_both_pages_and_the_same_each_time(shots, tmp_path):
    folder, rows = shots
    written = write_report(rows, experiment(), tmp_path / "out", [folder])
    [sheet] = [path for path in written if path.name.endswith("-sheet.png")]
    assert sheet.name in (tmp_path / "out" / "results.md").read_text()
    assert draw_sheet(find_shots(rows, [folder]), tmp_path / "again.png").read_bytes() == sheet.read_bytes()
    with Image.open(sheet) as picture:
        assert picture.width > 1000


def test_without_pictures_there_is_no_sheet(shots, tmp_path):
    folder, rows = shots
    plain = [{key: value for key, value in each.items() if key != "pictures"} for each in rows]
    assert find_shots(plain, [folder]) is None and find_shots(rows, []) is None
    assert find_shots(rows, [tmp_path / "none"]) is None
    assert not any("sheet" in path.name for path in write_report(plain, experiment(), tmp_path / "out", [folder]))


@pytest.mark.parametrize(
    "named",
    [None, {}, {"normals": "e.png"}]
    + [
        {"normals": "e.png", "errors": "e.png", "frame": 5, "limit_percent": 0.5} | wrong
        for wrong in ({"normals": "../x.png"}, {"frame": "5"}, {"limit_percent": "0.5"}, {"limit_percent": 0})
    ],
)
def test_a_row_that_names_no_pictures_of_the_folder_has_no_place(shots, named):
    folder, rows = shots
    save(folder.parent / "x.png", body())
    save(folder / "e.png", body())
    assert find_shots([rows[0] | {"pictures": named}], [folder]) is None
    assert len(find_shots([rows[0] | {"pictures": named}, rows[1]], [folder]).columns) == 1


@pytest.mark.parametrize("harm", ["missing", "cut off", "no picture", "of another size", "too large"])
def test_a_row_whose_file_cannot_be_shown_has_no_place(shots, harm):
    folder, rows = shots
    rows = rows[:2]
    file = folder / rows[0]["pictures"]["normals"]
    if harm == "missing":
        file.unlink()
    elif harm == "of another size":
        save(file, body(size=120))
    elif harm == "too large":  # says that it has 10^10 pixels
        data = file.read_bytes()
        head = data[12:16] + (100_000).to_bytes(4, "big") * 2 + data[24:29]
        file.write_bytes(data[:12] + head + zlib.crc32(head).to_bytes(4, "big") + data[33:])
    else:
        file.write_bytes(file.read_bytes()[:200] if harm == "cut off" else b"nothing")
    assert [files.row["codec"] for files in find_shots(rows, [folder]).columns] == [rows[1]["codec"]]
    (folder / "dancer-original.png").unlink()
    assert find_shots(rows, [folder]) is None


def test_pictures_of_another_frame_or_scale_are_left_out_and_told(tmp_path):
    folder = tmp_path / "p"
    rows = [pictured(folder, row("dancer", codec, 1.0, 60.0)) for codec in ("a", "b")]
    rows += [
        pictured(folder, row("dancer", "c", 1.0, 60.0), frame=6),
        pictured(folder, row("dancer", "d", 1.0, 60.0), limit=1.0),
    ]
    found = find_shots(rows, [folder])
    assert [files.row["codec"] for files in found.columns] == ["a", "b"] and found.left_out == ("c", "d")
    write_report(rows, experiment(), tmp_path / "out", [folder])
    assert "of another frame, scale or size: c, d." in (tmp_path / "out" / "results.md").read_text()


def test_pictures_of_several_folders_are_on_one_sheet(tmp_path):
    rows = [pictured(tmp_path / codec, row("dancer", codec, 1.0, 60.0)) for codec in ("a", "b")]
    assert len(find_shots(rows, [tmp_path / "a", tmp_path / "b"]).columns) == 2


def test_a_point_far_from_the_common_rate_is_marked(tmp_path):
    rows = [pictured(tmp_path, row("dancer", name, mbps, 61.0)) for name, mbps in (("x", 1.0), ("y", 1.1), ("z", 4.0))]
    shots = find_shots(rows, [tmp_path])
    with matplotlib_settings():
        told = texts(sheet_figure(shots))
    assert {"1 Mbps", "1.1 Mbps", f"4 Mbps {DAGGER}"} <= set(told)
