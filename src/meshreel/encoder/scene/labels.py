"""Labels of a scene's faces: which faces move, and with which body (paper, section 3.2).

In: frames of a scene, and its segmentation. Out: labels, frame by frame; the frames of a key interval are in memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, UInt16
from scipy.spatial import cKDTree

from ...analysis.scene.bodies import NEAR, with_ring
from ...analysis.scene.labelling import Segmentation
from ...geometry.topology import part_of
from ...types import Mesh, MeshSequence
from ..settings.options import EncoderOptions
from .scene import Tracks, key_intervals


@dataclass(frozen=True, slots=True)
class FrameLabels:
    """Labels of the faces of one frame."""

    moving: Bool[np.ndarray, " F"]
    bodies: UInt16[np.ndarray, " F"]  # 1 + the track that has the face; 0: it stands still, or belongs to no body


def label_frames(sequence: MeshSequence, segmentation: Segmentation, options: EncoderOptions) -> Iterator[FrameLabels]:
    """Yield the labels of each frame; a body has the same number in all frames."""
    cell = segmentation.cell
    tracks = Tracks(cell, options.scene.near if options.scene else NEAR)
    for frames in key_intervals(sequence, segmentation, options):
        moving = list[Bool[np.ndarray, " F"]]()
        parts, coded = list[Mesh](), list[Mesh]()
        for number in frames:
            mesh = sequence[number]
            moving.append(segmentation.moving(number, mesh))
            parts.append(part_of(mesh, moving[-1]))
            coded.append(with_ring(mesh, moving[-1], cell))
        bodies = tracks.of(coded)
        for place, (chosen, part) in enumerate(zip(moving, parts, strict=True)):
            labels = np.zeros(len(chosen), np.uint16)
            labels[chosen] = _numbers(part, [(track + 1, meshes[place]) for track, meshes in bodies])
            yield FrameLabels(chosen, labels)


def _numbers(part: Mesh, bodies: list[tuple[int, Mesh]]) -> UInt16[np.ndarray, " F"]:
    """Return the number of the body that has each moving face; bodies are connected pieces and a ring around them."""
    found = np.zeros(len(part.faces), np.uint16)
    corners = part.vertices[part.faces[:, 0]]
    for number, body in bodies:
        if not body.is_empty and len(corners):
            found[cKDTree(body.vertices).query(corners)[0] == 0] = number  # a body has the frame's vertices
    return found
