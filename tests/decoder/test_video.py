"""Opening .reel files: a Video is a sequence of meshes, read group by group."""

import io
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel.coding.entropy import encode_integers
from meshreel.coding.group import decode_group
from meshreel.coding.mesh import encode_mesh
from meshreel.container.sources import BytesSource
from meshreel.errors import FormatError, InputError
from meshreel.format.layout import AnchorRule, DisplacementHead, Form, LaplacianGroup
from meshreel.format.records import pack
from meshreel.types import Mesh, MeshList, Texture
from tests.container.files import Counted
from tests.golden import GOLDEN, frame_record

MIXED = (GOLDEN / "mixed.reel").read_bytes()  # empty 0-1, laplacian 2-5, draco 6-8, empty 9

WHOLE = [frame_record(mesh) for mesh in meshreel.open(MIXED)]


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


def test_more_layers_than_any_group_has_are_all_of_them():
    assert digests(meshreel.open(MIXED).at(layers=10**30)) == WHOLE


def test_a_missing_file_and_a_folder_are_input_errors(tmp_path):
    (tmp_path / "folder.reel").mkdir()
    for name in ("none", "folder"):
        with pytest.raises(InputError, match=rf"{name}\.reel"):
            meshreel.open(tmp_path / f"{name}.reel")


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
