"""Masks of another tool are found, checked, and lifted to the faces on which they were drawn."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from meshreel.analysis.scene.labelling import votes
from meshreel.analysis.scene.masks import (
    CAMERAS,
    ImageMasks,
    Masker,
    one_size,
    read_view_file,
    write_views,
)
from meshreel.analysis.scene.segmentation import scene_views, segment_by
from meshreel.analysis.scene.views import place_views
from meshreel.errors import InputError
from meshreel.geometry.cameras import CameraPose, pack_cameras
from meshreel.geometry.drawing import draw
from meshreel.io.write import write_picture
from meshreel.types import Mesh, MeshList
from tests.analysis.scene.test_views import ROOM
from tests.metrics.shapes import sphere

BALL = len(sphere().faces)  # the last faces of the room are the ball's
VIEWS = place_views([ROOM], "y", 3, 80, 60)
SEEN = [draw(ROOM, view) for view in VIEWS]


@pytest.fixture
def masks(tmp_path: Path) -> Path:
    """Two frames in which the ball is object 3."""
    write_views(tmp_path, [ROOM, ROOM], VIEWS)  # type: ignore[arg-type]
    for view, seen in enumerate(SEEN):
        painted = np.where(seen.faces >= len(ROOM.faces) - BALL, 3, 0).astype(np.uint8)
        for frame in range(2):
            write_picture(painted, tmp_path / f"view{view:02}" / f"frame_{frame:05}.png")
    return tmp_path


def test_painted_pictures_find_the_faces_they_were_painted_on(masks: Path):
    given = ImageMasks(masks, 2)
    assert isinstance(given, Masker)
    found = given.masks(1, SEEN, given.views)
    assert found.shape == (3, 60, 80) and found.dtype == bool and set(np.unique(given.objects(0))) == {0, 3}
    for frame in (-1, 2):
        with pytest.raises(IndexError, match=f"frame {frame}: there are frames 0 to 1"):
            given.objects(frame)
    moving, seen = votes(np.stack([each.faces for each in SEEN]), found, len(ROOM.faces))
    dynamic = moving >= 0.5 * np.maximum(seen, 1)
    assert dynamic[-BALL:][seen[-BALL:] > 0].all() and not dynamic[:-BALL].any() and dynamic.sum() > 10


def test_the_views_of_the_folder_are_those_it_was_made_for(masks: Path):
    for ours, other in zip(VIEWS, read_view_file(masks / CAMERAS), strict=True):
        assert np.array_equal(ours.extrinsic, other.extrinsic) and np.array_equal(ours.intrinsic, other.intrinsic)


def test_a_missing_frame_is_reported_before_any_is_read(masks: Path):
    (masks / "view01" / "frame_00001.png").unlink()
    with pytest.raises(InputError, match=r"view01: has no mask of frame 1"):
        ImageMasks(masks, 2)
    assert len(ImageMasks(masks, 1).views) == 3


def test_the_error_for_a_mask_of_another_size_names_its_frame_and_size(masks: Path):
    write_picture(np.zeros((30, 40), np.uint8), masks / "view02" / "frame_00001.png")
    with pytest.raises(InputError, match=r"frame_00001\.png \(frame 1\): 40 x 30 pixels where its camera has 80 x 60"):
        ImageMasks(masks, 2)


def test_damage_is_reported_before_the_first_mask_is_requested(masks: Path):
    last = masks / "view02" / "frame_00001.png"
    last.write_bytes(last.read_bytes()[:60])
    with pytest.raises(InputError, match=r"frame_00001\.png: cannot be read .*make the mask again"):
        ImageMasks(masks, 2)
    write_picture(np.zeros((60, 80, 3), np.uint8), last)
    with pytest.raises(InputError, match=r"frame_00001\.png: a mask of mode RGB"):
        ImageMasks(masks, 2)


def test_masks_of_more_frames_are_remarked(masks: Path):
    assert ImageMasks(masks, 2).remarks == ()
    [line] = ImageMasks(masks, 1).remarks
    assert "masks for 1 more frames than the 1 of the sequence" in line and str(masks) in line


def test_cameras_that_see_nothing_of_the_scene_are_refused(masks: Path):
    away = tuple(replace(view, pose=CameraPose.of_world(view.extrinsic + np.diag([0, 0, 1e4], 1))) for view in VIEWS)
    (masks / CAMERAS).write_bytes(pack_cameras(away))
    frames = MeshList((Mesh.empty(), ROOM))
    with pytest.raises(InputError, match=r"the 3 given cameras see no face in any of 1 frames \(the first is 1\)"):
        segment_by(ImageMasks(masks, 2), frames)
    with pytest.raises(InputError, match="the 3 given cameras see no face"):
        scene_views(frames, away)


def test_a_folder_without_cameras_or_with_cameras_of_two_sizes_is_refused(masks: Path):
    (masks / CAMERAS).write_bytes(pack_cameras([VIEWS[0], replace(VIEWS[1], width=100)]))
    with pytest.raises(InputError, match=r"cameras of 80 x 60 and 100 x 60 pixels; give cameras of one size"):
        ImageMasks(masks, 2)
    (masks / CAMERAS).unlink()
    with pytest.raises(InputError, match=rf"{CAMERAS}: cannot be read .*give the cameras of the masks"):
        ImageMasks(masks, 2)
    with pytest.raises(InputError, match="nothing: has 0 cameras"):
        one_size([], "nothing")


def test_a_frame_is_asked_for_its_masks_once_and_an_empty_one_never(masks: Path):
    asked = []

    class Counted(ImageMasks):
        def masks(self, frame, seen, views):
            asked.append(frame)
            return super().masks(frame, seen, views)

    frames = MeshList((ROOM, ROOM, Mesh.empty()))
    by = segment_by(Counted(masks, 2), frames)
    found = [by.moving(frame, frames[frame]) for frame in (0, 1, 0, 2)]
    assert asked == [0, 1] and np.array_equal(found[0], found[2]) and found[0].any() and len(found[3]) == 0
    assert 0 < by.cell < ROOM.diagonal


def test_views_are_placed_by_frames_that_have_a_surface_and_given_ones_are_taken():
    frames = MeshList((Mesh.empty(), ROOM, *[Mesh.empty()] * 5))
    assert len(scene_views(frames)) == 14
    assert scene_views(frames, VIEWS) == VIEWS
    with pytest.raises(InputError, match="has a surface"):
        scene_views(MeshList((Mesh.empty(),) * 2))


def test_a_folder_of_cameras_one_a_file_is_read_in_the_order_of_their_numbers(tmp_path: Path):
    with pytest.raises(InputError, match=r"holds no view_\*\.json; give .*folder"):
        read_view_file(tmp_path)
    for number, view in zip((2, 10, 1), VIEWS, strict=True):
        (tmp_path / f"view_{number}.json").write_bytes(pack_cameras([view]))
    assert read_view_file(tmp_path) == (VIEWS[2], VIEWS[0], VIEWS[1])
    (tmp_path / "view_3.json").write_bytes(pack_cameras([replace(VIEWS[0], width=99)]))
    with pytest.raises(InputError, match="99 x 60"):
        read_view_file(tmp_path)
