"""Rows behind docs/decisions and the captured frames that they are measured on, in normalised coordinates."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.analysis.survey import survey
from meshreel.coding.group import continue_group
from meshreel.coding.layers.coder import LayersState
from meshreel.encoder.forms import EncodedGroup
from meshreel.geometry.topology import weld
from meshreel.io.sequence import SequenceOptions, open_sequence
from meshreel.types import Mesh, MeshList

Row = dict[str, Any]
PERFORMERS = "performers"  # folder of captured bodies below the benchmark data
FRAME_RATE = 30.0  # Hz, of the captured bodies


@dataclass(frozen=True, slots=True)
class Sources:
    """Folders that decisions are measured from."""

    data: Path  # benchmark data
    cache: Path  # captured scenes, made where they are missing


@dataclass(frozen=True, slots=True)
class Case:
    """Some frames of a performer, and the key frame among them."""

    performer: str
    first: int = 0
    count: int = 10
    stride: int = 1
    key: int = 5

    @property
    def name(self) -> str:
        """The label of the case in tables."""
        last = self.first + self.stride * (self.count - 1)
        every = f", every {self.stride}." if self.stride > 1 else ""
        return f"{self.performer} {self.first}-{last}{every}, key {self.first + self.stride * self.key}"

    def frames(self, data: Path) -> list[Mesh]:
        """Return the frames, normalised; a capture in one file gets its vertices shuffled: frames share no order."""
        packed = data / PERFORMERS / f"{self.performer}.npz"
        source = packed if packed.is_file() else packed.with_suffix("")
        sequence = open_sequence(source, SequenceOptions(weld=weld))
        numbers = range(self.first, self.first + self.stride * self.count, self.stride)
        meshes = MeshList(tuple(sequence[n] for n in numbers))
        seen = survey(meshes)
        frames = [seen.normalise(mesh) for mesh in meshes]
        return [_shuffled(frame, n) for n, frame in enumerate(frames)] if packed.is_file() else frames


def _shuffled(mesh: Mesh, seed: int) -> Mesh:
    order = np.random.default_rng(seed).permutation(len(mesh.vertices))
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return Mesh.of(mesh.vertices[order], rank[mesh.faces])


def mbps_of(size: int, frames: int) -> float:
    """Return the rate of `size` bytes for that many frames of a captured body, Mbps."""
    return size * 8 * FRAME_RATE / frames / 1e6


def decoded(groups: Sequence[EncodedGroup]) -> Iterator[list[Mesh]]:
    """Yield the frames of each group of a body."""
    state: LayersState | None = None
    for group in groups:
        meshes, state = continue_group(group.payload, group.frame_count, None, state)
        yield meshes


def read(file: Path) -> list[Row]:
    """Return all rows of a file."""
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def replace_rows(file: Path, decision: str, measured: Iterable[Row]) -> None:
    """Put rows of a decision in the place of its older ones, once all of them are measured; print each as it comes."""
    rows = list[Row]()
    for row in measured:
        rows.append({"decision": decision} | row)
        print("  ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{v}" for k, v in row.items()), flush=True)
    before = read(file)
    at = next((n for n, row in enumerate(before) if row["decision"] == decision), len(before))
    first, last = ([row for row in some if row["decision"] != decision] for some in (before[:at], before[at:]))
    new = file.with_suffix(".new")
    new.write_text("".join(json.dumps(row) + "\n" for row in [*first, *rows, *last]), encoding="utf-8")
    new.replace(file)
