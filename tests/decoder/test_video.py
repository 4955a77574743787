"""Opening .reel files: a Video is a sequence of meshes, read group by group."""

from __future__ import annotations

import io
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel.coding.entropy import encode_integers
from meshreel.coding.group import decode_group
from meshreel.coding.mesh import encode_mesh
from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource
from meshreel.decoder.cache import NO_GROUP
from meshreel.decoder.tracks import Track
from meshreel.errors import FormatError, InputError
from meshreel.format.layout import AnchorRule, DisplacementHead, Form, LaplacianGroup
from meshreel.format.records import pack
from meshreel.types import Mesh, MeshList, Texture
from tests.golden import GOLDEN, frame_record

MIXED = (GOLDEN / "mixed.reel").read_bytes()  # empty 0-1, laplacian 2-5, draco 6-8, empty 9

WHOLE = [frame_record(mesh) for mesh in meshreel.open(MIXED)]


class Counted(BytesSource):
    """Remembers which byte ranges were asked for."""

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self.ranges: list[tuple[int, int]] = []

    def get_bytes(self, offset: int, length: int) -> bytes:
        self.ranges.append((offset, length))
        return super().get_bytes(offset, length)


def digests(meshes):
    return [frame_record(mesh) for mesh in meshes]


def test_a_path_a_string_bytes_and_a_source_open_the_same_video():
    path = GOLDEN / "mixed.reel"
    videos = [meshreel.open(source) for source in (path, str(path), MIXED, BytesSource(MIXED))]
    assert all(digests(video) == digests(videos[0]) for video in videos)


def test_a_file_object_opens_and_stays_open_for_its_owner():
    with (GOLDEN / "mixed.reel").open("rb") as file:
        with meshreel.open(file) as video:
            assert digests(video) == WHOLE
        assert not file.closed
    assert digests(meshreel.open(io.BytesIO(MIXED))) == WHOLE


def test_a_file_opened_as_text_is_refused(tmp_path):
    (tmp_path / "a.reel").write_text("solid")
    with (tmp_path / "a.reel").open() as file, pytest.raises(InputError, match="open it with mode 'rb'"):
        meshreel.open(file)


def test_a_video_knows_its_duration_its_metadata_and_its_up_axis():
    video = meshreel.open(MIXED)
    assert video.duration == pytest.approx(video.timestamps[-1] - video.timestamps[0] + 1 / 25)
    assert video.metadata == video.reader.metadata
    assert video.up == "y"


def test_a_video_is_shown_by_its_facts():
    video = meshreel.open(MIXED)
    facts = f"10 frames, 25 frames/s, {video.duration:.3g} s, {len(MIXED)} bytes, 1 track, no background"
    assert repr(video) == f"<meshreel.Video: {facts}>"
    assert repr(video.at(layers=1)) == f"<meshreel.Video: {facts}, at most 1 layer>"
    assert f"recording, {facts}" in video._repr_html_()
    assert "with background" in repr(meshreel.open(GOLDEN / "scene.reel"))


def test_a_video_is_a_sequence_of_meshes():
    video = meshreel.open(MIXED)
    assert len(video) == 10 == len(list(video))
    assert isinstance(video, meshreel.MeshSequence)
    assert video.frame_rate == 25.0
    assert [mesh.is_empty for mesh in video] == [True, True] + 4 * [False] + [False, True, False] + [True]


def test_what_a_video_keeps_cannot_be_changed_from_outside():
    for name in ("mixed", "layers", "layers_patched"):
        video = meshreel.open(GOLDEN / f"{name}.reel")
        for number, mesh in enumerate(video.tracks[0]):
            for array in (mesh.vertices, mesh.faces):
                with pytest.raises(ValueError, match="read-only"):
                    array += 1
            assert video.tracks[0][number] is mesh  # it is given again
            own, before = video[number], frame_record(mesh)
            own.vertices[:] += 1.0
            own.faces[:] = 0
            assert frame_record(video[number]) == before


def test_open3d_takes_the_arrays_of_a_frame():
    utility = pytest.importorskip("open3d").utility
    mesh = meshreel.open(MIXED)[1]
    assert len(utility.Vector3dVector(mesh.vertices)) == len(mesh.vertices)
    assert len(utility.Vector3iVector(mesh.faces)) == len(mesh.faces)


def test_a_mesh_and_a_sequence_say_what_they_are():
    mesh = Mesh.of([[0, 0, 0], [2, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert repr(mesh) == "<meshreel.Mesh: 3 vertices, 1 faces, 2 x 1 x 0 m>"
    assert repr(Mesh.empty()) == "<meshreel.Mesh: 0 vertices, 0 faces>"
    painted = replace(mesh, colors=np.zeros((3, 3), np.uint8), texture=Texture.of(np.zeros((4, 8, 3), np.uint8)))
    assert repr(painted).endswith("2 x 1 x 0 m, colours, texture>") and len(repr(painted.texture)) < 60
    assert repr(MeshList((mesh,) * 600, 25.0)) == "<meshreel.MeshList: 600 frames, 25 frames/s>"


def test_slices_and_negative_indices_are_those_of_a_list():
    video = meshreel.open(MIXED)
    whole = digests(video)
    assert digests(video[2:7:2]) == whole[2:7:2]
    assert frame_record(video[-2]) == whole[-2]
    assert video[5:5] == []
    for index in (10, -11):
        with pytest.raises(IndexError, match="10 frames"):
            video[index]


def test_frames_in_any_order_are_the_same_frames():
    video = meshreel.open(MIXED)
    whole = digests(meshreel.open(MIXED))
    assert [frame_record(video[i]) for i in (8, 2, 9, 4, 3, 0)] == [whole[i] for i in (8, 2, 9, 4, 3, 0)]


def test_timestamps_rise_and_start_where_the_header_says():
    video = meshreel.open(MIXED)
    assert len(video.timestamps) == 10
    assert video.timestamps[0] == 0.5
    assert video.timestamps[1] == pytest.approx(0.54)
    assert (np.diff(video.timestamps) > 0).all()


def test_coordinates_are_in_metres_where_they_were():
    mesh = meshreel.open(MIXED)[2]
    assert np.abs(mesh.vertices.mean(axis=0) - [1e6 + 0.125, -2.5, 0.1]).max() < 0.2


def test_one_frame_costs_the_bytes_of_its_group_only():
    source = Counted(MIXED)
    video = meshreel.open(source)
    source.ranges.clear()
    group = video.reader.groups[2]
    video[7]
    assert source.ranges == [(group.offset, group.size)]
    video[8]
    assert len(source.ranges) == 1  # the group is kept


def test_fewer_components_are_fewer_bytes_and_still_a_shape():
    source = Counted(MIXED)
    video = meshreel.open(source)
    whole = video[3]
    source.ranges.clear()
    coarse = video.at(1)[3]
    assert source.ranges[0][1] < video.reader.groups[1].size
    assert np.array_equal(coarse.faces, whole.faces)
    errors = [np.abs(video.at(k)[3].vertices - whole.vertices).max() for k in (0, 1, 3, 99)]
    assert errors[0] > errors[2] and errors[3] == 0
    with pytest.raises(InputError, match="-1"):
        video.at(-1)


def test_the_same_bytes_give_the_same_bits_twice():
    assert digests(meshreel.open(MIXED)) == digests(meshreel.open(MIXED))


def test_a_damaged_group_leaves_the_others_readable():
    group = meshreel.open(MIXED).reader.groups[1]
    data = bytearray(MIXED)
    data[group.offset + 40] ^= 1
    video = meshreel.open(bytes(data))
    with pytest.raises(FormatError, match="frames 2 to 5"):
        video[2]
    others = (0, 1, 6, 7, 8, 9)
    assert digests(video[i] for i in others) == digests(meshreel.open(MIXED)[i] for i in others)


@pytest.mark.parametrize("missing", [1, 200])
def test_a_truncated_file_keeps_the_groups_it_has(missing):
    video = meshreel.open(MIXED[:-missing])
    assert digests(video[:6]) == digests(meshreel.open(MIXED)[:6])
    with pytest.raises(FormatError, match="truncated"):
        video[9]


def survivors(data):
    """Which frames of the mixed file can still be read; anything but FormatError is a failure."""
    try:
        video = meshreel.open(data)
    except FormatError:
        return set()
    found = set()
    for group in video.reader.groups:
        with suppress(FormatError):
            if frame_record(video[group.first_frame]) == WHOLE[group.first_frame]:
                found.add(group.number)
    return found


# Every byte of the head and every fifth behind it: each costs a decode.
PLACES = [place for place in range(len(MIXED)) if place % 5 == 0 or place < meshreel.open(MIXED).reader.head_size]


def test_wherever_a_file_ends_only_what_is_missing_is_lost():
    groups = meshreel.open(MIXED).reader.groups
    for size in PLACES:
        whole = {group.number for group in groups if group.end <= size} if size >= groups[0].offset else set()
        assert survivors(MIXED[:size]) == whole, size


def test_a_flipped_byte_anywhere_is_found_and_costs_one_group_at_most():
    groups = meshreel.open(MIXED).reader.groups
    for place in PLACES:
        data = bytearray(MIXED)
        data[place] ^= 0x40
        hit = {group.number for group in groups if group.offset <= place < group.end}
        assert survivors(bytes(data)) == ({0, 1, 2, 3} - hit if hit else set()), place


@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("mask", [0x01, 0xFF])
def test_payloads_that_lie_behind_a_right_checksum_raise_format_errors_only(number, mask):
    reader = meshreel.open(MIXED).reader
    payload, count = reader.read_chunk(number), reader.groups[number].frame_count
    for place in range(mask % 3, len(payload), 3):
        data = bytearray(payload)
        data[place] ^= mask
        with suppress(FormatError):
            assert len(decode_group(bytes(data), count)) == count


def test_a_truncated_head_a_future_version_and_another_file_are_refused():
    with pytest.raises(FormatError):
        meshreel.open(MIXED[:50])
    with pytest.raises(FormatError, match="version 9"):
        meshreel.open(MIXED[:8] + b"\x09" + MIXED[9:])
    with pytest.raises(FormatError, match=r"not a \.reel"):
        meshreel.open(b"solid cube")


def test_a_missing_file_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match=r"none\.reel"):
        meshreel.open(tmp_path / "none.reel")


class Contended(Track):
    """As if another thread had always just put its own group in the place of the last one."""

    @property
    def _group(self):
        return NO_GROUP

    @_group.setter
    def _group(self, group):
        pass


def test_threads_that_share_a_video_get_the_frames_they_asked_for():
    assert digests(Contended(ReelReader(BytesSource(MIXED)), 0)) == WHOLE


@pytest.mark.parametrize(("levels", "frames"), [(0, 65535), (8, 1000), (12, 4)])
def test_frames_that_no_memory_holds_are_refused_before_they_are_made(levels, frames):
    triangle = encode_mesh(meshreel.Mesh.of(np.eye(3) * 900, [[0, 1, 2]]), 1.0)
    basis = encode_integers(np.zeros(3 * frames, np.int32))
    head = DisplacementHead(frames, AnchorRule.SPREAD, 1, 1, 0, (), basis)
    payload = pack(LaplacianGroup(Form.LAPLACIAN, levels, 1.0, triangle, pack(head)))
    assert len(payload) < 300
    if levels == 0:
        assert len(decode_group(payload, frames)) == frames  # little enough
        return
    with pytest.raises(FormatError, match=f"in {frames} frames"):
        decode_group(payload, frames)
