"""Vertices of several frames in one array, of a video and of each track, and the runs of frames that share them."""

import io
import pickle
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.coding.mesh import encode_intra
from meshreel.container.writer import ReelWriter
from meshreel.errors import InputError
from meshreel.types import Mesh
from tests.decoder.test_chains import COUNT, DATA, EMPTY, HEADER
from tests.golden import GOLDEN

MOVING = COUNT - EMPTY


def stacked(first: int, last: int) -> np.ndarray:
    video = meshreel.open(DATA)
    return np.stack([video[frame].vertices for frame in range(first, last)])


@pytest.mark.parametrize(("first", "last"), [(0, MOVING), (0, 1), (1, 6), (3, 5), (8, MOVING)])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_vertices_are_those_of_the_frames_one_by_one(first: int, last: int, dtype: type):
    wanted = stacked(first, last).astype(dtype)
    out = np.full(wanted.shape, np.nan, dtype)
    assert meshreel.open(DATA).vertices(first, last, out) is out
    assert out.tobytes() == wanted.tobytes()


def test_without_an_array_a_new_one_of_float64_is_returned():
    assert meshreel.open(DATA).vertices(2, 7).tobytes() == stacked(2, 7).tobytes()


def test_frames_afterwards_do_not_change_with_the_array():
    video, out = meshreel.open(DATA), np.empty(stacked(0, MOVING).shape)
    video.vertices(0, MOVING, out)
    out[:] = 0
    assert video[MOVING - 1].vertices.tobytes() == stacked(MOVING - 1, MOVING).tobytes()


@pytest.mark.parametrize("name", ["scene", "mixed", "draco", "laplacian"])
def test_other_videos_give_the_vertices_of_their_frames_too(name: str):
    path = GOLDEN / f"{name}.reel"
    assert meshreel.open(path).vertices(0, 1).tobytes() == meshreel.open(path)[0].vertices.tobytes()


FILES = sorted(GOLDEN.rglob("*.reel"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
@pytest.mark.parametrize("layers", [None, 1])
def test_runs_are_all_frames_and_as_long_as_vertices_and_faces_last(path: Path, layers: int | None):
    video = meshreel.open(path).at(layers)
    for body in (video, *video.tracks):
        runs = body.topology
        assert [run.first for run in runs] == [0, *(run.last for run in runs[:-1])] and runs[-1].last == len(video)
        for run in runs:
            count = sum(rows.stop - rows.start for rows in run.parts.values())
            assert body.vertices(run.first, run.last).shape == (run.last - run.first, count, 3)
            assert run.faces.flags.writeable and run.faces.dtype == np.int32
            assert run.faces.max(initial=-1) < count
            if run.last < len(video):
                with pytest.raises(InputError, match=f"frame {run.last}: (track|background).* other vertices"):
                    body.vertices(run.first, run.last + 1)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_part_of_every_frame_is_in_the_rows_that_its_run_names(path: Path):
    video = meshreel.open(path)
    for run in video.topology:
        whole, faces = video.vertices(run.first, run.last), run.faces
        for row, frame in zip(whole, range(run.first, run.last), strict=True):
            parts = video.parts(frame)
            assert set(parts) <= set(run.parts)
            for name, mesh in parts.items():
                rows = run.parts[name]
                count = rows.stop - rows.start
                np.testing.assert_array_equal(row[rows], mesh.vertices[:count])
                own = faces[(faces >= rows.start).all(axis=1) & (faces < rows.stop).all(axis=1)] - rows.start
                shown = mesh.faces[mesh.faces.max(axis=1) < count]  # the others are patches
                assert set(map(tuple, shown.tolist())) <= set(map(tuple, own.tolist()))


def test_a_track_of_a_scene_has_its_own_vertices_and_runs():
    video = meshreel.open(GOLDEN / "scene.reel")
    walker, visitor = video.tracks
    assert [(run.first, run.last) for run in walker.topology] == [(0, 14)]
    assert [(run.first, run.last) for run in visitor.topology] == [(0, 4), (4, 9), (9, 14)]
    wanted = np.stack([mesh.vertices for mesh in walker])
    assert walker.vertices().tobytes() == wanted.tobytes()
    out = np.empty((5, 258, 3), np.float32)
    assert visitor.vertices(4, 9, out) is out
    np.testing.assert_array_equal(out, video.vertices(4, 9)[:, video.topology[1].parts["track 1"]].astype(np.float32))


def test_a_scene_whose_parts_change_names_the_part_and_the_way_to_each_track():
    with pytest.raises(InputError, match=r"frame 4: background .*\(78 after 90\).*each of `tracks` has vertices"):
        meshreel.open(GOLDEN / "scene.reel").vertices()


def test_patches_and_hidden_faces_change_neither_vertices_nor_faces_of_a_run():
    video = meshreel.open(GOLDEN / "layers_patched.reel")
    assert len({len(mesh.vertices) for mesh in video}) > 1  # some frames have patches
    (run,), whole = video.topology, video.at(layers=2)
    assert len({len(mesh.faces) for mesh in whole}) == 1  # without the layer of patches none is hidden
    np.testing.assert_array_equal(run.faces, whole[0].faces)
    assert video.vertices().tobytes() == np.stack([mesh.vertices for mesh in whole]).tobytes()


def test_tracks_say_where_they_are_shown_and_survive_a_pickled_video():
    video = meshreel.open(GOLDEN / "scene.reel")
    assert repr(video.tracks[1]).startswith("<meshreel.Track: track 1, shown in 5 of 14 frames (4 to 8), ")
    assert repr(pickle.loads(pickle.dumps(video)).tracks) == repr(video.tracks)
    assert "shown in 0 of 2 frames, 0 bytes" in repr(meshreel.open(GOLDEN / "empty.reel").tracks[0])


def test_vertices_that_are_no_longer_the_same_are_refused_though_as_many():
    corners, file = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0.5]], io.BytesIO()
    pyramid = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    frames = [Mesh.of(corners, pyramid), Mesh.of(corners, pyramid[:3])]
    with ReelWriter(file, HEADER) as writer:
        writer.add_group(0, 2, encode_intra(frames, 0.001, 0))
    video = meshreel.open(file.getvalue())
    assert len(video[0].vertices) == len(video[1].vertices)
    with pytest.raises(InputError, match=r"frame 1: track 0 has other vertices than in frame 0 \(5 after 5\)"):
        video.vertices(0, 2)


@pytest.mark.parametrize(
    ("last", "out", "words"),
    [
        *((3, np.zeros(shape, kind), "3 frames: give one of float64 or float32")
          for shape, kind in (((3, 9, 3), np.float16), ((4, 9, 3), float), ((3, 9), float))),
        (3, np.zeros((3, 9, 3)), "frame 0 has"),
        (COUNT, None, f"frame {MOVING}: track 0 has other vertices than in frame {MOVING - 1}"),
    ],
)  # fmt: skip
def test_arrays_and_frames_that_do_not_fit_are_refused(last: int, out: np.ndarray | None, words: str):
    with pytest.raises(InputError, match=words):
        meshreel.open(DATA).vertices(0, last, out)


@pytest.mark.parametrize(("first", "last"), [(-1, 1), (0, COUNT + 1), (2, 2)])
def test_frames_out_of_range_are_an_index_error(first: int, last: int):
    with pytest.raises(IndexError, match=f"frames {first} to {last}"):
        meshreel.open(DATA).vertices(first, last)
