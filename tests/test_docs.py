"""README, tutorial and docs are true: their Python runs, their commands parse, and their links exist."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest

import meshreel
from meshreel.format.layout import Form
from tests.run_page import blocks

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
RUN = [ROOT / "README.md", ROOT / "docs" / "tutorial.md"]
INTERCHANGE, COMMANDS, CALIBRATION, FARM = (
    ROOT / "docs" / name for name in ("interchange.md", "cli.md", "calibration.md", "farm.md")
)


def test_the_python_of_the_readme_runs(tmp_path: Path) -> None:
    _run_page(RUN[0], tmp_path, "small")


@pytest.mark.slow
def test_the_tutorial_runs_and_shows_layers(tmp_path: Path) -> None:
    """As it stands, but for a room of two frames in place of twenty."""
    page, whole = tmp_path / RUN[1].name, RUN[1].read_text(encoding="utf-8")
    page.write_text(short := whole.replace("RoomOptions(frames=20)", "RoomOptions(frames=2)"), encoding="utf-8")
    assert short != whole
    printed = _run_page(page, tmp_path)
    with meshreel.open(tmp_path / "scan.reel") as video:
        assert [group.form for group in video.reader.groups] == [Form.LAYERS]
    shown = [(int(size), int(count)) for size, count in re.findall(r"(\d+) bytes, (\d+) vertices", printed)]
    assert len(shown) == 3 and all(a < c and 2 * b < d for (a, b), (c, d) in pairwise(shown))


def test_the_python_of_interchange_runs(tmp_path: Path) -> None:
    shutil.copy(ROOT / "conformance" / "v1" / "layers.reel", tmp_path / "scan.reel")
    _run_page(INTERCHANGE, tmp_path)
    assert (tmp_path / "scan.glb").exists()


@pytest.mark.parametrize("page", [*RUN, INTERCHANGE, COMMANDS, CALIBRATION, FARM], ids=lambda page: page.name)
def test_the_commands_of_the_docs_parse(page: Path) -> None:
    from meshreel.cli import make_app

    lines = [shlex.split(line, comments=True) for line in blocks(page, "sh").splitlines()]
    commands = [line[1:] for line in lines if line[:1] == ["meshreel"]]
    assert commands
    for tokens in commands:
        make_app().parse_args(tokens, exit_on_error=False, print_error=False)


def test_every_promised_name_has_an_example_in_the_tutorial() -> None:
    code = blocks(RUN[1], "python")
    assert [name for name in meshreel.__all__ if f"meshreel.{name}" not in code] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    local = [target for target in re.findall(r"\]\(([^)#\s]+)", text) if "://" not in target]
    assert [target for target in local if not (page.parent / target).exists()] == []
    titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    anchors = {re.sub(r"[^\w -]", "", title.lower()).strip().replace(" ", "-") for title in titles}
    assert [target for target in re.findall(r"\]\(#([^)]+)\)", text) if target not in anchors] == []


def test_the_page_of_cameras_has_a_row_for_each_reader() -> None:
    named = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
    rows = re.findall(r"^\|[^|]+\| `(\w+)` \|", (ROOT / "docs" / "cameras.md").read_text("utf-8"), re.MULTILINE)
    assert set(rows) == set(named["meshreel.recordings"])


def test_the_environment_for_a_first_run_has_a_tested_python_and_extras_that_exist() -> None:
    yaml = pytest.importorskip("yaml")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    python, *_, pip = yaml.safe_load((ROOT / "environment.yml").read_text(encoding="utf-8"))["dependencies"]
    assert f"Programming Language :: Python :: {python.removeprefix('python=')}" in project["classifiers"]
    [wanted] = pip["pip"]
    extras = wanted.removeprefix(".[").removesuffix("]").split(",")
    assert set(extras) <= project["optional-dependencies"].keys() and {"demo", "play"} <= set(extras)


def test_the_pictures_are_small() -> None:
    sizes = {path.name: path.stat().st_size for path in (ROOT / "docs" / "pictures").iterdir()}
    assert sizes.pop("moving.webp") <= 600_000  # 45 pictures
    assert max(sizes.values()) <= 200_000
    assert sum(sizes.values()) <= 1_500_000


def test_the_readme_names_the_size_of_its_moving_picture() -> None:
    facts = json.loads((ROOT / "docs" / "pictures" / "moving.json").read_text(encoding="utf-8"))
    seconds = facts["frames"] / facts["frame_rate"]
    said = f"recorded by {facts['cameras']} depth cameras for {seconds:g} s, in {facts['bytes'] / 1000:.0f} kB"
    assert said in " ".join(RUN[0].read_text(encoding="utf-8").split())


def test_the_readme_says_the_headline_of_the_results() -> None:
    found = json.loads((ROOT / "docs" / "results" / "headline.json").read_text(encoding="utf-8"))
    person, times = found["person"], found["times_larger_at_equal_d2"]
    text = " ".join(RUN[0].read_text(encoding="utf-8").split())
    assert f"**{times['Draco']['median']} times smaller** than one Draco mesh a frame" in text
    held = f"**{person['kilobytes']} kB** hold {person['seconds']:g} s"
    assert f"{held} of a captured person of {person['triangles']:,} triangles" in text
    shown = re.findall(r"\| ([^|]+) \| ([\d.]+) \|", text)
    assert {name.strip(): float(number) for name, number in shown} == {
        "Draco, every frame": times["Draco"]["median"],
        "Draco, every frame decimated": times["Draco, decimated"]["median"],
        "TVMC*": times["TVMC*"]["median"],
    }
    d1, pictures = found["vdmc_times"]["mpeg_d1_psnr"], found["vdmc_times"]["ssim_masked"]
    assert f"needs {d1[0]:.2g} to {d1[-1]:.2g} times the bytes at equal D1, by its published sheet" in text
    assert f"needs {pictures[0]:.2g} to {pictures[-1]:.2g} times the bytes at equal masked SSIM" in text


def _run_page(page: Path, folder: Path, *arguments: str) -> str:
    """What the page prints."""
    command = [sys.executable, str(ROOT / "tests" / "run_page.py"), str(page), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=run_environment())
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def run_environment() -> dict[str, str]:
    """The meshreel that is tested here is the one that the page imports."""
    paths = [str(Path(meshreel.__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
