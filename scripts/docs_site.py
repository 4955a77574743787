"""Hooks of mkdocs: pages from outside docs/, the player's files, samples; run by itself, it makes the samples."""

from __future__ import annotations

import json
import os
import posixpath
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
OUTSIDE = ("FORMAT.md", "CHANGELOG.md", "CONTRIBUTING.md")
PLAYER = ROOT / "src" / "meshreel" / "player"
SAMPLES = ROOT / "build" / "samples"
ROOM = ROOT / "docs" / "pictures" / "room.png"  # in place of posters, for a check
CHECKED = {"room.reel": "scene.reel", "bodies.reel": "mixed.reel"}  # conformance files in their place, for a check
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)#\s:]+)(#[^)\s]*)?\)")  # text, file, anchor; no pictures, no addresses
VALUE = re.compile(r"\{\{(size|seconds):([\w.]+)\}\}")
HOME = "index.md"
EXAMPLES = (".ipynb", ".py")  # endings of the files that become pages
FRAMES = 60  # of the bodies: two seconds
POSTER = (800, 600)  # pixels


def on_files(files: Any, config: Any) -> Any:
    """Add what is not in docs/ to the site. Raises FileNotFoundError where there are no samples."""
    from mkdocs.structure.files import File

    added = [(name, ROOT / name) for name in OUTSIDE]
    built = [path for path in sorted(PLAYER.iterdir()) if path.suffix in (".js", ".wasm", ".gz")]
    added += [(f"player/{path.name}", path) for path in built]
    for name in CHECKED:
        sample = _sample(name)
        poster = sample.with_suffix(".png")
        added += [(f"samples/{name}", sample), (f"samples/{Path(name).stem}.png", poster if poster.exists() else ROOM)]
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
    """Point links at where pages are on the site, and say how large and long samples are.

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
    path = _sample(match[2])
    if match[1] == "size":
        return f"{path.stat().st_size / 1000:.0f} kB"
    import meshreel

    with meshreel.open(str(path)) as video:
        return f"{video.duration:.2g} s"


def _sample(name: str) -> Path:
    folder = os.environ.get("MESHREEL_SAMPLES")
    return SAMPLES / name if folder is None else ROOT / folder / CHECKED[name]


def make_samples(folder: Path) -> None:
    """Write the samples that are not there yet, and a picture of each."""
    import meshreel
    from meshreel.capture.recording import FusionOptions, open_recording
    from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
    from meshreel.capture.simulated.stage import VOXEL, StageOptions, record_stage
    from meshreel.export.film import FilmOptions, export_film

    folder.mkdir(parents=True, exist_ok=True)
    room, bodies = folder / "room.reel", folder / "bodies.reel"
    if not room.exists():
        record_stage(rig := folder / "rig", StageOptions())
        recording, _ = open_recording(rig, FusionOptions(VOXEL))
        meshreel.encode(recording, room, close_planes=True)
    if not bodies.exists():
        meshreel.encode(soft_bodies(SoftBodiesOptions(frames=FRAMES)), bodies)
    for path in (room, bodies):
        with meshreel.open(path) as video:
            export_film(video.reader, path.with_suffix(".png"), range(1), FilmOptions(size=POSTER, background=None))


if __name__ == "__main__":
    make_samples(SAMPLES)
