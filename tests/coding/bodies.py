"""Small groups for tests of the form `layers`: coded references, and the desired positions of their vertices."""

import numpy as np

from meshreel.coding.mesh import CodedReference, code_reference
from meshreel.types import Mesh

from .paper.test_laplacian import icosahedron


def ball(levels: int = 2, bits: int = 10) -> CodedReference:
    """A sphere of 162 vertices."""
    sphere = icosahedron(2)
    return code_reference(Mesh.of(0.3 * sphere.vertices, sphere.faces), bits, levels)


def sheet(side: int = 9, levels: int = 2) -> CodedReference:
    """A square with an open border, and a smaller one apart from it."""
    x, y = (axis.reshape(-1) / side for axis in np.meshgrid(np.arange(side), np.arange(side)))
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1)
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + side], 1), np.stack([corner + 1, corner + side + 1, corner + side], 1)]
    )
    points = np.stack([x, y, 0.1 * np.sin(4 * x) * np.cos(3 * y)], axis=1) * 0.5
    both = Mesh.of(np.concatenate([points, 0.3 * points + [0, 0, 0.3]]), np.concatenate([faces, faces + side * side]))
    return code_reference(both, 10, levels)


def moving(reference: CodedReference, frames: int, start: int = 0, noise: float = 2e-4) -> np.ndarray:
    """Smooth motion of the subdivided reference with round bulges on it and a little noise; T x V x 3."""
    x = reference.base.vertices
    t = start + np.arange(frames)[:, None, None]
    generator = np.random.default_rng(start)
    wave = 0.02 * np.sin(5 * x[None, :, [1, 2, 0]] + 0.3 * t) + 0.004 * np.sin(40 * x)[None]
    return x + 0.01 * t * x + wave + noise * generator.normal(size=(frames, *x.shape))
