"""One mesh file per frame."""

from __future__ import annotations

import numpy as np
import pytest

import meshreel
from meshreel.errors import InputError
from meshreel.export.frames import check_part, write_frames
from meshreel.io.write import frame_names
from tests.golden import GOLDEN

SCENE = GOLDEN / "scene.reel"


def test_each_frame_is_a_file(tmp_path):
    video, done = meshreel.open(SCENE), list[int]()
    paths = [tmp_path / name for name in frame_names(len(video), "ply")]
    assert write_frames(video.moving, paths, done.append) == []
    assert done == list(range(1, len(video) + 1))
    written = meshreel.open_sequence(tmp_path)
    assert len(written) == len(video)
    np.testing.assert_allclose(written[5].vertices, video.moving(5).vertices, atol=1e-5)


def test_a_damaged_frame_loses_the_file_of_an_earlier_run(tmp_path):
    video = meshreel.open((GOLDEN / "mixed.reel").read_bytes()[:-1])
    paths = [tmp_path / name for name in frame_names(10, "ply")]
    paths[9].write_text("old")
    failed = write_frames(video.__getitem__, paths)
    assert len(failed) == 1 and "truncated" in str(failed[0])
    assert sorted(tmp_path.iterdir()) == paths[:9]


def test_a_part_that_the_file_does_not_have_is_refused():
    file = GOLDEN / "mixed.reel"
    with pytest.raises(InputError, match="has no background"):
        check_part(file, meshreel.open(file).reader, "background")
