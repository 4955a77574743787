"""What README and tutorial show is true: their Python runs, their commands parse, and what they link to exists."""

from __future__ import annotations

import re
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import meshreel
from meshreel.analysis.reference import ReferenceOptions
from meshreel.analysis.track import TrackOptions
from meshreel.capture.procedural import SoftBodiesOptions, soft_bodies
from meshreel.choice import IntraOptions
from meshreel.io.write import write_mesh

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
RUN = [ROOT / "README.md", ROOT / "docs" / "tutorial.md"]


def blocks(page: Path, language: str) -> str:
    """A page's code in a language, its blocks one after the other."""
    return "\n".join(re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))


def quick(*arguments: Any, **named: Any) -> meshreel.EncoderOptions:
    """The preset with everything small, so that a page runs in seconds."""
    full = preset_options(*arguments, **named)
    small = ReferenceOptions(vertices=300, keys=1, trial_vertices=300)
    small = replace(small, fuse=replace(small.fuse, subdivisions=0, poisson=replace(small.fuse.poisson, depth=6)))
    intra = IntraOptions(fractions=(0.5, 1.0), steps=(1.0,), levels=(0,))
    return replace(full, track=TrackOptions(centers=100, samples=5000), reference=small, intra=intra)


preset_options = meshreel.preset_options


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.name)
def test_the_python_of_the_docs_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(meshreel, "preset_options", quick, raising=False)
    (tmp_path / "scan").mkdir()
    for number, mesh in enumerate(soft_bodies(SoftBodiesOptions(frames=4, people=1, spacing=0.06))):
        write_mesh(mesh, tmp_path / "scan" / f"frame_{number}.ply")
    if page.name == "tutorial.md":
        for path in (tmp_path / "scan").iterdir():
            path.unlink()  # it makes its own
    exec(compile(blocks(page, "python"), str(page), "exec"), {"__name__": "docs"})


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.name)
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
    targets = re.findall(r"\]\(([^)#\s]+)", text)
    local = [target for target in targets if "://" not in target]
    assert [target for target in local if not (page.parent / target).exists()] == []
    anchors = {
        re.sub(r"[^\w -]", "", line.lower()).strip().replace(" ", "-") for line in re.findall(r"^#+ (.*)$", text, re.M)
    }
    assert [target for target in re.findall(r"\]\(#([^)]+)\)", text) if target not in anchors] == []


def test_the_pictures_are_small() -> None:
    sizes = [path.stat().st_size for path in (ROOT / "docs" / "pictures").iterdir()]
    assert max(sizes) <= 200_000
    assert sum(sizes) <= 1_500_000
