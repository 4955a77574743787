"""Sequences of unusual size, unit or number of pieces: what moves is where it was, whatever they are taken for."""

from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.encoder.sequence import encode
from meshreel.geometry.closest_points import distances
from meshreel.types import MeshList
from tests.scales import SCALES, Scale, room
from tests.small_options import quick


def worst(scale: Scale, video: meshreel.Video) -> float:
    """The RMS distance from what truly moves to what is decoded, in the worst frame."""
    step = max(1, len(scale.moving[0]) // 1000)
    away = [distances(vertices[::step], mesh) for vertices, mesh in zip(scale.moving, video, strict=True)]
    return max(float(np.sqrt((each**2).mean())) for each in away)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCALES)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_what_moves_is_where_it_was(name: str, tmp_path: Path):
    scale = SCALES[name]()
    encode(MeshList(tuple(scale.frames)), tmp_path / "a.reel", options=quick())
    with meshreel.open(tmp_path / "a.reel") as video:
        assert worst(scale, video) < scale.off


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_scan_that_is_too_small_for_a_room_is_encoded_as_bodies_and_one_line_says_so(tmp_path: Path):
    small = room().times(0.03)
    summary = encode(MeshList(tuple(small.frames)), tmp_path / "a.reel", options=quick())
    assert summary.scene is None and len([line for line in summary.warnings if "bodies" in line]) == 1
