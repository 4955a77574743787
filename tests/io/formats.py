"""What became of a feature of a mesh format when its file was read: it changed the mesh, was named, or refused.

`python -m tests.io.formats` writes the tables of docs/formats.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from meshreel.errors import InputError
from meshreel.io.sequence import open_sequence
from meshreel.types import Mesh
from tests.io.specifications import Case, all_cases, plain_cases

PAGE = Path(__file__).parents[2] / "docs" / "formats.md"
KINDS = ("kept", "named", "refused", "silent")
# Features that change neither surface nor base colours, with the words of the readers' own lists.
SILENT = {
    "extras",
    "material.doubleSided",
    "KHR_materials_unlit",
    "primitive.targets without weights",
    "v with a weight",
}
SILENT |= {"g", "s", "mg", "o", "bevel", "c_interp", "d_interp", "lod", "vp", "shadow_obj", "trace_obj"}
SILENT |= {"Ka", "Ns", "Ni", "illum", "sharpness", "map_aat"}


@dataclass(frozen=True)
class Fate:
    """What became of a feature, and what was said of it."""

    kind: str
    words: str = ""


def facts(mesh: Mesh) -> list[object]:
    """What a mesh shows, as plain values."""
    uv = None if mesh.uv is None else np.nan_to_num(mesh.uv, nan=-9).tolist()
    pixels = None if mesh.texture is None else mesh.texture.pixels.tolist()
    colors = None if mesh.colors is None else mesh.colors.tolist()
    return [mesh.vertices.tolist(), mesh.faces.tolist(), colors, uv, pixels]


@cache
def _plain(format: str) -> list[object]:
    with TemporaryDirectory() as folder:
        return facts(open_sequence(plain_cases()[format].write(Path(folder)))[0])


def fate(case: Case, folder: Path) -> Fate:
    """Read a file and say what became of its feature."""
    try:
        sequence = open_sequence(case.write(folder))
        found = [facts(mesh) for mesh in sequence]
    except InputError as error:
        return Fate("refused", str(error).replace(str(folder), "").lstrip("/"))
    if case.feature in SILENT and not sequence.warnings:
        return Fate("silent")
    if sequence.warnings:
        return Fate("named", "; ".join(sequence.warnings).replace(str(folder), ""))
    return Fate("kept") if len(found) > 1 or found[0] != _plain(case.format) else Fate("lost")


def filled() -> str:
    """The page of formats, with the tables as the readers are now."""
    head, rows = PAGE.read_text(encoding="utf-8").split("<!-- tables -->")[0], dict[str, dict[str, list[str]]]()
    for case in all_cases():
        with TemporaryDirectory() as folder:
            kind = fate(case, Path(folder)).kind
        rows.setdefault(case.format, {kind: [] for kind in KINDS})[kind].append(case.feature)
    titles = {"kept": "kept", "named": "named in a warning", "refused": "refused by name", "silent": "without effect"}
    tables = ""
    for name, fates in rows.items():
        lines = [f"| {titles[kind]} | {'; '.join(fates[kind]) or '-'} |" for kind in KINDS]
        tables += "\n".join([f"\n## {name}\n", "| | |", "| --- | --- |", *lines]) + "\n"
    return f"{head}<!-- tables -->\n{tables}"


if __name__ == "__main__":
    PAGE.write_text(filled(), encoding="utf-8", newline="\n")
