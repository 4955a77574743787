"""A small body that moves, with colours of its vertices or a texture, and files of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.settings import Settings
from meshreel.geometry.derived_sequences import welded
from meshreel.types import Mesh, MeshList, Texture
from tests.kept import kept
from tests.small_bodies import body
from tests.small_options import quick

FRAMES = 6


def painted(mesh: Mesh, rest: Mesh) -> Mesh:
    """A mesh with colours that its vertices have wherever they go."""
    return replace(mesh, colors=(128 + 90 * np.sin(3 * rest.vertices + [0, 1, 2])).astype(np.uint8))


BODY = body(1, FRAMES)
COLORED = [painted(mesh, BODY[0]) for mesh in BODY]
CHECKS = ((np.indices((64, 64)) // 8).sum(axis=0) % 2 * 200).astype(np.uint8)[..., None].repeat(3, axis=2)


def textured(mesh: Mesh) -> Mesh:
    """A mesh with the texture of a chessboard, seen from the front."""
    flat = BODY[0].vertices[:, :2] / np.abs(BODY[0].vertices).max() / 2 + 0.5
    return replace(mesh, uv=flat[mesh.faces].astype(np.float32), texture=Texture.of(CHECKS))


def written(meshes: list[Mesh], color: str = "auto", compatible: bool = False, **others: object) -> Path:
    """The path of their file, which is written once and never changed."""
    appearance = Settings(color=color, compatible=compatible).resolved().appearance
    options = replace(quick(**others), appearance=appearance, scene=None)  # type: ignore[arg-type]

    def write(path: Path) -> None:
        Encoder(welded(MeshList(tuple(meshes)))).encode(path, options)

    return kept(write, "a.reel", meshes, options)[0]
