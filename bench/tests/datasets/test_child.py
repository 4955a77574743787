"""The child: the same surface in every camera, and cameras that err."""

from __future__ import annotations

import numpy as np
from meshreel_bench.datasets import CHILD, Store


def test_cameras_err_in_exposure_and_pose_and_the_clean_pictures_do_not(tmp_path):
    known = Store(tmp_path, tmp_path).open(CHILD, 1)
    [mesh], taken, clean = list(known.sequence), known.sequence.colors[0], known.pictures[0]
    assert len(known.cameras) == len(taken) == len(clean) == 6 and 1 < mesh.vertices[:, 1].max() < 1.5
    ratios, turns = [], []
    for one, other in zip(taken, clean, strict=True):
        seen = (other.pixels.min(axis=2) > 20) & (one.pixels.min(axis=2) > 20)
        assert 0.02 < seen.mean() < 0.5  # the child is in the picture
        ratios.append(float(one.pixels[seen].mean() / other.pixels[seen].mean()))
        turn = one.camera.extrinsic[:3, :3] @ other.camera.extrinsic[:3, :3].T
        turns.append(np.degrees(np.arccos(min(1.0, (np.trace(turn) - 1) / 2))))
    assert 0.01 < np.std(ratios) < 0.12 and 0.05 < np.mean(turns) < 0.8
