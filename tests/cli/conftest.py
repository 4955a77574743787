"""Fixtures of the tests of commands: small inputs, and a function that runs a command and returns its output."""

import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from meshreel.analysis.scene.masks import write_views
from meshreel.analysis.scene.views import place_views
from meshreel.cli import main
from meshreel.geometry.drawing import draw
from meshreel.io.write import write_mesh, write_picture
from tests.capture.depth_scenes import camera, record
from tests.golden import GOLDEN
from tests.kept import kept
from tests.small_options import VIEWS, look_quickly, resolve_small
from tests.small_scene import ROOM_FACES, scene
from tests.spheres import sliding_sphere

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
def run(capsys, monkeypatch):
    """Runs a command line in this process, without the lines of progress that a busy machine would print."""
    monkeypatch.setattr("meshreel.cli.console.EVERY", 600.0)

    def call(*arguments: str | Path) -> Said:
        code = main([str(argument) for argument in arguments])
        said = capsys.readouterr()
        return Said(code, said.out, said.err)

    return call


@pytest.fixture
def quick_presets(monkeypatch):
    """`encode` and `demo` with options that suit tests."""
    resolve_small(monkeypatch.setattr)
    look_quickly(monkeypatch.setattr)


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


@pytest.fixture(scope="session")
def scan(tmp_path_factory) -> Path:
    """A folder of four PLY files of a room in which two balls move."""
    folder = tmp_path_factory.mktemp("scan")
    for number, mesh in enumerate(scene(4)):
        write_mesh(mesh, folder / f"frame_{number:05}.ply")
    return folder


@pytest.fixture(scope="session")
def painted(tmp_path_factory) -> Path:
    """Masks of these frames, and the cameras they are for: white where a ball is seen."""
    folder, frames = tmp_path_factory.mktemp("painted"), scene(4)
    views = place_views(frames, "y", *VIEWS)
    write_views(folder, frames, views)
    for number, mesh in enumerate(frames):
        for view, own in enumerate(views):
            mask = np.where(draw(mesh, own).faces >= ROOM_FACES, 255, 0).astype(np.uint8)
            write_picture(mask, folder / f"view{view:02}" / f"frame_{number:05}.png")
    return folder


@pytest.fixture
def rig(tmp_path) -> Path:
    """The recording of a ball before a wall by two still cameras: three frames, 15 a second."""
    near = {"focal": (150.0, 150.0)}
    cameras = [camera("front", **near), camera("left", 20, **near)]
    return record(tmp_path / "rig", cameras, [(x, 0, 0) for x in (-0.3, 0, 0.3)])


def encode_once(run, source: Path, path: Path, *flags: str | Path) -> Path:
    """Encode by a command, or copy what one with equal inputs and flags has written; return the path."""

    def encode(made: Path) -> None:
        assert run("encode", source, "-o", made, *flags).code == 0

    made, _ = kept(encode, path.name, source, *flags)
    return Path(shutil.copy(made, path))


def failed(said: Said, *words: str) -> bool:
    """One line of error that has these words, nothing else, exit code 2."""
    assert said.code == 2
    assert said.out == ""
    assert said.err.startswith("meshreel: error: ") and said.err.count("\n") == 1
    assert all(word in said.err for word in words), said.err
    return True
