"""Run the Python of a documentation page, in order, in the current folder: `python run_page.py PAGE [small]`.

A process of its own, so that it runs as for a user, without the tests' type checks. `small` is for pages that have no
meshes of their own: it makes a folder `scan`, and everything in the preset is small.
"""

import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any


def blocks(page: Path, language: str) -> str:
    """A page's code in a language, its blocks one after the other."""
    return "\n".join(re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))


def main(page: Path, given: bool) -> None:
    """Runs the page, with meshes and small presets if these are to be given to it."""
    if given:
        give()
    exec(compile(blocks(page, "python"), str(page), "exec"), {"__name__": "page"})


def give() -> None:
    """Makes a folder `scan`, and the presets small."""
    from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
    from meshreel.encoder.settings.settings import Settings
    from meshreel.io.write import write_mesh

    resolved = Settings.resolved
    Settings.resolved = lambda settings: small(resolved(settings))  # type: ignore[method-assign]
    Path("scan").mkdir()
    for number, mesh in enumerate(soft_bodies(SoftBodiesOptions(frames=4, people=1, spacing=0.06))):
        write_mesh(mesh, Path("scan") / f"frame_{number:05}.ply")


def small(made: Any) -> Any:
    """Options with little of everything, so that a page runs in seconds."""
    from meshreel.analysis.reference.extraction import ReferenceOptions
    from meshreel.analysis.reference.track import TrackOptions
    from meshreel.encoder.group.forms import IntraOptions
    from meshreel.encoder.paper.recipe import PaperOptions

    intra = IntraOptions(fractions=(0.5, 1.0), steps=(1.0,))
    paper = {"track": TrackOptions(100, 5000), "reference": ReferenceOptions(300)}
    return replace(
        made, method=replace(made.method, intra=intra, **(paper if isinstance(made.method, PaperOptions) else {}))
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:] == ["small"])
