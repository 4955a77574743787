"""A walk around people who move is a scene: they are what moves, the room behind them is whole and has no ghosts."""

import numpy as np
import pytest

import meshreel
from meshreel.analysis.scene.standing import scene_standing
from meshreel.capture.calibration.paths import refine_paths
from meshreel.capture.recording import FusionOptions, open_recording
from meshreel.capture.simulated.simulated_rig import TRUTH, read_truth
from meshreel.encoder.sequence import Encoder, encode
from meshreel.encoder.settings.settings import Settings
from meshreel.geometry.closest_points import Surface, carried_labels
from meshreel.geometry.topology import face_means, face_normals, part_of
from tests.capture.walks import record_walk

COUNT, FAST = 24, Settings(effort="fast").resolved()


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    folder = tmp_path_factory.mktemp("walk") / "rig"
    record_walk(folder, COUNT)
    refine_paths(folder)
    recording, _ = open_recording(folder, FusionOptions(0.03))
    return recording, read_truth(folder / TRUTH)


@pytest.fixture(scope="module")
def parts(walk):
    found = Encoder(walk[0]).parts(FAST)
    assert found is not None
    return found


def test_a_walk_is_a_scene(walk):
    standing = scene_standing(walk[0])
    assert standing is not None and standing.sensed
    assert standing.area[standing.rests].sum() > 0.8 * standing.area.sum()


def test_people_are_what_moves(walk, parts):
    recording, truth = walk
    caught, wrong, moving, still = 0.0, 0.0, 0.0, 0.0
    for number in range(0, COUNT, 4):
        mesh, clean = recording[number], truth[number]
        people, areas = carried_labels(Surface(clean.mesh), clean.dynamic, mesh), face_normals(mesh)[1]
        found = parts.segmentation.moving(number, mesh)
        caught, moving = caught + areas[people & found].sum(), moving + areas[people].sum()
        wrong, still = wrong + areas[~people & found].sum(), still + areas[~people].sum()
    assert caught > 0.9 * moving and wrong < 0.02 * still


def test_the_room_is_seen_from_all_sides_of_the_walk_and_has_no_ghosts(walk, parts):
    _, truth = walk
    clean = truth[0]
    room = Surface(part_of(clean.mesh, ~clean.dynamic))
    areas = face_normals(parts.background)[1]
    off = room.distances(face_means(parts.background.vertices, parts.background.faces)) > 0.06
    assert areas[off].sum() < 0.005 * areas.sum()
    seen = walk[0][0].vertices  # what the first frame shows, and others hide
    still = room.distances(seen) < 0.02
    assert np.mean(Surface(parts.background).distances(seen[still]) < 0.03) > 0.97


@pytest.mark.slow
def test_the_colours_of_the_room_are_one_picture_of_all_that_the_walk_saw(walk, tmp_path):
    """What the first frame does not show has its place in the picture, too."""
    pytest.importorskip("av")
    pytest.importorskip("xatlas")
    path = tmp_path / "walk.reel"
    encode(walk[0], path, effort="fast", texture=512)
    with meshreel.open(path) as video:
        first, last = (video.background(number) for number in (0, COUNT - 1))
        assert np.array_equal(first.texture.pixels, last.texture.pixels) and first.texture.pixels.std() > 10
    areas, placed = face_normals(first)[1], np.isfinite(first.uv).all(axis=(1, 2))
    assert areas[placed].sum() > 0.98 * areas.sum()
