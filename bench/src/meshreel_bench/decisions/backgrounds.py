"""Decision 19: the background of room2 from depth and from meshes, as fused, against the truth of a frame.

In: the captured scene and the labels that the encoder found. Out: a row for each kind of background.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from meshreel.analysis.scene.background import BackgroundOptions, fuse_background
from meshreel.analysis.scene.background_depth import Moment, fuse_still_depth
from meshreel.geometry.topology import drop_unreferenced
from meshreel.metrics.scene_accuracy import Scene, scene_row
from meshreel.types import Mesh, evenly

from ..datasets.scenes import FOUND, SceneData, open_scene, true_scene
from .rows import Row, Sources

VOXEL, FRAME = 0.02, 30  # m, as scenes are fused; the frame whose truth is compared
BASE = BackgroundOptions()
MESHES = replace(BASE, depth=False)
KINDS = {
    "meshes, ten frames, nothing past borders": replace(MESHES, frames=10, past=0.0, steady=99.0),
    "meshes, twenty frames, nothing past borders": replace(MESHES, past=0.0, steady=99.0),
    "meshes, half a voxel past borders": replace(MESHES, steady=99.0),
    "meshes, and steady": MESHES,
    "depth, all faces, the frames' voxels": replace(BASE, finer=1.0, facing=0.0),
    "depth, faces seen from the front": replace(BASE, finer=1.0),
    "depth, and finer voxels": BASE,
}
SHOWN = ("median_m", "covered", "d2_psnr_backward", "normal_error_deg")


def measure(sources: Sources) -> Iterator[Row]:
    """Yield a row for each kind."""
    scene = open_scene("room2", sources.data, sources.cache)
    numbers = {*evenly(len(scene.meshes), BASE.frames), *evenly(len(scene.meshes), 10)}
    labels = {number: scene.labels(number, FOUND) for number in sorted(numbers)}
    clean = true_scene(scene.truth, FRAME)
    for kind, options in KINDS.items():
        start = time.process_time()
        mesh = background(scene, options, labels)
        seconds = time.process_time() - start
        found = scene_row(clean, Scene(mesh, np.zeros(len(mesh.faces), bool), clean.sights, clean.options))
        shown = {name: found[f"background_{name}"] for name in SHOWN}
        yield {"kind": kind, "faces": len(mesh.faces), "cpu_s": seconds} | shown


def background(scene: SceneData, options: BackgroundOptions, labels: dict[int, np.ndarray]) -> Mesh:
    """Fuse the background as the encoder does, with labels that are known."""
    numbers = evenly(len(scene.meshes), options.frames)
    if options.depth:
        moments = (Moment(scene.meshes.depth[k], scene.meshes[k], ~labels[k]) for k in numbers)
        return fuse_still_depth(moments, VOXEL, options)
    still = (Mesh(mesh.vertices, mesh.faces[~labels[k]]) for k, mesh in ((k, scene.meshes[k]) for k in numbers))
    return fuse_background((drop_unreferenced(mesh) for mesh in still), VOXEL, options)
