"""One mesh file per frame."""

import meshreel
from meshreel.export.frames import write_frames
from meshreel.io.write import frame_names
from tests.golden import GOLDEN


def test_a_damaged_frame_loses_the_file_of_an_earlier_run(tmp_path):
    video = meshreel.open((GOLDEN / "mixed.reel").read_bytes()[:-1])
    paths = [tmp_path / name for name in frame_names(10, "ply")]
    paths[9].write_text("old")
    failed = write_frames(video.__getitem__, paths)
    assert len(failed) == 1 and "truncated" in str(failed[0])
    assert sorted(tmp_path.iterdir()) == paths[:9]
