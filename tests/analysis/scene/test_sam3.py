"""Masks by SAM3: the whole way from pictures to faces with an untrained model, and folders without weights."""

import json
import sys
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from meshreel.analysis.scene import hypotheses, sam3
from meshreel.analysis.scene.hypotheses import Tracked, reference_view
from meshreel.analysis.scene.labelling import votes
from meshreel.analysis.scene.masks import Masker, normal_picture
from meshreel.analysis.scene.segmentation import segment_by
from meshreel.analysis.scene.views import place_views
from meshreel.errors import InputError
from meshreel.geometry.color_views import ColorPicture
from meshreel.geometry.drawing import draw
from meshreel.geometry.topology import concatenate
from meshreel.types import MeshList
from tests.analysis.scene.test_views import box
from tests.metrics.shapes import moved, sphere

WALLS = box((0, 0, 0), (5, 2.5, 4), inwards=True)
FRAMES = [concatenate([WALLS, moved(sphere(0.4, levels=2), (x, 1.2, 2))]) for x in (1.0, 1.8, 2.6, 3.4)]
VIEWS = place_views(FRAMES, "y", 3, 80, 60)
SEEN = [[draw(mesh, view) for view in VIEWS] for mesh in FRAMES]
REFERENCE = 1


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    for library in ("torch", "transformers"):
        pytest.importorskip(library, reason="the extra sam3 is not installed: MESHREEL_SAM3=1 ./scripts/setup")
    from tests.analysis.scene.tiny_sam3 import write_tiny_sam3

    folder = tmp_path_factory.mktemp("weights")
    write_tiny_sam3(folder)
    return folder


@pytest.fixture
def easily(monkeypatch: pytest.MonkeyPatch):
    """An untrained model finds next to nothing that varies, and nothing twice."""
    monkeypatch.setattr(hypotheses, "VARIATION", 0.001)
    monkeypatch.setattr(hypotheses, "OVERLAP", 0.01)


def observed(weights: Path, prompts: tuple[str, ...] | None = ("person", "ball"), by: str = "words") -> sam3.Sam3Masks:
    masker = sam3.Sam3Masks(weights, prompts, by)
    masker._chosen = REFERENCE
    for frame, seen in enumerate(SEEN):
        masker.observe(frame, seen, VIEWS)
    return masker


@pytest.mark.usefixtures("easily")
def test_pictures_become_masks_and_masks_become_votes(weights: Path):
    masker = observed(weights)
    assert isinstance(masker, Masker)
    found = masker.masks(2, SEEN[2], VIEWS)
    assert found.shape == (3, 60, 80) and found.dtype == bool and 0 < found.mean() < 1
    dynamic, seen = votes(np.stack([one.faces for one in SEEN[2]]), found, len(FRAMES[2].faces))
    assert (dynamic <= seen).all() and dynamic.sum() == found.sum()  # a closed room


@pytest.mark.usefixtures("easily")
def test_objects_have_numbers_and_the_same_pictures_give_the_same(weights: Path):
    first, again = observed(weights), observed(weights)
    for frame in (0, 3):
        objects = first.objects(frame, SEEN[frame], VIEWS)
        assert np.array_equal(objects, again.objects(frame, SEEN[frame], VIEWS))
        assert np.array_equal(objects > 0, first.masks(frame, SEEN[frame], VIEWS)) and objects.max() <= 4


@pytest.mark.usefixtures("easily")
def test_what_moves_is_shown_by_points_and_followed_over_time_and_through_views(weights: Path):
    found = [observed(weights, None, "motion").objects(2, SEEN[2], VIEWS) for _ in range(2)]
    assert np.array_equal(*found) and found[0].shape == (3, 60, 80) and found[0].any()


@pytest.mark.usefixtures("easily")
def test_masks_are_made_with_the_default_prompts(weights: Path):
    found = observed(weights, prompts=None).masks(0, SEEN[0], VIEWS)
    assert found.shape == (3, 60, 80)


def test_where_nothing_varies_nothing_moves(weights: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(hypotheses, "VARIATION", 1.0)
    masker = sam3.Sam3Masks(weights, ("person",))
    for frame in range(3):
        masker.observe(frame, SEEN[0], VIEWS)
    assert not masker.masks(1, SEEN[0], VIEWS).any()


def test_weights_that_lack_a_part_are_refused(weights: Path, tmp_path: Path):
    from safetensors.numpy import load_file, save_file

    for name in ("config.json", "vocab.json", "merges.txt", "tokenizer_config.json"):
        (tmp_path / name).write_bytes((weights / name).read_bytes())
    tensors = load_file(weights / "model.safetensors")
    tensors.pop(sorted(tensors)[0])
    save_file(tensors, tmp_path / "model.safetensors", metadata={"format": "pt"})
    with pytest.raises(InputError, match=r"lack 1 of SAM3's tensors"):
        sam3.Sam3Masks(tmp_path)
    (tmp_path / "model.safetensors").write_bytes(b"weights")
    with pytest.raises(InputError, match="SAM3 cannot be loaded"):
        sam3.Sam3Masks(tmp_path)


class Followed:
    """A tracker that sees the last faces of each frame in the view over time, and counts how often it is asked."""

    def __init__(self, *_: object) -> None:
        self.asked: list[str] = []

    def over_time(self, _pictures: list[np.ndarray], _depths: list[np.ndarray]) -> Tracked:
        self.asked.append("time")
        ball = np.stack([seen[REFERENCE].faces >= len(WALLS.faces) for seen in SEEN])
        return Tracked(ball.astype(np.int32), {1: "ball"})

    def through_views(self, _pictures: list[np.ndarray], _first: np.ndarray) -> Tracked:
        self.asked.append("views")
        return Tracked(np.ones((len(VIEWS), 60, 80), np.int32), {1: "ball"})


@pytest.mark.usefixtures("easily")
def test_masks_asked_for_a_second_time_come_from_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    tracker = Followed()
    monkeypatch.setattr(sam3, "WordTracker", lambda *_: tracker)
    masker = sam3.Sam3Masks(tmp_path)
    masker._chosen = REFERENCE
    found = []
    for _ in range(2):
        for frame, seen in enumerate(SEEN):
            masker.observe(frame, seen, VIEWS)
        found.append([masker.masks(frame, seen, VIEWS) for frame, seen in enumerate(SEEN)])
    assert np.array_equal(*found) and found[0][0].shape == (3, 60, 80) and np.any(found)
    assert tracker.asked == ["time", *["views"] * len(FRAMES)]


class Pictures(Followed):
    """One that keeps the pictures that it is given over time."""

    def over_time(self, pictures: list[np.ndarray], _depths: list[np.ndarray]) -> Tracked:
        self.pictures = pictures
        return Tracked(np.zeros((len(pictures), 60, 80), np.int32), {})


class Filmed(MeshList):
    """The frames with the pictures of a colour camera, of one colour in each; it lacks the last one."""

    up, depth = "y", None
    colors: ClassVar = [[ColorPicture(VIEWS[0], np.full((60, 80, 3), 50 * k, np.uint8))] for k in range(3)] + [[None]]


def test_the_pictures_of_a_colour_camera_are_used_where_there_are_any(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    tracker, frames = Pictures(), Filmed(tuple(FRAMES))
    monkeypatch.setattr(sam3, "WordTracker", lambda *_: tracker)
    found = segment_by(sam3.Sam3Masks(tmp_path), frames)
    assert not found.moving(0, FRAMES[0]).any() and found.views == (VIEWS[0],)
    assert [set(picture.reshape(-1).tolist()) for picture in tracker.pictures[:3]] == [{0}, {50}, {100}]
    assert np.array_equal(tracker.pictures[3], normal_picture(draw(FRAMES[3], VIEWS[0]), VIEWS[0]))
    segment_by(masker := sam3.Sam3Masks(tmp_path), frames, VIEWS).moving(0, FRAMES[0])
    assert masker.reference and np.array_equal(
        tracker.pictures[1], normal_picture(SEEN[1][masker.reference], VIEWS[masker.reference])
    )


def best_last() -> tuple:
    """The views, that in which most changes behind the others."""
    best = reference_view([SEEN[0], SEEN[2], SEEN[3]])
    return (*VIEWS[:best], *VIEWS[best + 1 :], VIEWS[best])


def test_the_view_in_which_most_changes_is_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    tracker, views = Pictures(), best_last()
    monkeypatch.setattr(sam3, "WordTracker", lambda *_: tracker)
    found = segment_by(sam3.Sam3Masks(tmp_path), MeshList(tuple(FRAMES)), views)
    assert not found.moving(0, FRAMES[0]).any()
    wanted = [normal_picture(draw(mesh, views[-1]), views[-1]) for mesh in FRAMES]
    assert all(np.array_equal(*pair) for pair in zip(tracker.pictures, wanted, strict=True))


@pytest.mark.usefixtures("easily")
def test_a_scene_is_segmented_by_a_model_that_knows_nothing(weights: Path):
    masker = sam3.Sam3Masks(weights, ("person", "ball"))
    found = segment_by(masker, MeshList(tuple(FRAMES)), best_last())
    assert found.moving(1, FRAMES[1]).shape == (len(FRAMES[1].faces),)
    assert masker.reference == len(VIEWS) - 1


@pytest.mark.parametrize("files", [None, [], ["config.json"], ["config.json", "model.safetensors"]])
def test_the_error_for_a_folder_without_weights_lists_the_needed_files(tmp_path: Path, files: list[str] | None):
    folder = tmp_path / "sam3"
    if files is not None:
        folder.mkdir()
        for name in files:
            (folder / name).write_text(json.dumps({}))
    with pytest.raises(InputError, match=r"sam3: holds no weights of SAM3.*config\.json, model\.safetensors.*facebook"):
        sam3.Sam3Masks(folder)


def test_without_the_extra_an_error_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for name in ("config.json", "model.safetensors", "tokenizer.json"):  # a folder that is none is told first
        (tmp_path / name).write_text("{}")
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(InputError, match=r"pip install 'meshreel\[sam3\]'"):
        sam3.Sam3Masks(tmp_path)
