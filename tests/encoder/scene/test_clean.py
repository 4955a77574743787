"""Scenes without noise: the background is surface of the frames as it is, and whatever else there is moves."""

from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.encoder.file.summary import Summary
from meshreel.encoder.sequence import encode
from meshreel.geometry.closest_points import distances
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh, MeshList
from tests.metrics.shapes import moved, plane, sphere
from tests.small_options import quick
from tests.small_scene import scene

FRONT = moved(plane(0.4, 6), (-0.2, 0.3, -0.995))  # 5 mm before the wall
MITE = moved(sphere(0.01, 2), (-0.5, 0.012, 0.5))


def front(number: int) -> Mesh:
    """The front of a drawer, which opens by 2 mm a frame."""
    return moved(FRONT, (0, 0, 0.002 * number))


def mite(number: int) -> Mesh:
    """A mite of 2 cm, which walks 3 cm a frame."""
    return moved(MITE, (0.03 * number, 0, 0))


def blink(number: int) -> Mesh:
    """A sheet that is turned up in one frame only."""
    return moved(FRONT, (0, 0, 0.03 * (number == 5)))


def encoded(path: Path, frames: list[Mesh], **options: object) -> tuple[meshreel.Video, Summary]:
    summary = encode(MeshList(tuple(frames), 10.0), path, options=quick(**options))
    return meshreel.open(path), summary


def away(points: np.ndarray, mesh: Mesh) -> float:
    """RMS distance of points from a mesh, m."""
    return float(np.sqrt((distances(points, mesh) ** 2).mean()))


@pytest.mark.parametrize(("thing", "most"), [(front, 0.002), (mite, 0.002), (blink, 0.002)])
def test_what_is_slow_or_small_or_brief_is_decoded_where_it_is(tmp_path, thing, most):
    room = scene(9, noise=0.0)
    frames = [concatenate([room[number], thing(number)]) for number in range(9)]
    video, summary = encoded(tmp_path / "a.reel", frames)
    assert summary.scene is not None and summary.scene.noise == 0 and not summary.warnings
    for number, mesh in enumerate(frames):
        assert away(thing(number).vertices, video[number]) < most
        assert away(mesh.vertices, video[number]) < most and away(video[number].vertices, mesh) < most


def test_it_is_nearer_than_bodies_are_for_few_more_bytes(tmp_path):
    """Errors are relative to what moves, not to the room."""
    frames = list(scene(9, noise=0.0))
    (video, summary), (bodies, alone) = (
        encoded(tmp_path / f"{dynamic}.reel", frames, dynamic_only=dynamic) for dynamic in (False, True)
    )
    assert summary.scene is not None and alone.scene is None and summary.size < 1.5 * alone.size
    off = [[away(mesh.vertices, shown) for mesh, shown in zip(frames, of, strict=True)] for of in (video, bodies)]
    assert max(off[0]) < max(off[1])


def test_where_nothing_moves_the_frame_is_the_background(tmp_path):
    still = [scene(1, noise=0.0)[0]] * 4
    video, summary = encoded(tmp_path / "a.reel", still)
    assert summary.scene is not None and summary.scene.tracks == 1
    assert away(still[0].vertices, video[3]) < 0.0015 and away(video[3].vertices, still[0]) < 0.0015
