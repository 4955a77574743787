"""Vertices of several frames in one array: the same numbers, in the caller's memory, as float64 or float32."""

import io

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


@pytest.mark.parametrize("name", ["scene", "layers_patched", "draco", "laplacian"])
def test_other_videos_give_the_vertices_of_their_frames_too(name: str):
    path = GOLDEN / f"{name}.reel"
    assert meshreel.open(path).vertices(0, 1).tobytes() == meshreel.open(path)[0].vertices.tobytes()


def test_vertices_that_are_no_longer_the_same_are_refused_though_as_many():
    corners, file = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0.5]], io.BytesIO()
    pyramid = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    frames = [Mesh.of(corners, pyramid), Mesh.of(corners, pyramid[:3])]
    with ReelWriter(file, HEADER) as writer:
        writer.add_group(0, 2, encode_intra(frames, 0.001, 0))
    video = meshreel.open(file.getvalue())
    assert len(video[0].vertices) == len(video[1].vertices)
    with pytest.raises(InputError, match="frame 1 has other vertices than frame 0"):
        video.vertices(0, 2)


@pytest.mark.parametrize(
    ("last", "out", "words"),
    [
        *((3, np.zeros(shape, kind), "3 frames: give one of float64 or float32")
          for shape, kind in (((3, 9, 3), np.float16), ((4, 9, 3), float), ((3, 9), float))),
        (3, np.zeros((3, 9, 3)), "frame 0 has"),
        (COUNT, None, f"frame {MOVING} has 0 vertices"),
    ],
)  # fmt: skip
def test_arrays_and_frames_that_do_not_fit_are_refused(last: int, out: np.ndarray | None, words: str):
    with pytest.raises(InputError, match=words):
        meshreel.open(DATA).vertices(0, last, out)


@pytest.mark.parametrize(("first", "last"), [(-1, 1), (0, COUNT + 1), (2, 2)])
def test_frames_out_of_range_are_an_index_error(first: int, last: int):
    with pytest.raises(IndexError, match=f"frames {first} to {last}"):
        meshreel.open(DATA).vertices(first, last)
