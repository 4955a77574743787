"""What the commands' tests share: small inputs, and a way to run a command and see all it says."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from meshreel.capture.procedural import sliding_sphere
from meshreel.cli import main
from meshreel.io.write import write_mesh
from tests.golden import GOLDEN
from tests.small_options import quick

FILE = GOLDEN / "mixed.reel"
SCENE = GOLDEN / "scene.reel"


@dataclass(frozen=True)
class Said:
    """What a command answered."""

    code: int
    out: str
    err: str

    @property
    def row(self) -> dict[str, Any]:
        """Its JSON, which must be one strict object on one line."""
        assert self.out.count("\n") == 1
        row: dict[str, Any] = json.loads(self.out, parse_constant=lambda name: pytest.fail(name))
        return row


@pytest.fixture
def run(capsys):
    """Runs a command line in this process."""

    def call(*arguments: str | Path) -> Said:
        code = main([str(argument) for argument in arguments])
        said = capsys.readouterr()
        return Said(code, said.out, said.err)

    return call


@pytest.fixture
def quick_presets(monkeypatch):
    """`encode` and `demo` with options that suit tests."""
    monkeypatch.setattr("meshreel.cli.encode.preset_options", quick)
    monkeypatch.setattr("meshreel.cli.demo.preset_options", quick)


@pytest.fixture(scope="session")
def balls(tmp_path_factory) -> Path:
    """A folder of three PLY files of a ball that slides."""
    folder = tmp_path_factory.mktemp("balls")
    for number, mesh in enumerate(sliding_sphere(3, levels=2)):
        write_mesh(mesh, folder / f"ball_{number}.ply")
    return folder


@pytest.fixture(scope="session")
def archive(tmp_path_factory) -> Path:
    """The same ball as one .npz."""
    balls = sliding_sphere(2, levels=2)
    path = tmp_path_factory.mktemp("archive") / "balls.npz"
    np.savez(path, vertices=np.stack([mesh.vertices for mesh in balls]), faces=balls[0].faces)
    return path


def failed(said: Said, *words: str) -> bool:
    """One line of error that has these words, nothing else, exit code 2."""
    assert said.code == 2
    assert said.out == ""
    assert said.err.startswith("meshreel: error: ") and said.err.count("\n") == 1
    assert all(word in said.err for word in words), said.err
    return True
