"""Derived sequences: chosen frames, and what they know of their source."""

import time
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshreel.errors import InputError
from meshreel.geometry import derived_sequences
from meshreel.geometry.derived_sequences import DerivedSequence, Memory, captured, picked, unchanging, welded
from meshreel.geometry.threads import mapped, threads
from meshreel.types import Mesh, MeshList, MeshSequence
from tests.spheres import sliding_sphere


def test_chosen_frames_are_those_of_the_source():
    source = sliding_sphere(5, levels=1)
    some = picked(source, (4, 0))
    assert len(some) == 2 and some.frame_rate == source.frame_rate
    assert [mesh.vertices[0, 0] for mesh in some] == [source[4].vertices[0, 0], source[0].vertices[0, 0]]


def test_a_sequence_that_names_no_up_axis_is_refused():
    class Sideways(DerivedSequence):
        up = "x"

    with pytest.raises(InputError, match="up axis 'x'"):
        captured(Sideways(sliding_sphere(2, levels=1)))


def triangles(count: int) -> Mesh:
    return Mesh.of(np.zeros((0, 3)), np.zeros((count, 3)))  # 12 bytes each


@given(st.integers(0, 100), st.lists(st.integers(0, 9), max_size=40))
def test_the_frames_used_last_are_kept_as_far_as_they_fit(most: int, numbers: list[int]):
    recent, used = Memory(most).recent, list[int]()
    for number in numbers:
        fitting = [k for at, k in enumerate(used) if sum(12 * other for other in used[: at + 1]) <= most]
        found = recent.get(number)
        assert (found is not None) == (number in fitting)
        if found is None:
            recent.keep(number, found := triangles(number))
        assert len(found.faces) == number
        used = [number, *(k for k in fitting if k != number)]


class Counted(MeshList):
    """Frames that count how often each is read, and that move from their third reading on."""

    __slots__ = ()
    reads: ClassVar[dict[int, int]] = {}

    def __getitem__(self, index: int) -> Mesh:
        self.reads[index] = self.reads.get(index, 0) + 1
        mesh = super().__getitem__(index)
        return Mesh(mesh.vertices + (self.reads[index] > 2), mesh.faces)


def test_each_frame_is_read_once_while_all_fit(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(Counted, "reads", {})
    source = sliding_sphere(3, levels=1)
    frames = unchanging(Counted(tuple(source)))
    for _ in range(4):
        for index, mesh in enumerate(frames):
            np.testing.assert_array_equal(mesh.vertices, source[index].vertices)
    assert Counted.reads == {0: 1, 1: 1, 2: 1} and len(frames.digests) == 3


def test_a_frame_that_changed_before_it_is_read_again_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(Counted, "reads", {})
    source = sliding_sphere(3, levels=1)
    monkeypatch.setattr(derived_sequences, "MOST_KEPT", source[0].vertices.nbytes + source[0].faces.nbytes)
    frames = unchanging(Counted(tuple(source)))  # it keeps one
    for _ in range(2):
        assert len(list(frames)) == 3
    assert frames[2] is frames[2] and Counted.reads == {0: 2, 1: 2, 2: 2}
    with pytest.raises(InputError, match="frame 0: has changed while it was encoded"):
        frames[0]


class OneReader(MeshSequence):
    """Frames from one handle, which only one thread may use at a time."""

    frame_rate = 30.0

    def __init__(self) -> None:
        self.inside, self.most = 0, 0

    def __len__(self) -> int:
        return 12

    def __getitem__(self, index: int) -> Mesh:
        self.inside += 1
        self.most = max(self.most, self.inside)
        time.sleep(0.002)
        self.inside -= 1
        return Mesh.of([[index, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2]])


def test_a_sequence_that_does_not_say_that_threads_may_share_it_is_read_by_one_at_a_time():
    source = OneReader()
    frames = unchanging(welded(source))
    with threads(4):
        found = mapped(frames.__getitem__, range(12))
    assert [mesh.vertices.max() for mesh in found] == [max(k, 1) for k in range(12)] and source.most == 1
    shared = MeshList(tuple(found))
    assert unchanging(welded(shared)).is_shared and not frames.is_shared
