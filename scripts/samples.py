"""Make the recordings of the gallery, docs/samples: procedural, so that no person is in them, and free for any use.

`python scripts/samples.py [NAME...]` writes those that are named, or all. It takes minutes; `splats` needs torch.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import meshreel
from meshreel.capture.recording import FusionOptions, open_recording
from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.capture.simulated.stage import VOXEL, Stage, StageOptions, record_stage, stage
from meshreel.types import Mesh, MeshList

SAMPLES = Path(__file__).resolve().parents[1] / "docs" / "samples"
LICENSE = "CC0-1.0"


def room(path: Path) -> None:
    """Encode the demo's scene as four depth cameras see it."""
    with TemporaryDirectory() as folder:
        record_stage(rig := Path(folder) / "rig", StageOptions())
        recording, _ = open_recording(rig, FusionOptions(VOXEL))
        meshreel.encode(recording, path, close_planes=True)


def person(path: Path) -> None:
    """Encode the woman of that scene alone, as clean meshes with colours of vertices."""
    meshreel.encode(_woman(), path, quality=70)


def splats(path: Path) -> None:
    """Encode her with splats, which are fitted to the coloured meshes."""
    meshreel.encode(_woman(), path, splats=8000)


def long(path: Path) -> None:
    """Encode twenty seconds of a person, with other vertices and faces in each frame."""
    options = SoftBodiesOptions(frames=300, frame_rate=15.0, spacing=0.03, people=1)
    meshreel.encode(soft_bodies(options), path, effort="fast")


def _woman() -> MeshList:
    options = StageOptions()
    scene = stage(options)
    return MeshList(tuple(_colored(scene, number) for number in range(options.frames)), options.frame_rate)


def _colored(scene: Stage, number: int) -> Mesh:
    mesh = scene.people(number)[0]
    faces = np.zeros(len(mesh.vertices), np.int64)
    faces[mesh.faces.ravel()] = np.arange(mesh.faces.size) // 3  # a face of each vertex
    colors = scene.cast[0].colors(mesh, mesh.vertices, faces)
    return replace(mesh, colors=np.clip(np.rint(colors), 0, 255).astype(np.uint8))


MAKERS: dict[str, Callable[[Path], None]] = {each.__name__: each for each in (room, person, splats, long)}


def main(names: list[str]) -> None:
    SAMPLES.mkdir(exist_ok=True)
    for name in names or MAKERS:
        with TemporaryDirectory() as folder:
            MAKERS[name](made := Path(folder) / "made.reel")
            (path := SAMPLES / f"{name}.reel").unlink(missing_ok=True)
            meshreel.edit.tag(made, path, {"license": LICENSE})
        print(f"{path.name}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main(sys.argv[1:])
