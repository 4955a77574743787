"""Hooks of mkdocs: pages from outside docs/, the player's files, samples; run by itself, it draws their posters."""

from __future__ import annotations

import json
import posixpath
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
OUTSIDE = ("FORMAT.md", "CHANGELOG.md", "CONTRIBUTING.md")
PLAYER = ROOT / "src" / "meshreel" / "player"
SAMPLES, POSTERS = ROOT / "docs" / "samples", ROOT / "build" / "posters"
ROOM = ROOT / "docs" / "pictures" / "room.png"  # in place of posters, for a check
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)#\s:]+)(#[^)\s]*)?\)")  # text, file, anchor; no pictures, no addresses
VALUE = re.compile(r"\{\{(size|seconds|player):([\w.]+)\}\}")
# How the gallery shows a sample.
SHOWN = """<meshreel-player src="samples/{name}" controls loop preload="none" poster="samples/{stem}.png" \
style="width: 100%; aspect-ratio: 16 / 9"></meshreel-player>

<a href="samples/{name}" download>{name}</a>, {size} for {seconds} \
<button type="button" class="md-button" data-link="samples/{name}">Copy link</button>"""
HOME = "index.md"
EXAMPLES = (".ipynb", ".py")  # endings of the files that become pages
POSTER = (800, 600)  # pixels


def on_files(files: Any, config: Any) -> Any:
    """Add what is not in docs/ to the site."""
    from mkdocs.structure.files import File

    added = [(name, ROOT / name) for name in OUTSIDE]
    built = [path for path in sorted(PLAYER.iterdir()) if path.suffix in (".js", ".wasm", ".gz")]
    added += [(f"player/{path.name}", path) for path in built]
    for sample in SAMPLES.glob("*.reel"):
        poster = POSTERS / f"{sample.stem}.png"
        added.append((f"samples/{poster.name}", poster if poster.exists() else ROOM))
    for path in sorted(one for one in (ROOT / "docs" / "examples").iterdir() if one.suffix in EXAMPLES):
        page = f"examples/{path.stem}.md"
        files.append(File.generated(config, page, content=_page_of(path)))
    for place, path in added:
        files.append(File.generated(config, place, abs_src_path=str(path)))
    return files


def _page_of(example: Path) -> str:
    """A notebook or a script as a page: its text, and its code as blocks."""
    source = example.read_text(encoding="utf-8")
    if example.suffix == ".py":
        texts = [(f"# {example.name}", False), (source.rstrip(), True)]
    else:
        texts = [("".join(cell["source"]), cell["cell_type"] == "code") for cell in json.loads(source)["cells"]]
    blocks = [f"```python\n{text}\n```" if is_code else text for text, is_code in texts]
    return "\n\n".join([*blocks, f"[Download {example.name}]({example.name})"]) + "\n"


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Point links at where pages are on the site, and show samples, or say how large and long they are.

    What is in the repository and not on the site is named without a link.
    """
    del config
    here = page.file.src_uri
    folder = posixpath.dirname(here if here in OUTSIDE else f"docs/{here}")  # in the repository

    def moved(match: re.Match[str]) -> str:
        to = posixpath.normpath(posixpath.join(folder, match[2]))
        place = HOME if to == "README.md" else to.removeprefix("docs/")
        if here == "examples/index.md" and place.endswith(EXAMPLES):
            place = str(Path(place).with_suffix(".md").as_posix())
        is_page = place in files.src_uris or not (ROOT / to).exists()  # what is nowhere is left for mkdocs to refuse
        if not is_page:
            return match[1]
        return f"[{match[1]}]({posixpath.relpath(place, posixpath.dirname(here) or '.')}{match[3] or ''})"

    return VALUE.sub(_measured, LINK.sub(moved, markdown))


def _measured(match: re.Match[str]) -> str:
    import meshreel

    kind, name = match.groups()
    path = SAMPLES / name
    size = f"{path.stat().st_size / 1000:.0f} kB"
    with meshreel.open(path) as video:
        seconds = f"{video.duration:.2g} s"
    if kind == "player":
        return SHOWN.format(name=name, stem=path.stem, size=size, seconds=seconds)
    return size if kind == "size" else seconds


def draw_posters() -> None:
    """Draw the first frame of each sample."""
    import meshreel
    from meshreel.export.film import FilmOptions, export_film

    POSTERS.mkdir(parents=True, exist_ok=True)
    for path in sorted(SAMPLES.glob("*.reel")):
        with meshreel.open(path) as video:
            export_film(video.reader, POSTERS / f"{path.stem}.png", range(1), FilmOptions(size=POSTER, background=None))


if __name__ == "__main__":
    draw_posters()
