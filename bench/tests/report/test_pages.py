"""Pages: one of results, an appendix for each experiment; those of docs are those of their rows."""

import json
from pathlib import Path

import msgspec
import pytest
from meshreel_bench.experiments import EXPERIMENTS
from meshreel_bench.experiments.study import D2, MASKED, NORMALS
from meshreel_bench.names import BEST, VDMC, VDMC_HERE, looks_of
from meshreel_bench.report import pages
from meshreel_bench.report.pages import write_report
from meshreel_bench.report.plots import curves_figure
from meshreel_bench.report.values import curve_of, rated
from meshreel_bench.rows import join_rows, read_rows

from bench.tests.made_up import failed, floor, row
from meshreel.errors import InputError

DOCS = Path(__file__).resolve().parents[3] / "docs"
ROWS = [row("ball", codec, rate, 55 + 5 * rate) for codec in (BEST, "zipmesh") for rate in (0.5, 1.0, 2.0)]


@pytest.fixture
def no_plots(monkeypatch):
    def plotted(_rows, _measures, _looks, path, *_):
        path.write_bytes(b"")
        return path

    monkeypatch.setattr(pages, "plot_curves", plotted)


def test_rows_of_anybodys_codec_are_in_the_appendix_of_figure_6(tmp_path):
    files = write_report([*ROWS, failed("ball", "other", "no <luck>")], tmp_path)
    names = {str(path.relative_to(tmp_path)) for path in files}
    assert names == {"results.md", "results/appendix-figure6.md", "results/figure6.png", "results/figure6-ball.png"}
    page = (tmp_path / "results" / "appendix-figure6.md").read_text()
    assert "## ball" in page and "| zipmesh | quality 2.0 |" in page and r"| other | qp 9 | no \<luck> |" in page
    first = (tmp_path / "results.md").read_text()
    assert "(results/figure6-ball.png)" in first and "7 points, 1 of them failed" in first and "{" not in first
    again = {path: path.read_bytes() for path in files}
    files = write_report([*ROWS, failed("ball", "other", "no <luck>")], tmp_path)
    assert {path: path.read_bytes() for path in files} == again


def test_a_report_that_cannot_be_written_leaves_the_one_before_as_it_was(tmp_path):
    files = write_report(ROWS, tmp_path)
    before = {path: path.read_bytes() for path in files}
    (tmp_path / "results" / "figure6-cube.png").mkdir()
    with pytest.raises(InputError, match=r"figure6-cube\.png: is a folder"):
        write_report([*ROWS, *(row("cube", BEST, rate, 60 + rate) for rate in (1.0, 2.0))], tmp_path)
    assert {path: path.read_bytes() for path in files} == before
    assert {path.name for path in tmp_path.iterdir()} == {"results.md", "results"}


@pytest.mark.usefixtures("no_plots")
def test_a_sequence_without_a_quality_has_no_plot_and_names_that_look_alike_have_two(tmp_path):
    blank = row("cube", BEST, 1.0, 60, metrics={"d2_psnr_paper": None})
    alike = [row(name, BEST, 1.0, 60) for name in ("./a/scan", "./a_scan")]
    names = [path.name for path in write_report([blank, *alike], tmp_path) if path.suffix == ".png"]
    assert len(set(names)) == len(names) == 3 and not any("cube" in name for name in names)


def test_a_plot_has_a_panel_for_each_measure_and_a_line_for_each_curve_and_the_floor():
    rows = [*ROWS, floor("ball", d2_psnr_paper=62.0)]
    figure = curves_figure(rows, (D2, MASKED, NORMALS), looks_of([BEST, "zipmesh"]))
    first, second, third = figure.axes
    assert "higher" in first.get_title(loc="right") and "lower" in third.get_title(loc="right")
    assert [line.get_label() for line in first.lines] == [BEST, "zipmesh", "the truth itself"]
    assert len(second.lines) == 2 and first.get_title(loc="left") == "ball, 10 frames"
    looks = looks_of(["b", "a", BEST])  # curves that are not known have looks of their own
    assert list(looks) == [BEST, "a", "b"] and looks["a"] != looks["b"]


def test_plots_of_figure_6_have_the_points_of_v_dmc_and_no_table_has():
    (part,) = pages.parts_of([row("dancer", BEST, 1.0, 60)])
    assert {each.name for each in part.drawn} == {BEST, VDMC, VDMC_HERE} and len(part.rows) == 1
    figure = curves_figure(part.drawn, (D2, NORMALS), looks_of([BEST, VDMC, VDMC_HERE]))
    assert [len(panel.lines) for panel in figure.axes] == [2, 2]  # its sheet knows neither
    assert figure.axes[0].get_title(loc="left") == "dancer, 10 frames"


@pytest.mark.parametrize("path", sorted((DOCS / "results").glob("*.jsonl")), ids=lambda path: path.stem)
def test_the_colours_of_one_page_tell_the_variants_of_a_codec(path):
    rows = rated(read_rows(path))
    variants = {curve_of(row) for row in rows if "variant" in row.point.options}
    looks = looks_of(map(curve_of, rows))
    assert len({looks[name].color for name in variants}) == len(variants)


@pytest.mark.usefixtures("no_plots")
def test_the_pages_of_docs_are_those_of_their_rows(tmp_path):
    rows = join_rows([read_rows(path) for path in sorted((DOCS / "results").glob("*.jsonl"))])
    written = [path.relative_to(tmp_path) for path in write_report(rows, tmp_path)]
    assert len(written) > 15
    for path in written:
        assert (DOCS / path).is_file(), "write them again: meshreel-bench report docs/results/*.jsonl -o docs"
        if path.suffix != ".png":
            assert (tmp_path / path).read_text() == (DOCS / path).read_text(), path
    shown = {path.name for path in written if path.suffix == ".png"}
    assert {path.name for path in (DOCS / "results").glob("*.png")} == shown


@pytest.mark.usefixtures("no_plots")
def test_the_headline_is_the_size_of_a_person_and_how_much_larger_others_are(tmp_path):
    rows = join_rows([read_rows(DOCS / "results" / f"{name}.jsonl") for name in ("figure6", "layers")])
    write_report(rows, tmp_path)
    found = json.loads((tmp_path / "results" / "headline.json").read_text())
    sizes = [1.5 * each["bytes"] / 1000 for each in found["person"]["from"]]  # two seconds are measured
    assert found["person"]["kilobytes"] == round(sum(sizes) / len(sizes))
    assert all(others["median"] > 1 for others in found["times_larger_at_equal_d2"].values())


def test_small_points_of_an_experiment_are_in_its_own_appendix():
    small = list(EXPERIMENTS["ablation_paper"].points(small=True))
    rows = [msgspec.structs.replace(row("demo", BEST, 1.0, 60), point=point) for point in small]
    assert [part.name for part in pages.parts_of(rows)] == ["ablation_paper"]
