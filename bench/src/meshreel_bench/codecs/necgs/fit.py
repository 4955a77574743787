"""Fit of a TSDF-Def volume to a mesh (NeCGS, section 3.1, eq. 1), in cells. Needs the extra `necgs`.

Adam reduces the squared distances between the extracted surface and the mesh, both ways, and the deformations.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float32
from torch import Tensor

from meshreel.geometry.closest_points import Surface
from meshreel.metrics.even_points import scatter
from meshreel.types import Mesh

from .cubes import cut, grid_points, place
from .network import repeatable

RATE = 0.01  # of Adam; a guess
SHORT = 1e-3  # weight of the deformations' mean size; a guess
_SAMPLES = 4.0  # points of the mesh per vertex of the first surface
_MOST_SAMPLES = 60_000


def fit_volume(distances: Float32[np.ndarray, "K K K"], mesh: Mesh, steps: int) -> Float32[np.ndarray, "K K K 4"]:
    """Return the volume after `steps` steps from zero deformations."""
    start = np.concatenate([distances[..., None], np.zeros((*distances.shape, 3), np.float32)], axis=-1)
    first = cut(distances[None])
    if steps == 0 or not len(first.faces):
        return start
    surface = Surface(mesh)
    count = int(min(_SAMPLES * len(first.low), _MOST_SAMPLES))
    samples = scatter(mesh, np.ones(len(mesh.faces), bool), count).points
    return _descended(start, surface, samples, steps)


@repeatable()
def _descended(start: np.ndarray, surface: Surface, samples: np.ndarray, steps: int) -> np.ndarray:
    volume = torch.from_numpy(start).reshape(-1, 4).requires_grad_()
    adam = torch.optim.Adam([volume], lr=RATE)
    for step in range(steps):
        adam.param_groups[0]["lr"] = RATE * 10 ** (-step / max(steps, 1))
        error = _error(volume, start.shape[0], surface, samples)
        if error is None:
            break
        adam.zero_grad()
        error.backward()
        adam.step()
        with torch.no_grad():
            volume.clamp_(-1, 1)
    return volume.detach().numpy().reshape(start.shape)


def _error(volume: Tensor, resolution: int, surface: Surface, samples: np.ndarray) -> Tensor | None:
    """Return squared distances both ways, cells^2, plus the size of deformations; None if no surface is left."""
    found = cut(volume.detach()[:, 0].numpy().reshape((1, *(resolution,) * 3)))
    if not len(found.faces):
        return None
    low, high = volume[found.low], volume[found.high]
    ends = (torch.from_numpy(grid_points(n, resolution)) for n in (found.low, found.high))
    vertices = place(low.double(), high.double(), *ends)
    faces = torch.from_numpy(found.faces).long()
    points = torch.cat([vertices, vertices[faces].mean(dim=1)])
    there = torch.from_numpy(surface.closest(points.detach().numpy()).points)
    made = Mesh(np.ascontiguousarray(vertices.detach().numpy()), found.faces)
    hits = Surface(made).closest(samples)
    back = (torch.from_numpy(hits.barycentric)[..., None] * vertices[faces[torch.from_numpy(hits.faces)]]).sum(dim=1)
    size = torch.cat([low, high])[:, 1:].abs().mean()
    missed = ((points - there) ** 2).sum(dim=1).mean() + ((back - torch.from_numpy(samples)) ** 2).sum(dim=1).mean()
    return missed + SHORT * size
