"""Learns the basis offline: `python -m meshreel_bench.codecs.klt_tsdf.train FILE` writes the package data.

Blocks of procedural bodies, spheres, boxes and cylinders at several voxel sizes, turned and placed by a fixed seed; no
captured sequence is among them. The covariance is that of all 48 symmetries of the cube. Where a distance is beyond
truncation it says no more than its sign and that it is large: the mean and the covariance are found by expectation
maximisation around these (as by Tang et al., who learn on distances that are not truncated).
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from meshreel.capture.procedural import SoftBodiesOptions, deforming_sphere, soft_bodies
from meshreel.geometry.topology import subdivide_midpoint, vertex_normals
from meshreel.types import Mesh

from .basis import COEFFICIENT, MOST, ONE, BasisSymbols, degrees, members, pack_learned, polynomials
from .grid import Blocks, prepared, sample
from .weights import beyond, trust

SEED = 2018
ROUNDS = 4
EACH = 220  # blocks of a mesh, at most
NOISE = 0.005  # voxels squared, of what the polynomials leave over
_CHUNK = 500


def train() -> bytes:
    """The package data."""
    generator = np.random.default_rng(SEED)
    found = [_some(sample(mesh), generator) for mesh in meshes(generator)]
    values = np.concatenate([blocks.values for blocks in found])
    weights = np.concatenate([trust(blocks) for blocks in found])
    return pack_learned(*_symbols(*_moments(values, weights)))


def meshes(generator: np.random.Generator) -> Iterator[Mesh]:
    """Surfaces in voxel units."""
    for frame in range(4):
        body = soft_bodies(SoftBodiesOptions(frames=1, spacing=0.016, begin=0.6 * frame, seed=frame))[0]
        for cells, amplitude in ((64, 0.5), (128, 0.5), (128, 0.0)):
            yield _wrinkled(_placed(body, cells, generator), amplitude, generator)
    ball = deforming_sphere(1, levels=5)[0]
    for radius in (3.0, 6.0, 12.0, 25.0):
        yield _placed(ball, 2 * np.sqrt(3) * radius, generator)
    for size in itertools.product((6.0, 20.0, 40.0), repeat=2):
        box = _box()
        yield _placed(Mesh(box.vertices * [*size, 30.0], box.faces), 0.0, generator)


def _placed(mesh: Mesh, cells: float, generator: np.random.Generator) -> Mesh:
    """The mesh turned and moved, `cells` along the diagonal; 0: as it is."""
    turn, _ = np.linalg.qr(generator.normal(size=(3, 3)))
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    scale = cells / mesh.diagonal if cells else 1.0
    return prepared(Mesh(scale * mesh.vertices @ turn.T + generator.uniform(0, 64, 3), mesh.faces))


def _wrinkled(mesh: Mesh, amplitude: float, generator: np.random.Generator) -> Mesh:
    """The mesh moved along its normals by waves of 5 to 20 voxels, `amplitude` voxels high: bodies wear cloth."""
    waves = generator.normal(size=(12, 3))
    waves *= (2 * np.pi / generator.uniform(5, 20, 12) / np.linalg.norm(waves, axis=1))[:, None]
    heights = np.sin(mesh.vertices @ waves.T + generator.uniform(0, 2 * np.pi, 12)).sum(axis=1) / np.sqrt(6)
    return Mesh(mesh.vertices + amplitude * heights[:, None] * vertex_normals(mesh), mesh.faces)


def _box() -> Mesh:
    corners = np.array(list(itertools.product((0, 1), repeat=3)), float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    return subdivide_midpoint(Mesh.of(corners - 0.5, faces), 2)


def _some(blocks: Blocks, generator: np.random.Generator) -> Blocks:
    chosen = np.sort(generator.permutation(len(blocks.places))[:EACH])
    return Blocks(blocks.places[chosen], blocks.values[chosen], blocks.known[chosen], blocks.near[chosen])


def _moments(
    values: Float64[np.ndarray, "B N"], weights: Float64[np.ndarray, "B N"]
) -> tuple[Float64[np.ndarray, " K"], Float64[np.ndarray, "K K"]]:
    """Mean and covariance of the blocks' coefficients in the polynomials, under all symmetries."""
    table = polynomials() / ONE
    mean, covariance = np.zeros(table.shape[1]), np.diag(100.0 / (1.0 + degrees().sum(axis=1)) ** 4)
    grams = [_gram(weights[k : k + _CHUNK], table) for k in range(0, len(values), _CHUNK)]
    fitted: np.ndarray | None = None
    for _ in range(ROUNDS):
        target = values if fitted is None else beyond(values, fitted @ table.T)
        right, precision = (weights * target) @ table / NOISE, np.linalg.inv(covariance)
        parts, spread = [], np.zeros_like(covariance)
        for k, gram in enumerate(grams):
            inverse = np.linalg.inv(gram + precision)
            parts.append(np.einsum("bij,bj->bi", inverse, right[k * _CHUNK : (k + 1) * _CHUNK] + precision @ mean))
            spread += inverse.sum(axis=0)
        fitted = np.concatenate(parts)
        mean = _even(fitted.mean(axis=0))
        centered = fitted - mean
        covariance = _symmetric((centered.T @ centered + spread) / len(fitted)) + 1e-6 * np.eye(len(mean))
    return mean, covariance


def _gram(weights: Float64[np.ndarray, "B N"], table: Float64[np.ndarray, "N K"]) -> Float64[np.ndarray, "B K K"]:
    """What the voxels of each block say of its coefficients: the normal equations' matrix."""
    return np.stack([(table * row[:, None]).T @ table / NOISE for row in weights])


def _even(mean: Float64[np.ndarray, " K"]) -> Float64[np.ndarray, " K"]:
    """The mean over all symmetries."""
    turned = np.mean([mean[order] for order in _orders()], axis=0)
    return np.where((degrees() % 2 == 0).all(axis=1), turned, 0.0)


def _symmetric(covariance: Float64[np.ndarray, "K K"]) -> Float64[np.ndarray, "K K"]:
    """The covariance over all symmetries: axes exchanged, and nothing in common between parities."""
    turned = np.mean([covariance[np.ix_(order, order)] for order in _orders()], axis=0)
    kinds = degrees() % 2 @ [4, 2, 1]
    return np.where(kinds[:, None] == kinds[None, :], turned, 0.0)


def _orders() -> list[np.ndarray]:
    """Where each polynomial goes when axes are exchanged."""
    place = {tuple(d): k for k, d in enumerate(degrees().tolist())}
    return [
        np.array([place[tuple(d[axis] for axis in order)] for d in degrees().tolist()])
        for order in itertools.permutations(range(3))
    ]


def _symbols(
    mean: Float64[np.ndarray, " K"], covariance: Float64[np.ndarray, "K K"]
) -> tuple[BasisSymbols, Float64[np.ndarray, " M"]]:
    """The strongest components of every parity class, as integers."""
    found = []
    for kind in range(8):
        rows = members(kind)
        energies, vectors = np.linalg.eigh(covariance[np.ix_(rows, rows)])
        signs = np.sign(vectors[np.abs(vectors).argmax(axis=0), np.arange(len(rows))])
        found += [(-energy, kind, vector) for energy, vector in zip(energies, (vectors * signs).T, strict=True)]
    found.sort(key=lambda one: (round(one[0], 9), one[1]))
    integers = [np.rint(vector * COEFFICIENT).astype(np.int32) for _, _, vector in found[:MOST]]
    first = np.rint(mean[members(0)] * COEFFICIENT).astype(np.int32)
    classes = np.array([kind for _, kind, _ in found[:MOST]], np.int32)
    return BasisSymbols(classes, (first, *integers)), np.array([-energy for energy, _, _ in found[:MOST]])


if __name__ == "__main__":
    Path(sys.argv[1]).write_bytes(train())
