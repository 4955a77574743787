"""The background of room2 from depth and from meshes, against the truth of one frame, before it is made small.

python benchmarks/backgrounds.py --cache docs/results/scenes.cache      # five minutes; the folder of `bench run scenes`

Out: the rows `backgrounds` of docs/decisions/measured.jsonl.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from captured import Row, keep
from meshreel_bench.datasets.scenes import FOUND, SceneData, open_scene

from meshreel.analysis.scene.background import BackgroundOptions, fuse_background
from meshreel.analysis.scene.background_depth import fuse_still_depth
from meshreel.geometry.topology import drop_unreferenced
from meshreel.metrics.scene_accuracy import Scene, scene_row
from meshreel.metrics.scene_comparison import true_scene
from meshreel.types import Mesh, evenly

DECISION, VOXEL, FRAME = "backgrounds", 0.02, 30
BASE = BackgroundOptions()
MESHES = replace(BASE, depth=False)
LOOSE = {"past": 0.0, "steady": 99.0}
KINDS = {
    "meshes, ten frames, nothing past borders": replace(MESHES, frames=10, **LOOSE),
    "meshes, twenty frames, nothing past borders": replace(MESHES, **LOOSE),
    "meshes, half a voxel past borders": replace(MESHES, steady=99.0),
    "meshes, and steady": MESHES,
    "depth, all faces, the frames' voxels": replace(BASE, finer=1.0, facing=0.0),
    "depth, faces seen from the front": replace(BASE, finer=1.0),
    "depth, and finer voxels": BASE,
}
SHOWN = ("median_m", "covered", "d2_psnr_backward", "normal_error_deg")


def main() -> int:
    """Measures every kind and puts the rows in the place of older ones."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    arguments = parser.parse_args()
    scene = open_scene("room2", arguments.data, arguments.cache)
    labels = {number: scene.labels(number, FOUND) for number in evenly(len(scene.meshes), BASE.frames)}
    labels |= {number: scene.labels(number, FOUND) for number in evenly(len(scene.meshes), 10)}
    keep((row(scene, kind, options, labels) for kind, options in KINDS.items()), "kind")
    return 0


def row(scene: SceneData, kind: str, options: BackgroundOptions, labels: dict[int, np.ndarray]) -> Row:
    """One kind of background against the truth."""
    start = time.process_time()
    mesh = background(scene, options, labels)
    seconds = time.process_time() - start
    clean = true_scene(scene.truth, FRAME)
    found = scene_row(clean, Scene(mesh, np.zeros(len(mesh.faces), bool), clean.sights, clean.options))
    shown = {name: found[f"background_{name}"] for name in SHOWN}
    return {"decision": DECISION, "kind": kind, "faces": len(mesh.faces), "cpu_s": seconds} | shown


def background(scene: SceneData, options: BackgroundOptions, labels: dict[int, np.ndarray]) -> Mesh:
    """As the encoder fuses it, with labels that are known."""
    numbers = evenly(len(scene.meshes), options.frames)
    if options.depth:
        moments = ((scene.meshes.pictures(k), scene.meshes[k], ~labels[k]) for k in numbers)
        return fuse_still_depth(moments, VOXEL, options)
    still = (Mesh(mesh.vertices, mesh.faces[~labels[k]]) for k, mesh in ((k, scene.meshes[k]) for k in numbers))
    return fuse_background((drop_unreferenced(mesh) for mesh in still), VOXEL, options)


if __name__ == "__main__":
    sys.exit(main())
