"""A box that is carried from one side of a room to the other: what it is before, on the way, and after."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.analysis.segment.cut import CutOptions
from meshreel.analysis.segment.places import PlacesOptions
from meshreel.analysis.segment.scene import ByPlace, SegmentOptions, segment
from meshreel.analysis.segment.settle import NEVER, SettleOptions
from meshreel.analysis.segment.views import ViewsOptions
from meshreel.decoder import open as open_video
from meshreel.encoder import encode
from meshreel.errors import InputError
from meshreel.geometry.nearest import Surface
from meshreel.geometry.topology import concatenate, subdivide_midpoint, weld
from meshreel.presets import preset_options
from meshreel.types import Mesh, MeshList

FRAMES, LIFTED, PUT = 28, 9, 18  # at 4 frames a second
OPTIONS = SegmentOptions(
    views=ViewsOptions(count=8, width=160, height=120),
    places=PlacesOptions(frames=28),
    cut=CutOptions(least=0.1),
    settle=SettleOptions(rest=1.5, least=0.1),
)


def sheet(corner: tuple[float, ...], along: tuple[float, ...], across: tuple[float, ...], levels: int) -> Mesh:
    """A parallelogram of triangles."""
    a, b, c = (np.array(v, dtype=float) for v in (corner, along, across))
    square = Mesh.of([a, a + b, a + b + c, a + c], [(0, 1, 2), (0, 2, 3)])
    return subdivide_midpoint(square, levels)


def box(middle: tuple[float, float, float], size: float = 0.4) -> Mesh:
    """The five sides of a box that stands on the floor, seen from outside."""
    x, y, z = (value - size / 2 for value in middle)
    s = size
    sides = [
        sheet((x, y + s, z), (0, 0, s), (s, 0, 0), 3),
        sheet((x, y, z), (0, s, 0), (s, 0, 0), 3),
        sheet((x, y, z + s), (s, 0, 0), (0, s, 0), 3),
        sheet((x, y, z), (0, 0, s), (0, s, 0), 3),
        sheet((x + s, y, z), (0, s, 0), (0, 0, s), 3),
    ]
    return weld(concatenate(sides))


def frame(number: int) -> Mesh:
    floor = sheet((0, 0, 0), (0, 0, 2), (2.4, 0, 0), 5)
    wall = sheet((0, 0, 0), (2.4, 0, 0), (0, 1.4, 0), 5)
    share = np.clip((number - LIFTED) / (PUT - LIFTED), 0, 1)
    lifted = 0.4 * np.sin(np.pi * share)
    return concatenate([floor, wall, box((0.5 + 1.3 * share, 0.2 + lifted, 1.0))])


@pytest.fixture(scope="module")
def scene() -> MeshList:
    return MeshList(tuple(frame(number) for number in range(FRAMES)), 4.0)


@pytest.fixture(scope="module")
def found(scene: MeshList) -> ByPlace:
    return segment(scene, OPTIONS)


ROOM = 2 * 2048  # faces of floor and wall, which come first


def test_a_box_moves_only_while_it_is_carried(scene: MeshList, found: ByPlace) -> None:
    shares = [found.moving(number, scene[number])[ROOM:].mean() for number in range(FRAMES)]
    assert max(shares[: LIFTED - 1] + shares[PUT + 2 :]) < 0.05
    assert min(shares[LIFTED + 2 : PUT - 1]) > 0.95
    assert all(found.moving(number, scene[number])[:ROOM].mean() < 0.02 for number in range(0, FRAMES, 5))


def test_without_enough_rest_it_moves_always(scene: MeshList) -> None:
    options = replace(OPTIONS, settle=SettleOptions(rest=20.0))
    found = segment(scene, options)
    assert found.rest.changes == []
    assert found.moving(0, scene[0])[ROOM:].mean() > 0.9


def test_changes_are_two_of_the_frames(found: ByPlace) -> None:
    gone, came = found.rest.changes
    assert LIFTED - 1 <= gone <= LIFTED + 3
    assert PUT - 2 <= came <= PUT + 1
    assert (found.rest.since[~found.chosen] == NEVER).all()


def test_the_file_has_a_patch_for_each_change(scene: MeshList, tmp_path) -> None:
    options = replace(preset_options(quality=30), segment=OPTIONS)
    summary = encode(scene, tmp_path / "box.reel", options)
    assert summary.scene is not None
    with open_video(tmp_path / "box.reel") as video:
        for number in (0, FRAMES - 1):
            gaps = Surface(video.background(number)).closest(scene[number].vertices).points - scene[number].vertices
            assert np.quantile(np.linalg.norm(gaps, axis=1), 0.99) < 0.03
        moved = Surface(video.background(FRAMES - 1)).closest(box((0.5, 0.2, 1.0)).vertices).points
        assert np.linalg.norm(moved - box((0.5, 0.2, 1.0)).vertices, axis=1).max() > 0.15  # nothing stands there now
        for number in range(0, FRAMES, 3):
            gaps = Surface(video[number]).closest(scene[number].vertices).points - scene[number].vertices
            assert np.quantile(np.linalg.norm(gaps, axis=1), 0.97) < 0.04


@pytest.mark.parametrize("wrong", [{"rest": 0.0}, {"share": 0.0}, {"least": -1.0}])
def test_options_are_checked(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match="change of the room"):
        SettleOptions(**wrong)
