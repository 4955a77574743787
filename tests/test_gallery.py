"""The gallery's samples: each is on its page, plays, is free for any use, and is what the page says."""

import re
from pathlib import Path
from types import SimpleNamespace

import pytest

import meshreel
from scripts.docs_site import on_page_markdown
from scripts.samples import LICENSE, MAKERS, SAMPLES

PAGE = SAMPLES.parent / "gallery.md"
FILES = sorted(SAMPLES.iterdir())


def test_the_page_shows_each_sample_that_the_script_makes() -> None:
    shown = re.findall(r"\{\{player:(\w+)\.reel\}\}", PAGE.read_text(encoding="utf-8"))
    assert shown == list(MAKERS) and {path.name for path in FILES} == {f"{name}.reel" for name in shown}
    assert sum(path.stat().st_size for path in FILES) <= 1_500_000


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_sample_decodes_and_is_free_for_any_use(path: Path) -> None:
    with meshreel.open(path) as video:
        assert video.reader.metadata["license"] == LICENSE
        assert all(len(video[frame].faces) > 100 for frame in (0, len(video) - 1))


def test_samples_have_what_the_page_says() -> None:
    with meshreel.open(SAMPLES / "long.reel") as video:
        assert video.duration == pytest.approx(20) and len(video[0].faces) != len(video[200].faces)
    with meshreel.open(SAMPLES / "splats.reel") as video:
        assert len(video.splats(0).means) > 1000
    with meshreel.open(SAMPLES / "person.reel") as video:
        assert video[0].colors is not None


def test_the_site_plays_each_sample_and_offers_its_file_and_link() -> None:
    page = SimpleNamespace(file=SimpleNamespace(src_uri="gallery.md"))
    made = on_page_markdown(PAGE.read_text(encoding="utf-8"), page, None, SimpleNamespace(src_uris={"CONTRIBUTING.md"}))
    assert "{{" not in made
    for path in FILES:
        assert f'<meshreel-player src="samples/{path.name}"' in made and f'data-link="samples/{path.name}"' in made
        assert f"{path.stat().st_size / 1000:.0f} kB for " in made
