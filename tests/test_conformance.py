"""Golden files of version 1 decode to the bits they always decoded to."""

import json

import numpy as np
import pytest

import meshreel
from meshreel.format.checks import COMPANIONS
from meshreel.format.layout import ChunkKind
from tests.golden import GOLDEN, audio_record, colored_record, frame_record, planes, splats_records

FILES = sorted([*GOLDEN.glob("*.reel"), *GOLDEN.glob("audio/*.reel")])
COLORED = sorted(GOLDEN.glob("colored/*.reel"))


def test_there_is_a_golden_file_for_each_form():
    forms = {group.form.name for path in FILES for group in meshreel.open(path).reader.groups}
    assert forms == {"LAPLACIAN", "LAYERS", "DRACO", "EMPTY"}
    chunks = [chunk for path in FILES for chunk in meshreel.open(path).reader.chunks]
    assert {chunk.form.name for chunk in chunks if chunk.kind == ChunkKind.STATIC} == {"DRACO", "PATCH"}
    assert any(chunk.kind == ChunkKind.AUDIO for chunk in chunks)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_golden_file_decodes_bit_for_bit(path):
    wanted = json.loads(path.with_suffix(".json").read_text())
    video = meshreel.open(path)
    assert video.frame_rate == wanted["frame_rate"]
    assert video.timestamps == wanted["timestamps"]
    assert [frame_record(mesh) for mesh in video] == wanted["frames"]
    assert [frame_record(mesh) for mesh in video.at(1)] == wanted["frames_with_one_component"]
    assert audio_record(video) == {name: value for name, value in wanted.items() if name == "audio"}


def test_there_is_a_golden_file_for_each_companion_of_a_group_and_of_a_background():
    chunks = [chunk for path in COLORED for chunk in meshreel.open(path).reader.chunks]
    assert {(chunk.kind, chunk.frame_count > 0) for chunk in chunks if chunk.kind in COMPANIONS} == {
        (kind, is_group) for kind in COMPANIONS if kind != ChunkKind.SPLATS for is_group in (True, False)
    }
    assert max(path.stat().st_size for path in GOLDEN.rglob("*")) < 40_000


@pytest.mark.parametrize("path", COLORED, ids=lambda path: path.stem)
def test_a_golden_file_has_the_same_colours_and_planes(path):
    pytest.importorskip("av")
    wanted, video = json.loads(path.with_suffix(".json").read_text()), meshreel.open(path)
    for frame, parts in wanted["parts"].items():
        assert colored_record(video, int(frame)) == parts
    assert planes(video.reader) == wanted["planes"]


def test_a_golden_file_has_the_same_splats_in_the_same_places():
    path = GOLDEN / "splats" / "splats.reel"
    wanted, video = json.loads(path.with_suffix(".json").read_text()), meshreel.open(path)
    assert [frames is None for frames in wanted["frames"]] == [False] * 9 + [True] * 3
    for name, shown in (("frames", video), ("frames_of_first_layers", video.at(0))):
        for found, frame in zip(splats_records(shown), wanted[name], strict=True):
            assert (found is None) == (frame is None)
            for some, splat in zip(found or [], frame or [], strict=True):
                for part in splat:
                    np.testing.assert_allclose(some[part], splat[part], atol=1e-9)
    hidden = [splat["opacities"] for frame in wanted["frames"] if frame for splat in frame]
    assert 0 in hidden and max(hidden) > 0.5  # some frames lack faces
