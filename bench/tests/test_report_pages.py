"""The pages: one HTML file that needs no other, of the same text as the Markdown; failures; how it was made."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import pytest
from meshreel_bench.experiments import EXPERIMENTS
from meshreel_bench.filenames import file_name
from meshreel_bench.names import BEST
from meshreel_bench.report import write_report
from meshreel_bench.report.html import html_page
from meshreel_bench.report.looks import looks_of

from bench.tests.report_rows import experiment, failed, pictured, row

BAD = '<script>alert("x")</script>'
LINK = "[there](http://example.org/a) ![seen](http://example.org/b.png) <http://example.org/c>"


class Page(HTMLParser):
    """What a page refers to, its tags and ids, and its text."""

    def __init__(self, html):
        super().__init__()
        self.found, self.tags, self.ids, self.text = [], [], [], ""
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        names = ("src", "href", "xlink:href", "srcset", "data", "action", "poster", "background")
        self.found += [value for name, value in attrs if name in names]
        self.ids += [value for name, value in attrs if name == "id"]

    def handle_data(self, data):
        self.text += data


def is_within(page, html):
    """Whether all that a page refers to is in it."""
    known = {f"#{name}" for name in page.ids}
    styled = re.findall(r"url\(|@import", html)
    return not styled and all(link in known or link.startswith("data:image/") for link in page.found)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """A report with pictures, names that are markup, and a failure; its folder."""
    folder = tmp_path_factory.mktemp("report")
    shots = folder / "rows.pictures"
    rows = [
        pictured(shots, row("dancer", BEST, 1.0, 60.0)),
        pictured(shots, row("dancer", "draco", 2.0, 70.0)),
        row("dancer", BAD, 3.0, 75.0),
        row(f"{BAD}/..", "draco", 3.0, 75.0),
        failed("dancer", LINK, f"it {BAD} broke"),
    ]
    write_report(rows, experiment(["", f"## {LINK}", "", f"text & {BAD}"]), folder, [folder / "none", shots])
    return folder


def test_the_page_needs_no_other_file(report):
    html = (report / "index.html").read_text()
    page = Page(html)
    assert is_within(page, html)
    assert page.tags.count("img") == 3  # two plots, one sheet
    assert sum(link.startswith("data:image/svg+xml") for link in page.found) == 2
    assert sum(link.startswith("data:image/png") for link in page.found) == 1
    assert not {"script", "link", "iframe", "object", "video"} & set(page.tags)


def test_a_page_that_refers_to_others_is_noticed():
    for html in ('<a href="http://x">', '<img src="a.png">', '<a href="#none">', "<style>a{background:url(x)}</style>"):
        assert not is_within(Page(html), html)


def test_names_are_text_in_the_page(report):
    html = (report / "index.html").read_text()
    assert "<script" not in html and "example.org/a" in Page(html).text
    assert BAD in Page(html).text and f"it {BAD} broke" in Page(html).text


def test_the_contents_name_every_part_once(report):
    html = (report / "index.html").read_text()
    page = Page(html)
    nav = html[html.index("<nav>") : html.index("</nav>")]
    linked = re.findall('href="#([^"]+)"', nav)
    assert len(linked) == len(set(page.ids) & set(linked)) == 6 and len(set(page.ids)) == len(page.ids)
    assert linked[:2] == ["results-of-made-up", "dancer-10-frames"] and linked[-1] == "how-this-was-made"
    assert nav.count("<ul>") == nav.count("</ul>")


def test_heads_of_one_text_have_ids_of_their_own():
    page = Page(html_page("x", ["# a", "", "## a", "", "# a", "", "# ***"], {}))
    assert page.ids == ["a", "a-2", "a-3", "part"] and page.found == ["#a", "#a-2", "#a-3", "#part"]


def test_the_markdown_has_the_same_pictures_and_they_are_there(report):
    linked = re.findall(r"\]\((results/[^)]+)\)", (report / "results.md").read_text())
    name = file_name("made up-dancer")
    assert linked[:2] == [f"results/{name}.png", f"results/{name}-sheet.png"]
    assert len(linked) == 3 and all((report / link).is_file() for link in linked)


def test_a_failure_is_listed_with_its_reason_and_is_in_no_plot(report):
    text = (report / "results.md").read_text()
    assert text.index("# What failed") < text.index("# How this was made")
    assert "| made up | dancer | " in text and "broke |" in text
    assert "quality 50.0" in text and text.count("qp 9") == 1


def test_without_failures_there_is_no_section_of_them(tmp_path):
    write_report([row("dancer", "draco", 1.0, 60.0)], experiment(), tmp_path)
    assert "failed" not in (tmp_path / "results.md").read_text()


def test_failures_alone_are_a_report(tmp_path):
    written = write_report([failed("dancer", "draco", "took longer")], experiment(), tmp_path)
    assert [path.name for path in written] == ["results.md", "index.html"]
    text = (tmp_path / "results.md").read_text()
    assert "took longer" in text and "meshreel bench run made up" in text


def test_a_report_without_rows_is_empty(tmp_path):
    assert len(write_report([], experiment(), tmp_path)) == 2
    assert (tmp_path / "results.md").read_text() == "\n"


def test_comparisons_come_before_the_points_that_they_are_made_of(tmp_path):
    chosen = experiment()
    chosen["made up"].comparisons = lambda _rows: iter(["A comparison."])
    write_report([row("dancer", "draco", 1.0, 60.0)], chosen, tmp_path)
    text = (tmp_path / "results.md").read_text()
    assert text.index("quality against rate") < text.index("A comparison.\n\n| codec") < text.index("# How this")


def test_an_option_that_does_nothing_is_told(tmp_path):
    """Points of one curve that are all the same are a mistake, of the codec or of who chose them."""
    rows = [row("walker", "same", 1.0, 60.0), row("walker", "same", 1.0, 60.0), row("walker", "good", 2.0, 60.0)]
    write_report(rows, experiment(), tmp_path)
    page = (tmp_path / "results.md").read_text()
    assert page.count("does nothing here") == 1 and "same: points apart: 1 of 2." in page


def test_it_says_how_it_was_made(tmp_path):
    made = {"meshreel": "0.1.0", "commit": "abc", "platform": "P", "python": "3.12", "cores": 2}
    write_report([row("dancer", "draco", 1.0, 60.0, made_by=made)], experiment(), tmp_path)
    text = (tmp_path / "results.md").read_text()
    assert "meshreel bench report made up.jsonl -o FOLDER" in text
    assert "| made up | 0.1.0 | abc | P | not recorded | 3.12 | 2 | 1 |" in text


def test_a_codec_has_one_color_in_all_sequences(tmp_path):
    rows = [row("dancer", codec, 1.0, 60.0) for codec in ("alpha", "zeta")] + [row("mitch", "zeta", 1.0, 60.0)]
    written = write_report(rows, experiment(), tmp_path)
    plots = [path.read_text().lower() for path in written if path.suffix == ".svg"]
    colors = {name: look.color.lower() for name, look in looks_of(["alpha", "zeta"]).items()}
    assert colors["alpha"] in plots[0] and colors["alpha"] not in plots[1]
    assert all(colors["zeta"] in plot for plot in plots)


def test_same_rows_are_same_bytes(tmp_path):
    shots = tmp_path / "rows.pictures"
    rows = [pictured(shots, row("dancer", codec, 1.0, 60.0)) for codec in (BEST, "b", "a")] + [failed("x", "y", "z")]
    pages = []
    for folder in (tmp_path / "one", tmp_path / "two"):
        written = write_report(rows, experiment(), folder, [shots])
        pages.append({path.relative_to(folder): path.read_bytes() for path in written})
    assert pages[0] == pages[1] and len(pages[0]) == 5


def test_names_of_files_are_plain_and_never_meet():
    assert file_name("layers-dancer") == "layers-dancer"
    long = "a" * 1000
    names = [file_name(name) for name in ("a/b", "a b", "a_b", "../a", "a\\b", "é", "\ud800", long, long + "a")]
    assert max(map(len, names)) < 120
    assert len(set(names)) == len(names) and all(re.fullmatch(r"[\w.-]+", name, re.ASCII) for name in names)


@pytest.mark.parametrize("name", list(EXPERIMENTS))
def test_no_name_of_a_row_is_markup_in_the_markdown_of_an_experiment(tmp_path, name):
    kind = "curve" if name in ("scenes", "layers", "targets") else "rated"
    rows = [
        row(sequence, codec, mbps, 50.0 + mbps, experiment=name, kind=kind, groups=[], point=f"{sequence}{codec}{mbps}")
        for sequence in ("a", BAD)
        for codec in (BEST, "draco", BAD)
        for mbps in (1.0, 2.0, 3.0)
    ]
    write_report(rows, EXPERIMENTS, tmp_path)
    text = (tmp_path / "results.md").read_text()
    assert "script" in text and not re.search(r"(?<!\\)<script", text)
    assert "script" not in Page((tmp_path / "index.html").read_text()).tags


def test_rows_of_another_version_and_of_other_codecs_are_shown_as_far_as_they_go(tmp_path):
    rows = [
        row("dancer", "a", 1.0, 60.0, made_by={"meshreel": BAD}),
        row("dancer", "b", 2.0, 60.0, made_by={}, options={"basis_size": 3}),
        row("dancer", "c", 2.0, 60.0, options={"basis_size": 3, "quality": "high"}),
        failed("dancer", "e", "no file \ud800"),
        row("x" * 300, "d" * 300, 2.0, 60.0),
    ]
    write_report(rows, experiment(), tmp_path)
    text = (tmp_path / "results.md").read_text()
    assert "Rows of more than one version: \\<script>" in text and "unknown version (installed)" in text
    assert "no file \\ud800" in text
