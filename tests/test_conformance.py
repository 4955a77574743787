"""Golden files of version 1 decode to the bits they always decoded to."""

from __future__ import annotations

import json

import pytest

import meshreel
from meshreel.format.layout import ChunkKind
from tests.golden import GOLDEN, frame_record

FILES = sorted(GOLDEN.glob("*.reel"))


def test_there_is_a_golden_file_for_each_form():
    forms = {group.form.name for path in FILES for group in meshreel.open(path).reader.groups}
    assert forms == {"LAPLACIAN", "LAYERS", "DRACO", "EMPTY"}
    chunks = [chunk for path in FILES for chunk in meshreel.open(path).reader.chunks]
    assert {chunk.form.name for chunk in chunks if chunk.kind == ChunkKind.STATIC} == {"DRACO", "PATCH"}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_golden_file_decodes_bit_for_bit(path):
    wanted = json.loads(path.with_suffix(".json").read_text())
    video = meshreel.open(path)
    assert video.frame_rate == wanted["frame_rate"]
    assert video.timestamps == wanted["timestamps"]
    assert [frame_record(mesh) for mesh in video] == wanted["frames"]
    assert [frame_record(mesh) for mesh in video.at(1)] == wanted["frames_with_one_component"]
