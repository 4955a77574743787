"""Plots of the report: what they show, that nothing covers anything, and that same rows are same bytes."""

from __future__ import annotations

import matplotlib
import pytest
from meshreel_bench.curves import curve_of
from meshreel_bench.names import BEST
from meshreel_bench.report.looks import looks_of
from meshreel_bench.report.plots import WIDTH, curves_figure, matplotlib_settings, plot_curves
from meshreel_bench.scene_rows import NOISE_FLOOR

from bench.tests.report_rows import experiment, row

LONG = "b: background once, decimated Draco, labels found"
CHOSEN = experiment()["made up"]
ROWS = [row("dancer", codec, mbps, 60 + 4 * mbps) for codec in (BEST, "draco", LONG) for mbps in (0.5, 1.0, 4.0)]


def drawn(rows, chosen=CHOSEN):
    """The figure, laid out, and the renderer that measures it."""
    with matplotlib_settings():
        figure = curves_figure(rows, chosen, looks_of(map(curve_of, rows)))
        figure.canvas.draw()
        return figure, figure.canvas.get_renderer()


def legend_of(figure):
    [legend] = [*figure.legends, *(panel.get_legend() for panel in figure.axes if panel.get_legend())]
    return legend


@pytest.mark.parametrize("codecs", [["draco"], [BEST, LONG], [f"{LONG} {i}" for i in range(14)]])
@pytest.mark.parametrize("metrics", [1, 3, 4, 5, 7])
def test_the_legend_is_in_the_page_and_covers_no_panel(codecs, metrics):
    rows = [row("dancer", codec, mbps, 60.0) for codec in codecs for mbps in (0.5, 1.0)]
    keys = ("d2_psnr_paper", "ssim", "ssim_masked", "normal_error_deg", "symmetric_psnr", "encode_s", "mbps")
    chosen = experiment()["made up"]
    chosen.METRICS = [(key, key) for key in keys[:metrics]]
    figure, renderer = drawn(rows, chosen)
    box = legend_of(figure).get_window_extent(renderer)
    assert (
        figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1 and figure.bbox.y0 <= box.y0 <= box.y1 <= figure.bbox.y1
    )
    panels = [panel.get_tightbbox(renderer) for panel in figure.axes if panel.axison]
    assert len(panels) == metrics and not any(box.overlaps(panel) for panel in panels)
    assert figure.get_size_inches()[0] == pytest.approx(WIDTH)


def test_every_panel_has_a_log_rate_units_and_the_better_direction():
    figure, _ = drawn(ROWS)
    panels = [panel for panel in figure.axes if panel.axison]
    assert {(p.get_xscale(), p.get_xlabel()) for p in panels} == {("log", "rate (Mbps)")}
    told = {panel.get_ylabel(): panel.get_title(loc="right") for panel in panels}
    assert told["D2-PSNR, paper form (dB)"] == "↑ higher is better"
    assert told["normal error (degrees)"] == "↓ lower is better"
    assert len({panel.get_xlim() for panel in panels}) == 1
    assert all(
        low <= line.get_xdata().min() <= line.get_xdata().max() <= high
        for p in panels
        for line in p.lines
        for low, high in [p.get_xlim()]
    )


def test_a_codec_has_one_color_and_marker_in_all_panels_and_the_system_is_first_and_bold():
    figure, _ = drawn(ROWS)
    looks = {(line.get_label(), line.get_color(), line.get_marker()) for panel in figure.axes for line in panel.lines}
    assert len(looks) == 3
    texts = legend_of(figure).get_texts()
    assert texts[0].get_text() == BEST and [t.get_fontweight() for t in texts] == ["bold", "normal", "normal"]


def test_ticks_are_plain_numbers_within_the_rates_however_wide_these_are():
    for rates in ((0.5, 0.6), (0.05, 3.0), (0.001, 900.0)):
        figure, _ = drawn([row("dancer", "draco", mbps, 60.0) for mbps in rates])
        labels = [label.get_text() for label in figure.axes[0].get_xticklabels()]
        assert 2 <= len(labels) <= 9 and all(min(rates) * 0.75 <= float(x) <= max(rates) * 1.35 for x in labels)


def test_the_noise_floor_and_references_are_lines_of_their_own():
    chosen = experiment()["made up"]
    chosen.floors = lambda _rows: {"ssim_masked": 0.61}
    chosen.references = lambda _sequence: {"somebody's": [(2.0, 55.0), (20.0, 60.0)]}
    figure, _ = drawn(ROWS, chosen)
    panels = {panel.get_ylabel(): {line.get_label(): line for line in panel.lines} for panel in figure.axes}
    assert list(panels["masked SSIM"][NOISE_FLOOR].get_ydata()) == [0.61, 0.61]
    assert [name for name, lines in panels.items() if "somebody's" in lines] == ["D2-PSNR, paper form (dB)"]
    names = [each.get_text() for each in legend_of(figure).get_texts()]
    assert NOISE_FLOOR in names and "somebody's" in names and figure.axes[0].get_xlim()[1] > 20


@pytest.mark.parametrize("name", ["_hidden", "cost $5 and $6", r"$\frac$", "<&>"])
def test_any_name_is_drawn_as_it_is(name, tmp_path):
    rows = [row("dancer", name, 1.0, 60.0)]
    figure, _ = drawn(rows)
    assert [each.get_text().strip() for each in legend_of(figure).get_texts()] == [name]
    assert all(path.stat().st_size for path in plot_curves(rows, CHOSEN, looks_of([name]), tmp_path / "x.png"))


def test_same_rows_are_same_bytes_whatever_the_user_has_set(tmp_path):
    first = plot_curves(ROWS, CHOSEN, looks_of(map(curve_of, ROWS)), tmp_path / "a.png")
    with matplotlib.rc_context({"font.size": 30, "svg.hashsalt": None, "axes.grid": True, "savefig.dpi": 20}):
        second = plot_curves(ROWS, CHOSEN, looks_of(map(curve_of, ROWS)), tmp_path / "b.png")
    assert [path.name for path in first] == ["a.png", "a.svg"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    assert b"<dc:date>" not in first[1].read_bytes() and b"Software" not in first[0].read_bytes()
