"""Splats of all kinds, for tests."""

import numpy as np

from meshreel.geometry.splats import Splats


def some_splats(count: int, faces: int, seed: int = 3) -> Splats:
    """Return splats at random places on so many faces."""
    random = np.random.default_rng(seed)
    scales = np.sort(np.exp(random.normal(-5, 0.4, (count, 2))), axis=1)[:, ::-1].copy()
    return Splats(
        random.integers(0, faces, count).astype(np.int32),
        random.dirichlet(np.ones(3), count)[:, 1:].copy(),
        random.normal(0, 1e-3, count),
        random.uniform(0, np.pi, count),
        scales,
        random.uniform(0.1, 1, count),
        random.uniform(0, 1, (count, 3)),
    )
