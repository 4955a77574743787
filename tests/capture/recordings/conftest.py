"""The rig of recordings, for tests."""

import pytest

from meshreel.capture.recordings import open_take
from meshreel.capture.recordings.to_rig import write_takes
from meshreel.capture.rig.rig import read_rig


@pytest.fixture
def made(tmp_path):
    """The rig of recordings, and what was said of them."""

    def make(*paths):
        folder = tmp_path / f"rig{len(list(tmp_path.glob('rig*')))}"
        remarks = write_takes([open_take(path) for path in paths], folder)
        return read_rig(folder), remarks

    return make
