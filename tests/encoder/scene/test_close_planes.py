"""A room that closes: below one who never leaves the floor goes on; a hatch that a camera saw through stays open."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.analysis.scene.standing import LocalNoise
from meshreel.capture.recording import FusionOptions, open_recording
from meshreel.capture.simulated.demo_room import box, joined, panel
from meshreel.capture.simulated.sensors import SensorOptions
from meshreel.capture.simulated.simulated_rig import ColorSensorOptions, SceneFrame, corner_cameras, simulate_rig
from meshreel.decoder.describe import describe_file
from meshreel.encoder.scene.parts import Change, _closed, pack_parts, unpack_parts
from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.settings import Settings
from meshreel.geometry.cameras import Camera, CameraPose
from meshreel.geometry.depth import DepthPicture, FreeSpace
from meshreel.geometry.drawing import draw
from meshreel.geometry.topology import face_means, face_normals
from meshreel.types import Mesh
from tests.geometry.test_planes import NOISE, sheet

VOXEL, FRAMES = 0.05, 6
LOW, HIGH = (-0.7, -0.5), (0.1, 0.3)  # m, corners of the plate, along x and z
STILL = joined(
    [
        panel((-1.2, 0, 1.2), (2.4, 0, 0), (0, 0, -2.4)),  # the floor
        panel((-1.2, 0, -1.2), (1.0, 0, 0), (0, 1.6, 0)),  # the wall, with a hatch
        panel((0.5, 0, -1.2), (0.7, 0, 0), (0, 1.6, 0)),
        panel((-0.2, 1.1, -1.2), (0.7, 0, 0), (0, 0.5, 0)),
        panel((-0.2, 0, -1.2), (0.7, 0, 0), (0, 0.4, 0)),
    ]
)
BEHIND = panel((-1.5, -0.6, -2.2), (3.0, 0, 0), (0, 2.2, 0))  # what is seen through the hatch
ROOM, PLATE = (200.0, 40.0, 40.0), (40.0, 40.0, 200.0)  # colours
CLOSED = Settings(close_planes=True, effort="fast", color="vertices").resolved()


def painted(still: list[Mesh], plate: Mesh) -> SceneFrame:
    frame = SceneFrame.of(still, [plate])
    paint = lambda _, faces: np.where(frame.dynamic[faces, None], PLATE, ROOM)  # noqa: E731
    return replace(frame, paint=paint, is_lit=True)


@pytest.fixture(scope="module")
def encoder(tmp_path_factory) -> Encoder:
    """Encoder of a room with a plate that rises and falls over its spot."""
    folder: Path = tmp_path_factory.mktemp("rig")
    heights = 0.15 + 0.1 * np.sin(2 * np.pi * np.arange(FRAMES) / FRAMES)
    plates = [box(((LOW[0], y, LOW[1]), (HIGH[0], y + 0.05, HIGH[1]))) for y in heights]
    frames = [painted([STILL, BEHIND], plate) for plate in plates]
    cameras = corner_cameras(np.array([-1.1, 0, -1.0]), np.array([1.1, 1.8, 1.4]), 112)[:2]
    color = ColorSensorOptions(scale=1.0, noise=0.0)
    simulate_rig(folder, frames, cameras, 10.0, SensorOptions(noise=0.3), color=color)
    return Encoder(open_recording(folder, FusionOptions(VOXEL))[0])


@pytest.mark.parametrize(
    ("depth", "comes_later", "closes"),
    [(2.0, False, True), (5.0, False, False), (0.0, False, False), (2.0, True, False)],
)
def test_a_hole_is_closed_where_something_hides_it_and_nothing_comes(depth, comes_later, closes) -> None:
    """A camera three metres above a floor measures `depth` (m) where the hole is; 0: nothing."""
    floor, whole = sheet(np.zeros(2)), sheet()
    pose = CameraPose.of_camera(np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 3], [0, 0, 0, 1]]))
    camera = Camera(96, 96, (120.0, 120.0), (48.0, 48.0), pose)
    seen = draw(floor, camera).depth
    picture = DepthPicture(camera, np.where(np.isfinite(seen), seen, np.float32(depth)), 1.0, 10.0)
    noise = LocalNoise(np.zeros((1, 3)), np.full(1, 1.5 * NOISE), np.full(1, 1.5 * NOISE))
    changes = [Change(3, whole)] if comes_later else []
    found = _closed(floor, noise, [FreeSpace.of([picture])] * 3, changes)
    assert (len(found.faces) > len(floor.faces)) == closes


def test_the_floor_goes_on_below_the_plate_and_the_hatch_stays_open(encoder) -> None:
    parts = encoder.parts(CLOSED)
    assert parts is not None
    normals, areas = face_normals(parts.guessed)
    is_floor = normals[:, 1] > 0.8
    assert 0.5 < areas[is_floor].sum() < 1.2  # the plate has .64
    heights = np.abs(face_means(parts.guessed.vertices, parts.guessed.faces)[is_floor, 1])
    assert np.mean(heights <= parts.noise.mean) > 0.9
    x, y, z = parts.guessed.vertices.T
    assert not ((np.abs(x - 0.15) < 0.25) & (np.abs(y - 0.75) < 0.25) & (z < -1)).any()


def test_without_the_option_the_background_is_what_was_seen(encoder) -> None:
    seen = encoder.parts(replace(CLOSED, scene=replace(CLOSED.scene, close_planes=False)))
    closed = encoder.parts(CLOSED)
    assert seen.guesses == 0 < closed.guesses
    np.testing.assert_array_equal(closed.background.faces[: -closed.guesses], seen.background.faces)
    np.testing.assert_array_equal(closed.background.vertices[: len(seen.background.vertices)], seen.background.vertices)


def test_an_encode_that_goes_on_knows_what_is_guessed(encoder) -> None:
    parts = encoder.parts(CLOSED)
    again = unpack_parts(pack_parts(parts), encoder.sequence, parts.survey)
    assert again.guesses == parts.guesses


def test_a_file_says_how_much_is_guessed_and_what_is_has_the_colours_around_it(encoder, tmp_path, monkeypatch) -> None:
    def before_it(looks, _, points, __):
        """Cameras show the plate where the floor is guessed."""
        colors = np.where(looks.guessed(points)[:, None], PLATE, ROOM).astype(np.uint8)
        return colors, np.ones(len(points), bool)

    monkeypatch.setattr("meshreel.encoder.scene.static._Looks.colors", before_it)
    summary = encoder.encode(tmp_path / "a.reel", CLOSED)
    area = face_normals(encoder.parts(CLOSED).guessed)[1].sum()
    assert summary.scene.guessed == area
    assert describe_file(tmp_path / "a.reel")["metadata"]["guessed_m2"] == pytest.approx(area, rel=1e-3)
    with meshreel.open(tmp_path / "a.reel") as video:
        shown = video.background(0)
        x, y, z = shown.vertices.T
        below = (np.abs(x - np.mean([LOW[0], HIGH[0]])) < 0.3) & (np.abs(z - np.mean([LOW[1], HIGH[1]])) < 0.3)
        colors = shown.colors[below & (np.abs(y) < 0.03)].astype(int)
        assert len(colors) and np.abs(colors - ROOM).max() < 60
        meshreel.edit.transform(tmp_path / "a.reel", tmp_path / "b.reel", scale=2)
    assert describe_file(tmp_path / "b.reel")["metadata"]["guessed_m2"] == pytest.approx(4 * area, rel=1e-3)
