"""Captured frames that decisions are measured on, and the rows of docs/decisions/measured.jsonl.

In: folders and .npz files of performers. Out: frames in normalised coordinates; rows in the place of older ones.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.analysis.survey import survey
from meshreel.geometry.topology import weld
from meshreel.io.sequence import SequenceOptions, open_sequence
from meshreel.types import Mesh, MeshList

ROWS = Path(__file__).resolve().parents[1] / "docs" / "decisions" / "measured.jsonl"
Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Case:
    """Which frames of a performer, and the key among them."""

    performer: str
    first: int = 0
    count: int = 10
    stride: int = 1
    key: int = 5

    @property
    def name(self) -> str:
        """What the table calls it."""
        last = self.first + self.stride * (self.count - 1)
        every = f", every {self.stride}." if self.stride > 1 else ""
        return f"{self.performer} {self.first}-{last}{every}, key {self.first + self.stride * self.key}"


def asked_cases(description: str | None, cases: Sequence[Case]) -> Iterator[tuple[Case, list[Mesh]]]:
    """The cases that the command line asks for, with their frames."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--data", type=Path, required=True, help="the folder of the performers")
    parser.add_argument("performers", nargs="*", help="all if none is named")
    given = parser.parse_args()
    for case in cases:
        if not given.performers or case.performer in given.performers:
            yield case, frames_of(case, given.data)


def frames_of(case: Case, data: Path) -> list[Mesh]:
    """The case's frames in normalised coordinates; a performer in one file loses its vertices' order."""
    numbers = range(case.first, case.first + case.stride * case.count, case.stride)
    packed = data / f"{case.performer}.npz"
    source = packed if packed.is_file() else data / case.performer
    sequence = open_sequence(source, SequenceOptions(weld=weld))
    meshes = MeshList(tuple(sequence[n] for n in numbers))
    seen = survey(meshes)
    frames = [seen.normalise(mesh) for mesh in meshes]
    return [shuffled(frame, n) for n, frame in enumerate(frames)] if packed.is_file() else frames


def shuffled(mesh: Mesh, seed: int) -> Mesh:
    """The mesh with its vertices in another order."""
    order = np.random.default_rng(seed).permutation(len(mesh.vertices))
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return Mesh.of(mesh.vertices[order], rank[mesh.faces])


def keep(measured: Iterable[Row], *names: str) -> None:
    """Prints rows as they come, then puts them into measured.jsonl.

    They take the place of those of the same decision that agree in these names.
    """
    rows = list[Row]()
    for row in measured:
        print("  ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{v}" for k, v in row.items()), flush=True)
        rows.append(row)
    same = {_where(row, names) for row in rows}
    lines = ROWS.read_text(encoding="utf-8").splitlines()
    others = [line for line in lines if _where(json.loads(line), names) not in same]
    new = ROWS.with_suffix(".new")
    new.write_text("\n".join([*others, *map(json.dumps, rows)]) + "\n", encoding="utf-8")
    new.replace(ROWS)


def _where(row: Row, names: Sequence[str]) -> tuple[object, ...]:
    return tuple(row.get(name) for name in ("decision", *names))
